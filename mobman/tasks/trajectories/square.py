"""A square with round corners, smooth to all orders."""

from __future__ import annotations

from typing import Annotated

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.parameters import NOT_ZERO, parameter
from mobman.tasks.paths.harmonics import Harmonics
from mobman.tasks.paths.placement import place_of, placed
from mobman.tasks.task import tasks

# of the third harmonic: with it the curvature in the middle of a side is 0
_THIRD = 1.0 / 9.0


def square(
    robot: MobileManipulator,
    q0: Array,
    *,
    side: Annotated[
        float | None,
        parameter(
            "m", "from side to side; 1 m, on a fixed base 0.3 times the tip's distance", gt=0
        ),
    ] = None,
    rate: Annotated[
        float, parameter("rad/s", "2 pi over the period; positive for anticlockwise"), NOT_ZERO
    ] = 0.5,
) -> Harmonics:
    """A hypotrochoid, r (cos(w t) - cos(3 w t)/9, sin(w t) + sin(3 w t)/9), from the middle of a side.

    It is twice as fast along the sides as around the corners.
    """
    place = place_of(robot, q0)
    r = (place.size if side is None else 0.5 * side) / (1.0 - _THIRD)
    none = (0.0, 0.0, 0.0)
    cosines = [(r, 0.0, 0.0), none, (-_THIRD * r, 0.0, 0.0)]
    sines = [(0.0, r, 0.0), none, (0.0, _THIRD * r, 0.0)]
    return placed("square", place, rate, cosines, sines)


tasks.register("square", square)
