"""To where the extended Jacobian J (13) loses its rank although j does not, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mobman.arrays import Array
from mobman.errors import SingularityError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.tasks.parameters import parameter
from mobman.tasks.paths.excursion import PAUSE, TRAVEL, Pause, Travel, excursion
from mobman.tasks.paths.extended_solution import nearest_degeneracy
from mobman.tasks.paths.placement import Place, place_of
from mobman.tasks.paths.point_to_point import PointToPoint
from mobman.tasks.task import tasks

_HEADINGS = 8
_REACHES = 6.0  # how far it is looked for
_DIGITS = 4  # of lengths (m), the same on all machines
_SMALL = 1e-6


@dataclass(frozen=True)
class ToTheFold(PointToPoint):
    """The path, and what is on it.

    Args:
        depth: How far its end is beyond the singularity (m); negative if it is short of it.
        singular_value: Least singular value of j_e (43) at the singularity: j has its rank there.
    """

    depth: float = 0.0
    singular_value: float = 0.0


def algorithmic_singularity(
    robot: MobileManipulator,
    q0: Array,
    *,
    depth: Annotated[
        float, parameter("m", "how far beyond the singularity; negative: short of it")
    ] = 0.05,
    farthest: Annotated[
        float | None,
        parameter("m", "how far to look for one; 6 times the tip's distance", gt=0),
    ] = None,
    travel: Travel = TRAVEL,
    pause: Pause = PAUSE,
) -> ToTheFold:
    """From the tip along a line, or around one corner, through the nearest such place, and back.

    A criterion is a spring: it holds the platform and the arm where they rest, and the task pushes the
    tip away. Where the arm is pushed towards its base, it buckles as a column does: the criterion's
    minimum under the task's constraints ceases to be one, N (H + D) N^T and with it J lose their rank.
    The solution of the extended task is followed along lines in ten directions, and along those that
    turn off from the line towards the base, until one comes to such a place.

    Raises:
        UsageError: If there is none, or depth takes the end of the path back to the last corner.
    """
    who = f"task 'algorithmic-singularity': robot {robot.name!r}"
    if robot.nz <= TaskMap().m:
        raise UsageError(f"{who} has no redundant degree of freedom, so that J is j_e")
    place = place_of(robot, q0)
    inward = _inward(robot, q0, place)
    aside = np.array([-inward[1], inward[0], 0.0])
    angles = 2.0 * math.pi / _HEADINGS * np.arange(_HEADINGS)
    level = [math.cos(angle) * inward + math.sin(angle) * aside for angle in angles]
    reach = _REACHES * place.reach if farthest is None else farthest
    try:
        found = nearest_degeneracy(
            robot,
            q0,
            directions=[*level, place.up, -place.up],
            turns=[aside, -aside, place.up, -place.up],
            farthest=reach,
            scale=place.reach,
        )
    except (SingularityError, np.linalg.LinAlgError) as error:
        raise UsageError(f"{who} cannot start there: {error}") from error
    if found is None:
        raise UsageError(
            f"{who} comes to no algorithmic singularity of its posture criterion within {reach:.3g} m "
            "on the lines that are looked at; another criterion in its description, or a larger "
            "'farthest', may have one"
        )
    *corners, last, end = found.corners
    way = end - last
    length = float(np.linalg.norm(way))
    if depth <= -length:
        raise UsageError(
            f"{who}: depth = {depth:g} m leaves nothing of the last {length:.3g} m of the way"
        )
    end = last + (round(length, _DIGITS) + depth) * way / length
    path = excursion("algorithmic-singularity", [*corners, last, end], travel, pause)
    value = round(found.singular_value, _DIGITS)
    return ToTheFold(path.points, path.times, path.repeats, path.name, depth, value)


def _inward(robot: MobileManipulator, q0: Array, place: Place) -> Array:
    """Horizontally from the tip to the arm's first joint; against the heading if it is above that."""
    arm = place.tip - robot.arm_origin(q0)
    level = np.array([arm[0], arm[1], 0.0])
    length = float(np.linalg.norm(level))
    return -level / length if length > _SMALL * place.reach else -place.ahead


tasks.register("algorithmic-singularity", algorithmic_singularity)
