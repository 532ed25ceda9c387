"""Closed paths as sums of sines and cosines: figure of eight, ellipse, square and Lissajous curve."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.paths import Harmonics, place_of, placed
from mobman.tasks.task import NOT_ZERO, Three, parameter, tasks

_NONE = (0.0, 0.0, 0.0)
_SLENDERNESS = 0.6  # of the ellipse: its width over its length
_THIRD = 1.0 / 9.0  # of the square's third harmonic: the curvature in the middle of a side is 0
_MOST = 10  # frequency of a Lissajous curve
_SHARE = 0.6  # its amplitude over that of slower paths: the harmonics make it faster

Length = Annotated[
    float | None,
    parameter("m", "from end to end; 1 m, on a fixed base 0.3 times the tip's distance", gt=0),
]
Rate = Annotated[float, parameter("rad/s", "2 pi over the period"), NOT_ZERO]
Frequency = Annotated[int, parameter("1", "a whole number", ge=1, le=_MOST)]
Amplitude = Annotated[float, parameter("m", "half an extent", ge=0)]


@tasks.register("figure-eight")
def figure_eight(
    robot: MobileManipulator,
    q0: Array,
    *,
    length: Length = None,
    width: Annotated[float | None, parameter("m", "of a loop; half the length", gt=0)] = None,
    rate: Rate = 0.5,
) -> Harmonics:
    """A horizontal lemniscate of Gerono, (a cos(w t), b sin(2 w t)), from one of its ends."""
    place = place_of(robot, q0)
    a = place.size if length is None else 0.5 * length
    b = 0.5 * a if width is None else 0.5 * width
    return placed("figure-eight", place, rate, [(a, 0.0, 0.0), _NONE], [_NONE, (0.0, b, 0.0)])


@tasks.register("ellipse")
def ellipse(
    robot: MobileManipulator,
    q0: Array,
    *,
    length: Length = None,
    width: Annotated[float | None, parameter("m", "across; 0.6 times the length", gt=0)] = None,
    height: Annotated[
        float | None,
        parameter("m", "of its highest point over its lowest; 0.3 times the tip's distance", ge=0),
    ] = None,
    rate: Rate = 0.5,
) -> Harmonics:
    """centre + (a sin(w t), -b cos(w t), -c cos(w t)): its long axis is level, its short one rises."""
    place = place_of(robot, q0)
    a = place.size if length is None else 0.5 * length
    b = _SLENDERNESS * a if width is None else 0.5 * width
    c = place.rise if height is None else 0.5 * height
    return placed("ellipse", place, rate, [(0.0, -b, -c)], [(a, 0.0, 0.0)])


@tasks.register("square")
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

    A square with round corners, run twice as fast along the sides as around the corners.
    """
    place = place_of(robot, q0)
    r = (place.size if side is None else 0.5 * side) / (1.0 - _THIRD)
    cosines = [(r, 0.0, 0.0), _NONE, (-_THIRD * r, 0.0, 0.0)]
    sines = [(0.0, r, 0.0), _NONE, (0.0, _THIRD * r, 0.0)]
    return placed("square", place, rate, cosines, sines)


@tasks.register("lissajous")
def lissajous(
    robot: MobileManipulator,
    q0: Array,
    *,
    frequencies: Annotated[
        Sequence[Frequency],
        parameter("1", "of the three axes, in multiples of the rate", min_length=3, max_length=3),
    ] = (2, 3, 1),
    amplitudes: Annotated[
        Sequence[Amplitude] | None,
        parameter(
            "m",
            "along the three axes; 0.3, 0.3 and 0.15 times the tip's distance, on a fixed base 0.09, "
            "0.09 and 0.15 times that",
            min_length=3,
            max_length=3,
        ),
    ] = None,
    phases: Annotated[Three, parameter("rad", "of the three axes")] = (0.0, 0.5 * math.pi, 0.0),
    rate: Annotated[
        float,
        parameter("rad/s", "2 pi over the period, where the frequencies are coprime"),
        NOT_ZERO,
    ] = 0.5,
) -> Harmonics:
    """A knot in three dimensions: amplitude sin(frequency w t + phase) ahead, left and up."""
    place = place_of(robot, q0)
    if amplitudes is None:
        amplitudes = (_SHARE * place.size, _SHARE * place.size, place.rise)
    cosines, sines = np.zeros((2, max(frequencies), 3))
    for axis, (n, size, phase) in enumerate(zip(frequencies, amplitudes, phases, strict=True)):
        cosines[n - 1, axis] = size * math.sin(phase)
        sines[n - 1, axis] = size * math.cos(phase)
    return placed("lissajous", place, rate, cosines.tolist(), sines.tolist())
