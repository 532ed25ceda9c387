"""Circles: the paper's, and one that suits any robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.paths import GAP, SHARE_OF_RADIUS, KernelPath, place_of, triple
from mobman.tasks.task import NOT_ZERO, parameter, tasks


@dataclass(frozen=True)
class Circle(KernelPath):
    """p_d = centre + radius (cos(rate t + phase), sin(rate t + phase), 0).

    Args:
        centre: World coordinates (m), shape (3,).
        radius: m.
        rate: rad/s, positive for anticlockwise.
        phase: Angle at t = 0 (rad).
    """

    centre: tuple[float, float, float]
    radius: float
    rate: float
    phase: float = 0.0
    name: str = "circle"

    @property
    def period(self) -> float:
        """Duration of a lap (s)."""
        return 2.0 * math.pi / abs(self.rate)

    def _kernel(self) -> tuple[Any, ...]:
        parameters = [*self.centre, self.radius, self.rate, self.phase]
        return around, np.array(parameters, dtype=float)


@dataclass(frozen=True)
class PaperCircle(Circle):
    """The paper's circle, with the paper's K_F, by which its numbers are."""

    name: str = "paper"

    def criterion_weights(self, robot: MobileManipulator) -> Array:
        """Diagonal of the K_F that the paper prints for its youBot, shape (nq,).

        0.001 for the platform's pose, 0.0001 for its joint y_1, 0.05 for all others.
        """
        by_name = dict.fromkeys(robot.platform.base_joints, 0.001) | {"y_1": 0.0001}
        return np.array([by_name.get(name, 0.05) for name in robot.joint_names])


@kernel
def around(t: Vector, circle: Vector, p_d: Matrix) -> None:
    """Write the position on a circle, and its derivatives, into the first three columns."""
    radius, w = circle[3], circle[4]
    angle = w * t[0] + circle[5]
    c, s = radius * math.cos(angle), radius * math.sin(angle)
    p_d[0, 0], p_d[0, 1], p_d[0, 2] = circle[0] + c, circle[1] + s, circle[2]
    p_d[1, 0], p_d[1, 1], p_d[1, 2] = -s * w, c * w, 0.0
    p_d[2, 0], p_d[2, 1], p_d[2, 2] = -c * w**2, -s * w**2, 0.0
    p_d[3, 0], p_d[3, 1], p_d[3, 2] = s * w**3, -c * w**3, 0.0


Radius = Annotated[
    float | None,
    parameter("m", "radius; 0.5 m, on a fixed base 0.15 times the tip's distance from it", gt=0),
]
Rate = Annotated[float, parameter("rad/s", "positive for anticlockwise"), NOT_ZERO]


@tasks.register("paper")
def paper_circle(robot: MobileManipulator, q0: Array) -> PaperCircle:
    """The paper's task, section 4, for its youBot: (2 + cos t, 3 + sin t, 0.35)."""
    return PaperCircle(centre=(2.0, 3.0, 0.35), radius=1.0, rate=1.0)


@tasks.register("circle")
def circle_near_tip(
    robot: MobileManipulator,
    q0: Array,
    *,
    radius: Radius = None,
    rate: Rate = 0.5,
    gap: Annotated[
        float | None,
        parameter("m", "from the tip to the path; 0.1 m, on a fixed base 0.2 radii", ge=0),
    ] = None,
) -> Circle:
    """A horizontal circle at the height of the tip at q0, 0.5 rad/s.

    On a platform that drives, 1 m in diameter: it starts 0.1 m ahead of the tip and first runs along
    the platform's heading, the platform on its inside, which follows it within the arm's reach. On a
    fixed base, between the tip and the base: its diameter is 0.3 times their distance.
    """
    place = place_of(robot, q0)
    ahead, left, _ = place.axes
    radius = place.size if radius is None else radius
    if place.drives:
        side = math.copysign(1.0, rate)  # the centre is on the left of one who goes anticlockwise
        gap = GAP if gap is None else gap
        centre = place.tip + gap * ahead + side * radius * left
        phase = place.heading - side * 0.5 * math.pi
    else:
        share = SHARE_OF_RADIUS if gap is None else gap / radius
        centre = place.tip - (1.0 + share) * radius * ahead
        phase = place.heading
    return Circle(triple(centre), radius, rate, phase)
