"""Computed torque that makes up for what the nominal model does not explain: by an integral of the task
error, ``computed-torque-integral``, by the measured acceleration, ``time-delay``, and by an observer,
``disturbance-observer``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.controllers.baselines import (
    ExtendedJacobianControl,
    Kernels,
    TrackingGains,
    computed_torque,
    inverse_acceleration,
    tracking_acceleration,
)
from mobman.controllers.gains import NotNegative, Positive, condition, gain
from mobman.controllers.motors import LimitedMotors
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Stop, Tracking, error
from mobman.linalg import apply, dot, solve
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


@dataclass(frozen=True, kw_only=True)
class IntegralGains(TrackingGains):
    """Gains of p_d'' - K_v e' - K_p e - K_i (integral of e); by default three poles at -5 /s."""

    K_p: Positive = gain(75.0, "s^-2", "stiffness of the task error")
    K_v: Positive = gain(15.0, "s^-1", "damping of the task error")
    K_i: NotNegative = gain(
        125.0, "s^-3", "factor of the task error's integral; stable below K_p K_v"
    )


class StillAtLimits(LimitedMotors, ExtendedJacobianControl):
    """Base of laws with a state of their own, which stands still while a torque is beyond a limit that
    acts, so that it does not wind up."""

    uses = ("M", "bias", "J'", "limits")
    _state: Array

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again with an empty state."""
        self._limits = np.full(robot.nz, np.inf) if self._acting is None else self._acting
        self._limited = bool(np.isfinite(self._limits).any())
        super().reset(robot, task, dt)

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, shape (nz,); see :class:`Controller`."""
        if not self._limited:
            return super().step(t, q, z, z_dot)
        before = self._state.copy()
        v = super().step(t, q, z, z_dot)
        if (np.abs(v) > self._limits).any():
            self.stand_still(before)
        return v

    def stand_still(self, before: Array) -> None:
        """Forget what the state learned in a tick whose torque does not act: what it was before."""
        self._state[:] = before


@kernel
def integral_acceleration(
    at: Tracking, K_p: float, K_v: float, K_i: float, dt: float, integral: Vector, wanted: Vector
) -> None:
    """The value wanted of J z': p_d'' - K_v e' - K_p e - K_i (integral of e) - J' z."""
    tracking_acceleration(at, K_p, K_v, wanted)
    for i in range(wanted.shape[0]):
        wanted[i] -= K_i * integral[i]
        integral[i] += dt * error(at, i)


@controllers.register("computed-torque-integral")
class ComputedTorqueIntegral(StillAtLimits):
    r"""Law ``extended-jacobian`` with the integral of the error, and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - K_i \int e\,dt - \dot J z),
        \quad B v = M \dot z + Pz + G.

    The integral stands still while a torque is beyond a limit that acts.

    Lewis, Dawson and Abdallah 2004, section 4.4 (PID outer loop).
    """

    name = "computed-torque-integral"
    Gains = IntegralGains
    kernels: Kernels = (integral_acceleration, inverse_acceleration, computed_torque)

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        self._state = self.values["integral"] = np.zeros(self._space.p)
        return super().entries(robot, task)


_CONVERGES = condition(
    "be below 2, else the acceleration's error 1 - mu grows from tick to tick", lambda mu: mu < 2.0
)


@dataclass(frozen=True, kw_only=True)
class TimeDelayGains(IntegralGains):
    """Gains of the outer loop, and the share of the missing acceleration that a tick makes up for."""

    mu: Annotated[Positive, _CONVERGES] = gain(
        0.5, "1", "factor of the nominal M in the torque's increment, below 2; 1: dead-beat"
    )


@kernel
def incremental_torque(
    M: Matrix,
    B: Matrix,
    z_dot: Vector,
    measured: Vector,
    mu: float,
    v: Vector,
    force: Vector,
    work: Matrix,
) -> int:
    """v += mu B^-1 M (z'_d - z'); z'_d, which is ``z_dot``, is overwritten."""
    for i in range(v.shape[0]):
        z_dot[i] = mu * (z_dot[i] - measured[i])
    apply(M, z_dot, force)
    if solve(B, force, z_dot, work) != 0:
        return Stop.NO_INVERSE
    for i in range(v.shape[0]):
        v[i] += z_dot[i]
    return 0


@controllers.register("time-delay")
class TimeDelayControl(ComputedTorqueIntegral):
    r"""The torque of the last tick, and an increment for the acceleration that is still missing:

    .. math:: \dot z_d = J^{-1}(\ddot p_d - K_v \dot e - K_p e - K_i \int e\,dt - \dot J z),
        \quad B v_k = B v_{k-1} + \mu M (\dot z_d - \dot z).

    What acted a tick ago, of the model or unknown, stands in :math:`v_{k-1}` and the measured
    :math:`\dot z`; the bias Pz + G is not needed. With a true inertia :math:`M_0` the missing
    acceleration obeys :math:`\epsilon_{k+1} = (I - \mu M_0^{-1} M)\epsilon_k`, but for what changes
    within a tick. ``mu = 0.5`` bears :math:`M_0` from M/4 up, and torques that act a tick late.

    Torques are cut at the limits that act: the next increment starts from what acted.

    Youcef-Toumi and Ito 1990; Hsia and Gao 1990.
    """

    name = "time-delay"
    Gains = TimeDelayGains
    uses = ("z'", "M", "J'", "limits")
    kernels = (integral_acceleration, inverse_acceleration, incremental_torque)

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits that act, shape (nz,)."""
        super().step(t, q, z, z_dot)  # which stops the integral where a torque is beyond its limit
        np.clip(self._v, -self._limits, self._limits, out=self._v)
        return self._v.copy()


@dataclass(frozen=True, kw_only=True)
class ObserverGains(TrackingGains):
    """Gains of the outer loop, and the observer's bandwidth."""

    K_O: Positive = gain(100.0, "s^-1", "bandwidth of the observer")


@kernel
def observe(
    M: Matrix,
    bias: Vector,
    z: Vector,
    z_dot: Vector,
    share: float,
    dt: float,
    last_z: Vector,
    last_z_dot: Vector,
    D: Vector,
) -> None:
    """Update the estimate D by the tick that is over, and add it to Pz + G.

    Under B v = M z'_d + Pz + G + D the observer's B v - M z' - Pz - G - D is M (z'_d - z').

    Args:
        M, bias, z: The robot now.
        z_dot: Acceleration that is wanted now, z'_d.
        share: What an update makes up for of the estimate's error.
        dt: Sampling period (s).
        last_z: z at the last tick; not a number before the first.
        last_z_dot: z'_d at the last tick.
        D: The estimate.
    """
    if math.isfinite(last_z[0]):
        for i in range(z.shape[0]):
            last_z_dot[i] -= (z[i] - last_z[i]) / dt
        for i in range(z.shape[0]):
            D[i] += share * dot(M[i], last_z_dot)
    for i in range(z.shape[0]):
        bias[i] += D[i]
        last_z[i] = z[i]
        last_z_dot[i] = z_dot[i]


@controllers.register("disturbance-observer")
class DisturbanceObserver(StillAtLimits):
    r"""Law ``extended-jacobian``, less the estimate of what the nominal model does not explain:

    .. math:: B v = M \dot z_d + Pz + G + \hat D, \quad
        \dot{\hat D} = K_O\,(B v - M \dot z - Pz - G - \hat D).

    :math:`\hat D` is D of (17) behind a first-order low pass, here a wrong model included. Over a tick
    :math:`M\dot z` is the difference of z, so no acceleration is measured; with the exact step response
    of the low pass the observer is stable at every ``dt``. A tick in which a torque was beyond a limit
    that acts tells it nothing.

    Ohnishi, Shibata and Murakami 1996; Chen, Ballance, Gawthrop and O'Reilly 2000.
    """

    name = "disturbance-observer"
    Gains = ObserverGains
    signals_in_place = True
    kernels = (tracking_acceleration, inverse_acceleration, observe, computed_torque)

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        self._state = self.values["last_z"] = np.full(robot.nz, math.nan)
        self.D, self.values["last_z_dot"] = np.zeros((2, robot.nz))
        share = -math.expm1(-float(self.gains.K_O) * self._dt)
        self.values |= {"D": self.D, "share": share}
        return super().entries(robot, task)

    def stand_still(self, before: Array) -> None:
        """Take the next tick for the first: the torque of this one is not known."""
        self._state[:] = math.nan

    def signals(self) -> dict[str, Array]:
        """The estimate of D (N m, N), shape (nz,)."""
        return {"disturbance/estimate": self.D}
