"""Where a robot takes a path: beside its tip at the start, turned its way, in a size for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.paths.harmonics import Harmonics, Triple

SIZE = 0.5
"""Half the length of a path for a platform that drives (m)."""
GAP = 0.1
"""From the tip to where such a path begins (m)."""
SHARE_OF_REACH = 0.15
"""Half the length of a path for an arm alone, over the tip's distance from its base."""
SHARE_OF_RADIUS = 0.2
"""From the tip to such a path, over half its length."""

_POINTS = 256  # of a path, to find how far it goes


@dataclass(frozen=True)
class Place:
    """The tip's surroundings at a start.

    Attributes:
        tip: World coordinates (m), shape (3,).
        ahead, left, up: Axes, shape (3,): of the platform's heading; on a fixed base, ``ahead`` is
            horizontally from the base to the tip.
        reach: The tip's distance from the arm's first joint (m).
        drives: Whether there is a platform that moves.
    """

    tip: Array
    ahead: Array
    left: Array
    reach: float
    drives: bool
    up: Array

    @property
    def size(self) -> float:
        """Half the length of a path that suits the robot (m)."""
        return SIZE if self.drives else SHARE_OF_REACH * self.reach

    @property
    def rise(self) -> float:
        """Half the height of a path that suits the arm (m)."""
        return SHARE_OF_REACH * self.reach


def place_of(robot: MobileManipulator, q0: Array) -> Place:
    """The surroundings of a robot's tip at configuration q0."""
    tip = np.array(robot.tip_pose(q0).translation)
    arm = tip - robot.arm_origin(q0)
    drives = "base_x" in robot.joint_names
    heading = math.atan2(arm[1], arm[0])
    if drives:
        heading = float(q0[robot.joint_names.index("base_theta")])
    return Place(
        tip=tip,
        ahead=np.array([math.cos(heading), math.sin(heading), 0.0]),
        left=np.array([-math.sin(heading), math.cos(heading), 0.0]),
        up=np.array([0.0, 0.0, 1.0]),
        reach=float(np.linalg.norm(arm)),
        drives=drives,
    )


def placed(
    name: str,
    place: Place,
    rate: float,
    cosines: Sequence[Sequence[float]],
    sines: Sequence[Sequence[float]],
) -> Harmonics:
    """A closed path beside the tip.

    A platform that drives has it begin ``GAP`` ahead of the tip and run along the heading first. An arm
    alone has it between the tip and the base, ``SHARE_OF_RADIUS`` of its half length away from the tip.

    Args:
        name: The task's.
        place: Where the tip is.
        rate: rad/s.
        cosines: As those of :class:`Harmonics`, by ``ahead``, ``left`` and ``up``.
        sines: As many.
    """
    local = np.array([cosines, sines], dtype=float)
    axes = np.array([place.ahead, place.left, place.up])
    if place.drives:
        start = local[0].sum(axis=0)
        first = rate * np.arange(1, len(local[1]) + 1) @ local[1]
        turn = -math.atan2(first[1], first[0])
        c, s = math.cos(turn), math.sin(turn)
        axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ axes
        centre = place.tip + GAP * place.ahead - start @ axes
    else:
        centre = place.tip - (1.0 + SHARE_OF_RADIUS) * _radius(local) * place.ahead
    world = local @ axes
    return Harmonics(_triple(centre), rate, _rows(world[0]), _rows(world[1]), name)


def _radius(local: Array) -> float:
    """The largest distance of a path from its centre (m)."""
    angles = np.outer(
        np.linspace(0.0, 2.0 * math.pi, _POINTS, endpoint=False), np.arange(1, 1 + len(local[0]))
    )
    points = np.cos(angles) @ local[0] + np.sin(angles) @ local[1]
    return float(np.linalg.norm(points, axis=1).max())


def _rows(vectors: Array) -> tuple[Triple, ...]:
    return tuple(_triple(vector) for vector in vectors)


def _triple(vector: Array) -> Triple:
    x, y, z = (float(coordinate) for coordinate in vector)
    return (x, y, z)
