"""Circles with an orientation that is held, turns or wobbles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import product
from mobman.tasks.circle import Radius, Rate, around, circle_near_tip
from mobman.tasks.paths import SHARE_OF_RADIUS, KernelPath, Quadruple, Triple, place_of, quadruple
from mobman.tasks.task import parameter, tasks

NEAREST = 0.05
"""Least distance of the tip from where such a path begins, by default (m)."""
AWAY = 0.5
"""Angle between the tip at its start and the desired orientation, by default (rad)."""
WOBBLE = 0.3
"""Amplitude of both angles of an orientation that wobbles (rad)."""

Motion = Annotated[
    Literal["hold", "turn", "wobble"],
    parameter("1", "held, turning about the vertical with the path, or wobbling by 0.3 rad"),
]
Gap = Annotated[
    float | None,
    parameter(
        "m", "from the tip to the path; 0.1 m, on a fixed base 0.2 radii, at least 0.05 m", ge=0
    ),
]
Angle = Annotated[
    float, parameter("rad", "from the tip's orientation to the desired one", ge=0, lt=math.pi)
]


@dataclass(frozen=True)
class PoseCircle(KernelPath):
    r"""A horizontal circle, with R_d = Rot(z, psi) Rot(x, chi) R_0 about the world's axes:
    psi = turn t + wobble sin(rate t), chi = wobble sin(2 rate t).

    Args:
        centre: World coordinates (m).
        radius: m.
        rate: rad/s, positive for anticlockwise.
        phase: Angle on the circle at t = 0 (rad).
        start: Orientation at t = 0, unit quaternion (w, x, y, z).
        turn: Rate of turning about the vertical (rad/s).
        wobble: rad.
    """

    centre: Triple
    radius: float
    rate: float
    phase: float
    start: Quadruple
    turn: float = 0.0
    wobble: float = 0.0
    name: str = "pose-circle"

    width = 7

    @property
    def period(self) -> float:
        """Duration of a lap (s)."""
        return 2.0 * math.pi / abs(self.rate)

    def _kernel(self) -> tuple[Any, ...]:
        circle = [*self.centre, self.radius, self.rate, self.phase]
        turning = [*self.start, self.turn, self.wobble, self.rate]
        return _pose_circle, np.array(circle, dtype=float), np.array(turning, dtype=float)


@kernel
def _pose_circle(t: Vector, circle: Vector, turning: Vector, p_d: Matrix) -> None:
    around(t, circle, p_d)
    turned(t, turning, p_d)


@kernel
def turned(t: Vector, turning: Vector, p_d: Matrix) -> None:
    """Write the quaternion of Rot(z, psi) Rot(x, chi) R_0, Omega_d and its derivatives into the last
    columns, shape (4, 7)."""
    turn, size, w = turning[4], turning[5], turning[6]
    c, s = math.cos(w * t[0]), math.sin(w * t[0])
    c_2, s_2 = math.cos(2.0 * w * t[0]), math.sin(2.0 * w * t[0])
    psi, psi_1 = turn * t[0] + size * s, turn + size * w * c
    psi_2, psi_3 = -size * w**2 * s, -size * w**3 * c
    chi, chi_1 = size * s_2, 2.0 * size * w * c_2
    chi_2, chi_3 = -4.0 * size * w**2 * s_2, -8.0 * size * w**3 * c_2
    # quaternion of Rot(z, psi) Rot(x, chi), times that of R_0
    a, b = math.cos(0.5 * psi), math.sin(0.5 * psi)
    e, f = math.cos(0.5 * chi), math.sin(0.5 * chi)
    R_0 = (turning[0], turning[1], turning[2], turning[3])
    p_d[0, 3], p_d[0, 4], p_d[0, 5], p_d[0, 6] = product((a * e, a * f, b * f, b * e), R_0)
    # Omega_d = psi' z + chi' x', with the axis x' = (cos psi, sin psi, 0) of the second turn
    c, s = math.cos(psi), math.sin(psi)
    p_d[1, 3], p_d[1, 4], p_d[1, 5] = chi_1 * c, chi_1 * s, psi_1
    p_d[2, 3] = chi_2 * c - chi_1 * psi_1 * s
    p_d[2, 4] = chi_2 * s + chi_1 * psi_1 * c
    p_d[2, 5] = psi_2
    across = 2.0 * chi_2 * psi_1 + chi_1 * psi_2
    p_d[3, 3] = (chi_3 - chi_1 * psi_1**2) * c - across * s
    p_d[3, 4] = (chi_3 - chi_1 * psi_1**2) * s + across * c
    p_d[3, 5] = psi_3
    p_d[1, 6] = p_d[2, 6] = p_d[3, 6] = 0.0


def oriented_circle(
    robot: MobileManipulator,
    q0: Array,
    orientation: Motion,
    radius: float | None,
    rate: float,
    gap: float | None,
    angle: float,
) -> dict[str, Any]:
    """The fields of a circle near the tip, whose orientation at t = 0 is that of the tip turned by an
    angle about the diagonal of the directions ahead, left and up."""
    place = place_of(robot, q0)
    radius = place.size if radius is None else radius
    if gap is None and not place.drives:
        gap = max(NEAREST, SHARE_OF_RADIUS * radius)
    circle = circle_near_tip(robot, q0, radius=radius, rate=rate, gap=gap)
    diagonal = place.axes.sum(axis=0) / math.sqrt(3.0)
    start = pin.exp3(angle * diagonal) @ robot.tip_pose(q0).rotation
    return {
        **{name: getattr(circle, name) for name in ("centre", "radius", "rate", "phase")},
        "start": quadruple(start),
        "turn": rate if orientation == "turn" else 0.0,
        "wobble": WOBBLE if orientation == "wobble" else 0.0,
    }


@tasks.register("pose-circle")
def pose_circle(
    robot: MobileManipulator,
    q0: Array,
    *,
    orientation: Motion = "hold",
    radius: Radius = None,
    rate: Rate = 0.5,
    gap: Gap = None,
    angle: Angle = AWAY,
) -> PoseCircle:
    """A horizontal circle as that of ``circle``, with an orientation 0.5 rad from that of the tip at q0,
    which is held, turns about the vertical as the path does, or wobbles about two axes."""
    return PoseCircle(**oriented_circle(robot, q0, orientation, radius, rate, gap, angle))
