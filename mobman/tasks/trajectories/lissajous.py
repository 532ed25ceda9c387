"""A Lissajous curve: a knot in three dimensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.parameters import NOT_ZERO, parameter
from mobman.tasks.paths.harmonics import Harmonics
from mobman.tasks.paths.placement import place_of, placed
from mobman.tasks.task import tasks

_MOST = 10
_SHARE = 0.6  # of the length that suits the robot, since the curve is the faster for its harmonics

Frequency = Annotated[int, parameter("1", "a whole number", ge=1, le=_MOST)]
Amplitude = Annotated[float, parameter("m", "half an extent", ge=0)]


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
    phases: Annotated[
        Sequence[float],
        parameter("rad", "of the three axes", min_length=3, max_length=3),
    ] = (0.0, 0.5 * math.pi, 0.0),
    rate: Annotated[
        float,
        parameter("rad/s", "2 pi over the period, where the frequencies are coprime"),
        NOT_ZERO,
    ] = 0.5,
) -> Harmonics:
    """amplitude sin(frequency w t + phase) along each axis: ahead, left and up."""
    place = place_of(robot, q0)
    if amplitudes is None:
        amplitudes = (_SHARE * place.size, _SHARE * place.size, place.rise)
    cosines, sines = np.zeros((2, max(frequencies), 3))
    for axis, (n, size, phase) in enumerate(zip(frequencies, amplitudes, phases, strict=True)):
        cosines[n - 1, axis] = size * math.sin(phase)
        sines[n - 1, axis] = size * math.cos(phase)
    return placed("lissajous", place, rate, cosines.tolist(), sines.tolist())


tasks.register("lissajous", lissajous)
