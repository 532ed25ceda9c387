"""Computed torque with an integral of the task error, ``computed-torque-integral``, and time-delay
control, ``time-delay``: incremental computed torque from the measured acceleration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.controllers.baselines import (
    ExtendedJacobianControl,
    TrackingGains,
    tracking_acceleration,
    workspace,
)
from mobman.controllers.gains import NotNegative, Positive, gain
from mobman.controllers.limits import LimitedMotors
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Stop, TaskSpace, Tracking, error
from mobman.errors import GainError
from mobman.linalg import apply, solve
from mobman.model.dynamics import Buffers
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


@controllers.register("computed-torque-integral")
class ComputedTorqueIntegral(StillAtLimits):
    r"""Law ``extended-jacobian`` with the integral of the error, and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - K_i \int e\,dt - \dot J z),
        \quad B v = M \dot z + Pz + G.

    F. L. Lewis, D. M. Dawson, C. T. Abdallah, "Robot Manipulator Control: Theory and Practice",
    Marcel Dekker 2004, section 4.4 (PID outer loop).

    The integral stands still while a torque is beyond a limit that acts.
    """

    name = "computed-torque-integral"
    Gains = IntegralGains

    def resolved(self, space: TaskSpace, wanted: Array) -> Callable[[], object]:
        self._state = np.zeros(space.p)
        given = (*self.numbers("K_p", "K_v", "K_i"), self._dt, self._state, wanted)
        return bind(integral_acceleration, space.tracking, *given)


@kernel
def integral_acceleration(
    at: Tracking, K_p: float, K_v: float, K_i: float, dt: float, integral: Vector, wanted: Vector
) -> None:
    """The value wanted of J z': p_d'' - K_v e' - K_p e - K_i (integral of e) - J' z."""
    tracking_acceleration(at, K_p, K_v, wanted)
    for i in range(wanted.shape[0]):
        wanted[i] -= K_i * integral[i]
        integral[i] += dt * error(at, i)


@dataclass(frozen=True, kw_only=True)
class TimeDelayGains(IntegralGains):
    """Gains of the outer loop, and the share of the missing acceleration that a tick makes up for."""

    mu: Positive = gain(
        0.5, "1", "factor of the nominal M in the torque's increment, below 2; 1: dead-beat"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.mu < 2.0:
            raise GainError(
                f"mu = {self.mu!r}: must be below 2, else the acceleration's error 1 - mu grows from "
                "tick to tick"
            )


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

    K. Youcef-Toumi, O. Ito, "A time delay controller for systems with unknown dynamics", ASME Journal
    of Dynamic Systems, Measurement, and Control 112(1), 1990; T. C. Hsia, L. S. Gao, "Robot
    manipulator control using decentralized linear time-invariant time-delayed joint controllers",
    IEEE International Conference on Robotics and Automation, 1990.
    """

    name = "time-delay"
    Gains = TimeDelayGains
    uses = ("z'", "M", "J'", "limits")

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits that act, shape (nz,)."""
        super().step(t, q, z, z_dot)  # which stops the integral where a torque is beyond its limit
        np.clip(self._v, -self._limits, self._limits, out=self._v)
        return self._v.copy()

    def torque(self, now: Buffers, z_dot: Array, v: Array) -> Entry:
        given = (now.M, now.B, z_dot, self._measured, *self.numbers("mu"), v, np.zeros(len(v)))
        return bind(incremental_torque, *given, *workspace(len(v)))


@kernel
def incremental_torque(
    M: Matrix,
    B: Matrix,
    z_dot: Vector,
    measured: Vector,
    mu: float,
    v: Vector,
    missing: Vector,
    force: Vector,
    work: Matrix,
) -> int:
    """v += mu B^-1 M (z'_d - z'); the last three are work space."""
    for i in range(v.shape[0]):
        missing[i] = mu * (z_dot[i] - measured[i])
    apply(M, missing, force)
    if solve(B, force, missing, work) != 0:
        return Stop.NO_INVERSE
    for i in range(v.shape[0]):
        v[i] += missing[i]
    return 0
