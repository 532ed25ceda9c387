"""An ellipse whose plane is tilted: a closed path in three dimensions."""

from __future__ import annotations

from typing import Annotated

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.parameters import NOT_ZERO, parameter
from mobman.tasks.paths.harmonics import Harmonics
from mobman.tasks.paths.placement import place_of, placed
from mobman.tasks.task import tasks

_SLENDERNESS = 0.6


def ellipse(
    robot: MobileManipulator,
    q0: Array,
    *,
    length: Annotated[
        float | None,
        parameter("m", "from end to end; 1 m, on a fixed base 0.3 times the tip's distance", gt=0),
    ] = None,
    width: Annotated[float | None, parameter("m", "across; 0.6 times the length", gt=0)] = None,
    height: Annotated[
        float | None,
        parameter("m", "of its highest point over its lowest; 0.3 times the tip's distance", ge=0),
    ] = None,
    rate: Annotated[float, parameter("rad/s", "2 pi over the period"), NOT_ZERO] = 0.5,
) -> Harmonics:
    """centre + (a sin(w t), -b cos(w t), -c cos(w t)): its long axis is level, its short one rises."""
    place = place_of(robot, q0)
    a = place.size if length is None else 0.5 * length
    b = _SLENDERNESS * a if width is None else 0.5 * width
    c = place.rise if height is None else 0.5 * height
    return placed("ellipse", place, rate, [(0.0, -b, -c)], [(a, 0.0, 0.0)])


tasks.register("ellipse", ellipse)
