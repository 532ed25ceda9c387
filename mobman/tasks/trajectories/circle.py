"""Circles: the paper's, and one that suits any robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.kernels.kernel import kernel, plain
from mobman.kernels.program import Call, call
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.parameters import NOT_ZERO, parameter
from mobman.tasks.task import tasks

_RADIUS = 0.5  # m
_RATE = 0.5  # rad/s
_GAP = 0.1  # m
# of the tip's distance from the arm's base, where that does not drive
_SHARE_OF_REACH = 0.15
_SHARE_OF_RADIUS = 0.2


@dataclass(frozen=True)
class Circle:
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

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p_d and its first three derivatives at time t (s), each of shape (3,)."""
        p_d = np.empty((4, 3))
        plain(_circle)(np.array([t]), self._parameters(), p_d)
        return (p_d[0], p_d[1], p_d[2], p_d[3])

    def steps(self, t: Array, p_d: Array) -> list[Call]:
        """See :func:`mobman.tasks.task.task_steps`."""
        return [call(_circle, t, self._parameters(), p_d)]

    def _parameters(self) -> Array:
        return np.array([*self.centre, self.radius, self.rate, self.phase], dtype=float)


@kernel
def _circle(t: Vector, parameters: Vector, p_d: Matrix) -> None:
    radius, w = parameters[3], parameters[4]
    angle = w * t[0] + parameters[5]
    c, s = radius * math.cos(angle), radius * math.sin(angle)
    for i in range(3):
        p_d[0, i] = parameters[i]
        for order in range(1, 4):
            p_d[order, i] = 0.0
    p_d[0, 0] += c
    p_d[0, 1] += s
    p_d[1, 0], p_d[1, 1] = -s * w, c * w
    p_d[2, 0], p_d[2, 1] = -c * w**2, -s * w**2
    p_d[3, 0], p_d[3, 1] = s * w**3, -c * w**3


def paper_circle(robot: MobileManipulator, q0: Array) -> Circle:
    """The paper's task, section 4, for its youBot: (2 + cos t, 3 + sin t, 0.35)."""
    return Circle(centre=(2.0, 3.0, 0.35), radius=1.0, rate=1.0, name="paper")


def circle_near_tip(
    robot: MobileManipulator,
    q0: Array,
    *,
    radius: Annotated[
        float | None,
        parameter(
            "m", "radius; 0.5 m, on a fixed base 0.15 times the tip's distance from it", gt=0
        ),
    ] = None,
    rate: Annotated[float, parameter("rad/s", "positive for anticlockwise"), NOT_ZERO] = _RATE,
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
    tip = np.asarray(robot.tip_pose(q0).translation)
    if "base_x" not in robot.joint_names:
        return _circle_before_base(robot, q0, tip, radius, rate, gap)
    radius = _RADIUS if radius is None else radius
    gap = _GAP if gap is None else gap
    heading = float(q0[robot.joint_names.index("base_theta")])
    side = math.copysign(1.0, rate)  # the centre is on the left of one who goes anticlockwise
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    left = np.array([-math.sin(heading), math.cos(heading), 0.0])
    centre = tip + gap * ahead + side * radius * left
    return _horizontal(centre, radius, rate, heading - side * 0.5 * math.pi)


def _circle_before_base(
    robot: MobileManipulator,
    q0: Array,
    tip: Array,
    radius: float | None,
    rate: float,
    gap: float | None,
) -> Circle:
    arm = tip - robot.arm_origin(q0)
    outward = math.atan2(arm[1], arm[0])
    radius = _SHARE_OF_REACH * float(np.linalg.norm(arm)) if radius is None else radius
    share = _SHARE_OF_RADIUS if gap is None else gap / radius
    inward = -np.array([math.cos(outward), math.sin(outward), 0.0])
    return _horizontal(tip + (1.0 + share) * radius * inward, radius, rate, outward)


def _horizontal(centre: Array, radius: float, rate: float, phase: float) -> Circle:
    x, y, z = (float(coordinate) for coordinate in centre)
    return Circle(centre=(x, y, z), radius=radius, rate=rate, phase=phase)


tasks.register("paper", paper_circle)
tasks.register("circle", circle_near_tip)
