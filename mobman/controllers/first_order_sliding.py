"""First-order sliding mode on computed torque, ``first-order-sliding``: a unit vector with a layer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.controllers.baselines import ExtendedJacobianControl
from mobman.controllers.criterion_gains import CriterionGains
from mobman.controllers.gains import (
    Auto,
    gain,
    require_bound,
    require_positive,
)
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import TaskSpace, desired
from mobman.linalg import dot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_LAYER = 5.0  # ticks: in the layer the sampled loop's pole is then at 1 - 1/5


@dataclass(frozen=True, kw_only=True)
class SlidingSurfaceGains(CriterionGains):
    """Gains of the surface sigma = e' + Lambda e, and the criterion that extends the task."""

    Lambda: float = gain(5.0, "s^-1", "slope of the sliding surface e' + Lambda e = 0")

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "Lambda")


@dataclass(frozen=True, kw_only=True)
class UnitVectorGains(SlidingSurfaceGains):
    """Gains of the unit vector."""

    rho: float = gain(200.0, "m/s^2", "bound of the unknown acceleration J z' of the task")
    layer: float | Auto = gain(
        "auto", "m/s", "width of the boundary layer of sigma; auto: 5 rho dt"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "rho")
        require_bound(self, "layer", "the unit vector is not continuous without")


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

    S. Gutman, "Uncertain dynamical systems: a Lyapunov min-max approach", IEEE Transactions on Automatic
    Control 24(3), 1979; M. J. Corless, G. Leitmann, "Continuous state feedback guaranteeing uniform
    ultimate boundedness for uncertain dynamic systems", the same 26(5), 1981; J.-J. E. Slotine, W. Li,
    "Applied Nonlinear Control", Prentice Hall 1991, chapter 7.
    """

    name = "first-order-sliding"
    Gains: Any = UnitVectorGains

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again; an "auto" layer is found here."""
        layer = self.gains.layer
        self._layer = _LAYER * self.gains.rho * dt if isinstance(layer, str) else float(layer)
        super().reset(robot, task, dt)
        self._settings["layer"] = self._layer

    def feedback(self, space: TaskSpace, wanted: Array) -> Callable[[], object]:
        """See :class:`ExtendedJacobianControl`."""
        return bind(
            unit_vector_acceleration,
            *(space.f, space.J, space.J_dot_z, space.p_d, space.now.z),
            *map(float, (self.gains.Lambda, self.gains.rho, self._layer)),
            wanted,
        )


@kernel
def unit_vector_acceleration(
    f: Vector,
    J: Matrix,
    J_dot_z: Vector,
    p_d: Matrix,
    z: Vector,
    Lambda: float,
    rho: float,
    layer: float,
    wanted: Vector,
) -> None:
    """The value wanted of J z': p_d'' - Lambda e' - rho sigma/max(|sigma|, layer) - J' z."""
    size = 0.0
    for i in range(wanted.shape[0]):
        size += surface(f, J, p_d, z, Lambda, i) ** 2
    size = max(math.sqrt(size), layer)
    for i in range(wanted.shape[0]):
        sigma = surface(f, J, p_d, z, Lambda, i)
        e_dot = dot(J[i], z) - desired(p_d, 1, i)
        wanted[i] = desired(p_d, 2, i) - Lambda * e_dot - rho * sigma / size - J_dot_z[i]


@kernel
def surface(f: Vector, J: Matrix, p_d: Matrix, z: Vector, Lambda: float, i: int) -> float:
    """Component i of sigma = e' + Lambda e."""
    e, e_dot = f[i] - desired(p_d, 0, i), dot(J[i], z) - desired(p_d, 1, i)
    return float(e_dot + Lambda * e)


controllers.register(FirstOrderSliding.name, FirstOrderSliding)
