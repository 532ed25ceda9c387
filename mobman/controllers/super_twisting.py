"""Second-order sliding mode on computed torque, ``super-twisting``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.controllers.baselines import ExtendedJacobianControl
from mobman.controllers.first_order_sliding import SlidingSurfaceGains, surface
from mobman.controllers.gains import gain, require_positive
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import TaskSpace, desired
from mobman.linalg import dot

_ROOT, _SIGN = 1.5, 1.1  # k_1 = 1.5 sqrt(L), k_2 = 1.1 L: Levant's choice
_RAMP = 4.0  # of k_2 dt^2: puts both poles of the sampled loop near sigma = 0 at 1/2


@dataclass(frozen=True, kw_only=True)
class TwistingGains(SlidingSurfaceGains):
    """Gains of the surface and of the twisting on it."""

    L: float = gain(
        100.0, "m/s^3", "bound of the rate of the unknown acceleration J z' of the task"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "L")


class SuperTwisting(ExtendedJacobianControl):
    r"""The super-twisting algorithm, by component, on :math:`\sigma = \dot e + \Lambda e`:

    .. math:: \dot z = J^{-1}(\ddot p_d - \Lambda \dot e + u - \dot J z),
        \quad u = -k_1 |\sigma|^{1/2} \mathrm{sign}\,\sigma + w,
        \quad \dot w = -k_2\,\mathrm{sign}\,\sigma, \quad B v = M \dot z + Pz + G,

    with :math:`k_1 = 1.5\sqrt L`, :math:`k_2 = 1.1 L`: :math:`\sigma` and its rate are 0 after a finite
    time if the unknown acceleration of the task changes by less than L in a second.

    The root is sampled in its implicit Euler form, which does not chatter, and the sign in w' is a ramp
    of the width :math:`4 k_2 dt^2`. Without the ramp w is a tick behind, with the poles of the sampled
    loop on the unit circle.

    A. Levant, "Sliding order and sliding accuracy in sliding mode control", International Journal of
    Control 58(6), 1993; J. A. Moreno, M. Osorio, "Strict Lyapunov functions for the super-twisting
    algorithm", IEEE Transactions on Automatic Control 57(4), 2012; B. Brogliato, A. Polyakov, D. Efimov,
    "The implicit discretization of the supertwisting sliding-mode control algorithm", the same 65(8),
    2020.
    """

    name = "super-twisting"
    Gains: Any = TwistingGains

    def feedback(self, space: TaskSpace, wanted: Array) -> Callable[[], object]:
        """See :class:`ExtendedJacobianControl`."""
        return bind(
            twisting_acceleration,
            *(space.f, space.J, space.J_dot_z, space.p_d, space.now.z),
            *map(float, (self.gains.Lambda, self.gains.L, self._dt)),
            *(np.zeros(space.p), wanted),
        )


@kernel
def twisting_acceleration(
    f: Vector,
    J: Matrix,
    J_dot_z: Vector,
    p_d: Matrix,
    z: Vector,
    Lambda: float,
    L: float,
    dt: float,
    w: Vector,
    wanted: Vector,
) -> None:
    """The value wanted of J z': p_d'' - Lambda e' + u - J' z."""
    for i in range(wanted.shape[0]):
        sigma = surface(f, J, p_d, z, Lambda, i)
        e_dot = dot(J[i], z) - desired(p_d, 1, i)
        u = twist(sigma, L, dt, w, i)
        wanted[i] = desired(p_d, 2, i) - Lambda * e_dot + u - J_dot_z[i]


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


controllers.register(SuperTwisting.name, SuperTwisting)
