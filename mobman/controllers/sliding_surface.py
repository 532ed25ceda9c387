"""Sliding modes on computed torque: of the first order, ``first-order-sliding`` (a unit vector with a
layer), and of the second, ``super-twisting``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mobman.arrays import Vector
from mobman.compiled import kernel
from mobman.controllers.baselines import (
    ExtendedJacobianControl,
    computed_torque,
    inverse_acceleration,
)
from mobman.controllers.disturbance_rejection import StillAtLimits
from mobman.controllers.gains import Auto, CriterionGains, Positive, bound, gain
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Tracking, desired, error, error_rate
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_LAYER = 5.0  # ticks: in the layer the sampled loop's pole is then at 1 - 1/5
_ROOT, _SIGN = 1.5, 1.1  # k_1 = 1.5 sqrt(L), k_2 = 1.1 L: Levant's choice
_RAMP = 4.0  # of k_2 dt^2: puts both poles of the sampled loop near sigma = 0 at 1/2


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
