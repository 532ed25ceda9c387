"""Circles on which an axis of the tip points where it should; the turn about that axis is free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import cross, rotated
from mobman.tasks.circle import Radius, Rate, around
from mobman.tasks.paths import Triple
from mobman.tasks.pose_circle import AWAY, Angle, Gap, Motion, PoseCircle, oriented_circle, turned
from mobman.tasks.task import parameter, tasks

_AXES: dict[str, Triple] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


@dataclass(frozen=True)
class PointingCircle(PoseCircle):
    """A :class:`PoseCircle` with R_d ``tip_axis`` as the desired direction of that axis.

    Args:
        tip_axis: In the tip frame, of length 1.
    """

    tip_axis: Triple = (0.0, 0.0, 1.0)
    name: str = "pointing-circle"

    width = 6

    def _kernel(self) -> tuple[Any, ...]:
        _, circle, turning = super()._kernel()
        axis = np.array(self.tip_axis, dtype=float)
        return _pointing_circle, circle, turning, axis, np.zeros((4, 7)), np.zeros(3)


@kernel
def _pointing_circle(
    t: Vector,
    circle: Vector,
    turning: Vector,
    axis: Vector,
    pose: Matrix,
    work: Vector,
    p_d: Matrix,
) -> None:
    around(t, circle, p_d)
    turned(t, turning, pose)
    d, d_1, d_2, d_3 = p_d[0, 3:6], p_d[1, 3:6], p_d[2, 3:6], p_d[3, 3:6]
    omega, omega_1, omega_2 = pose[1, 3:6], pose[2, 3:6], pose[3, 3:6]
    rotated(pose[0, 3:7], axis, d)
    cross(omega, d, d_1)  # d' = Omega x d, and its derivatives by the product rule
    cross(omega_1, d, d_2)
    cross(omega, d_1, work)
    for i in range(3):
        d_2[i] += work[i]
    cross(omega_2, d, d_3)
    cross(omega_1, d_1, work)
    for i in range(3):
        d_3[i] += 2.0 * work[i]
    cross(omega, d_2, work)
    for i in range(3):
        d_3[i] += work[i]


@tasks.register("pointing-circle")
def pointing_circle(
    robot: MobileManipulator,
    q0: Array,
    *,
    orientation: Motion = "hold",
    axis: Annotated[
        Literal["x", "y", "z", "-x", "-y", "-z"],
        parameter("1", "the axis of the tip frame that points"),
    ] = "z",
    radius: Radius = None,
    rate: Rate = 0.5,
    gap: Gap = None,
    angle: Angle = AWAY,
) -> PointingCircle:
    """The circle of ``pose-circle``, on which an axis of the tip has the direction that it would have
    there."""
    fields = oriented_circle(robot, q0, orientation, radius, rate, gap, angle)
    return PointingCircle(**fields, tip_axis=_AXES[axis])
