"""Robust laws: computed torque that makes up for what the nominal model does not explain, by an integral
of the task error, ``computed-torque-integral``, by the measured acceleration, ``time-delay``, by an
observer, ``disturbance-observer``, and by sliding modes of the first order, ``first-order-sliding`` (a
unit vector with a layer), and of the second, ``super-twisting``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

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
from mobman.controllers.gains import (
    Auto,
    CriterionGains,
    NotNegative,
    Positive,
    bound,
    condition,
    gain,
)
from mobman.controllers.motors import LimitedMotors
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Stop, Tracking, desired, error, error_rate
from mobman.linalg import apply, dot, solve
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_LAYER = 5.0  # ticks: in the layer the sampled loop's pole is then at 1 - 1/5
_ROOT, _SIGN = 1.5, 1.1  # k_1 = 1.5 sqrt(L), k_2 = 1.1 L: Levant's choice
_RAMP = 4.0  # of k_2 dt^2: puts both poles of the sampled loop near sigma = 0 at 1/2


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


# Sliding modes ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class SlidingSurfaceGains(CriterionGains):
    """Gains of the surface sigma = e' + Lambda e, and the criterion that extends the task."""

    Lambda: Positive = gain(5.0, "s^-1", "slope of the sliding surface e' + Lambda e = 0")


@kernel
def surface(at: Tracking, Lambda: float, i: int) -> float:
    """Component i of sigma = e' + Lambda e."""
    return float(error_rate(at, i) + Lambda * error(at, i))


@dataclass(frozen=True, kw_only=True)
class UnitVectorGains(SlidingSurfaceGains):
    """Gains of the unit vector."""

    rho: Positive = gain(200.0, "m/s^2", "bound of the unknown acceleration J z' of the task")
    layer: Annotated[float | Auto, bound("the unit vector is not continuous without")] = gain(
        "auto", "m/s", "width of the boundary layer of sigma; auto: 5 rho dt"
    )


@kernel
def unit_vector_acceleration(
    at: Tracking, Lambda: float, rho: float, layer: float, wanted: Vector
) -> None:
    """The value wanted of J z': p_d'' - Lambda e' - rho sigma/max(|sigma|, layer) - J' z."""
    size = 0.0
    for i in range(wanted.shape[0]):
        size += surface(at, Lambda, i) ** 2
    size = max(math.sqrt(size), layer)
    for i in range(wanted.shape[0]):
        sliding = rho * surface(at, Lambda, i) / size
        p_ddot = desired(at.p_d, 2, i)
        wanted[i] = p_ddot - Lambda * error_rate(at, i) - sliding - at.J_dot_z[i]


@controllers.register("first-order-sliding")
class FirstOrderSliding(ExtendedJacobianControl):
    r"""Unit-vector control of :math:`\sigma = \dot e + \Lambda e` on computed torque:

    .. math:: \dot z = J^{-1}\left(\ddot p_d - \Lambda \dot e
        - \rho\,\frac{\sigma}{\max(|\sigma|, \delta)} - \dot J z\right),
        \quad B v = M \dot z + Pz + G.

    Outside the layer :math:`\delta`, :math:`|\sigma|` falls at least at :math:`\rho` less the unknown
    acceleration; inside it, the loop is linear with the pole :math:`-\rho/\delta`, and an error of up to
    :math:`\delta/\Lambda` remains. By default :math:`\rho` is 20 g, since a payload on a light arm means
    more than 10 g to the task, and the layer is as thin as the sampling allows without chattering:
    five ticks of :math:`\rho`, so that the pole is at -200 /s for 1 kHz.

    Gutman 1979; Corless and Leitmann 1981; Slotine and Li 1991, chapter 7.
    """

    name = "first-order-sliding"
    Gains: Any = UnitVectorGains
    kernels = (unit_vector_acceleration, inverse_acceleration, computed_torque)

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        if self.gains.layer == "auto":
            self.values["layer"] = _LAYER * self.gains.rho * self._dt
        self._settings["layer"] = self.values["layer"]
        return super().entries(robot, task)


@dataclass(frozen=True, kw_only=True)
class TwistingGains(SlidingSurfaceGains):
    """Gains of the surface and of the twisting on it."""

    L: Positive = gain(
        100.0, "m/s^3", "bound of the rate of the unknown acceleration J z' of the task"
    )


@kernel
def twist(sigma: float, L: float, dt: float, w: Vector, i: int) -> float:
    """u of a tick; w[i] is advanced to the next."""
    # sigma+ = sigma - dt k_1 |sigma+|^(1/2) sign sigma+, solved for |sigma+|^(1/2)
    root = dt * _ROOT * math.sqrt(L)
    half = 0.5 * (math.sqrt(root**2 + 4.0 * abs(sigma)) - root)
    u = (math.copysign(half**2, sigma) - sigma) / dt + w[i]
    k_2 = _SIGN * L
    w[i] -= dt * k_2 * max(-1.0, min(1.0, sigma / (_RAMP * k_2 * dt**2)))
    return float(u)


@kernel
def twisting_acceleration(
    at: Tracking, Lambda: float, L: float, dt: float, w: Vector, wanted: Vector
) -> None:
    """The value wanted of J z': p_d'' - Lambda e' + u - J' z."""
    for i in range(wanted.shape[0]):
        u = twist(surface(at, Lambda, i), L, dt, w, i)
        wanted[i] = desired(at.p_d, 2, i) - Lambda * error_rate(at, i) + u - at.J_dot_z[i]


@controllers.register("super-twisting")
class SuperTwisting(StillAtLimits):
    r"""The super-twisting algorithm, by component, on :math:`\sigma = \dot e + \Lambda e`:

    .. math:: \dot z = J^{-1}(\ddot p_d - \Lambda \dot e + u - \dot J z),
        \quad u = -k_1 |\sigma|^{1/2} \mathrm{sign}\,\sigma + w,
        \quad \dot w = -k_2\,\mathrm{sign}\,\sigma, \quad B v = M \dot z + Pz + G,

    with :math:`k_1 = 1.5\sqrt L`, :math:`k_2 = 1.1 L`: :math:`\sigma` and its rate are 0 after a finite
    time if the unknown acceleration of the task changes by less than L in a second.

    While a torque is beyond a limit that acts, w stands still; Levant lets it fall, w' = -u.

    The root is sampled in its implicit Euler form, which does not chatter, and the sign in w' is a ramp
    of the width :math:`4 k_2 dt^2`. Without the ramp w is a tick behind, with the poles of the sampled
    loop on the unit circle.

    Levant 1993; Moreno and Osorio 2012; sampled: Brogliato, Polyakov and Efimov 2020.
    """

    name = "super-twisting"
    Gains: Any = TwistingGains
    kernels = (twisting_acceleration, inverse_acceleration, computed_torque)

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        self._state = self.values["w"] = np.zeros(self._space.p)
        return super().entries(robot, task)
