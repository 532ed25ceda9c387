"""A figure of eight: turns both ways in one lap."""

from __future__ import annotations

from typing import Annotated

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.parameters import NOT_ZERO, parameter
from mobman.tasks.paths.harmonics import Harmonics
from mobman.tasks.paths.placement import place_of, placed
from mobman.tasks.task import tasks


def figure_eight(
    robot: MobileManipulator,
    q0: Array,
    *,
    length: Annotated[
        float | None,
        parameter("m", "from end to end; 1 m, on a fixed base 0.3 times the tip's distance", gt=0),
    ] = None,
    width: Annotated[float | None, parameter("m", "of a loop; half the length", gt=0)] = None,
    rate: Annotated[float, parameter("rad/s", "2 pi over the period"), NOT_ZERO] = 0.5,
) -> Harmonics:
    """A horizontal lemniscate of Gerono, (a cos(w t), b sin(2 w t)), from one of its ends."""
    place = place_of(robot, q0)
    a = place.size if length is None else 0.5 * length
    b = 0.5 * a if width is None else 0.5 * width
    none = (0.0, 0.0, 0.0)
    return placed("figure-eight", place, rate, [(a, 0.0, 0.0), none], [none, (0.0, b, 0.0)])


tasks.register("figure-eight", figure_eight)
