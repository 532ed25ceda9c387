"""To where the tip cannot be moved any farther, and back: j of (13) loses its rank there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.parameters import parameter
from mobman.tasks.paths.excursion import PAUSE, TRAVEL, Pause, Travel, excursion
from mobman.tasks.paths.placement import Place, place_of
from mobman.tasks.paths.point_to_point import PointToPoint
from mobman.tasks.paths.stretch import least_singular_value, stretched
from mobman.tasks.task import tasks

_DIGITS = 6


@dataclass(frozen=True)
class ToTheBoundary(PointToPoint):
    """The path, and what is at its end.

    Args:
        depth: How far its end is beyond what the tip reaches (m); negative if it is short of it.
        singular_value: Least singular value of j_e (43) where the arm reaches farthest; what a joint
            that slides, or a limit, leaves of the rank.
    """

    depth: float = 0.0
    singular_value: float = 0.0


def kinematic_singularity(
    robot: MobileManipulator,
    q0: Array,
    *,
    depth: Annotated[
        float, parameter("m", "how far beyond what the tip reaches; negative: short of it")
    ] = 0.0,
    direction: Annotated[
        Literal["up", "down", "out"] | None,
        parameter("1", "up or down; on a fixed base also out, away from it, the default there"),
    ] = None,
    within_limits: Annotated[
        bool, parameter("1", "whether the limits of the joints that turn count")
    ] = False,
    travel: Travel = TRAVEL,
    pause: Pause = PAUSE,
) -> ToTheBoundary:
    """From the tip to its highest (lowest, farthest) point that the arm reaches, and back.

    There the tip cannot be moved that way at all, so that j loses its rank, whatever the platform does:
    it drives in the plane. An arm whose tip slides that way has no such point but the slide's limit,
    which simulation does not enforce: its rank stays, see ``singular_value``.

    Raises:
        UsageError: If a platform that drives is asked to go out; if depth takes the end of the path
            back to the tip.
    """
    place = place_of(robot, q0)
    if direction == "out" and place.drives:
        raise UsageError(
            f"task 'kinematic-singularity': robot {robot.name!r} drives, so that no point is too far "
            "out for it; allowed for 'direction': up, down"
        )
    way = _way(robot, q0, place, direction or ("up" if place.drives else "out"))
    farthest = stretched(robot, q0, way, within_limits=within_limits)
    displacement = np.array(robot.tip_pose(farthest).translation) - place.tip
    reach = float(way @ displacement)
    if depth <= -reach:
        raise UsageError(
            f"task 'kinematic-singularity': depth = {depth:g} m leaves nothing of the {reach:.3g} m "
            "that the tip has to go"
        )
    # what does not matter is rounded, to be the same on all machines
    aside = np.round(displacement - reach * way, _DIGITS)
    end = place.tip + aside + (round(reach, 2 * _DIGITS) + depth) * way
    path = excursion("kinematic-singularity", [place.tip, end], travel, pause)
    value = round(least_singular_value(robot, farthest), _DIGITS)
    return ToTheBoundary(path.points, path.times, path.repeats, path.name, depth, value)


def _way(robot: MobileManipulator, q0: Array, place: Place, direction: str) -> Array:
    if direction == "out":
        arm = place.tip - robot.arm_origin(q0)
        return arm / np.linalg.norm(arm)
    return place.up if direction == "up" else -place.up


tasks.register("kinematic-singularity", kinematic_singularity)
