"""Away from a point along straight lines, and back the same way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np

from mobman.arrays import Array
from mobman.tasks.parameters import parameter
from mobman.tasks.paths.point_to_point import PointToPoint, Triple

Travel = Annotated[float, parameter("s", "time for each way", gt=0)]
Pause = Annotated[float, parameter("s", "rest at both ends", ge=0)]
TRAVEL = 5.0
PAUSE = 0.0


def excursion(
    name: str, points: Sequence[Array], travel: float, pause: float, *, returns: bool = True
) -> PointToPoint:
    """A path through points, at rest at each, and back again and again if it returns.

    All parts have the same largest acceleration.

    Args:
        name: The task's.
        points: World coordinates (m), two or more of shape (3,), no two in sequence alike.
        travel: Time for each way (s).
        pause: Rest at each end (s).
        returns: Whether it does.
    """
    # of one acceleration: times as the square roots of the lengths
    shares = [math.sqrt(float(np.linalg.norm(b - a))) for a, b in pairwise(points)]
    there = travel * np.cumsum([0.0, *shares]) / sum(shares)
    stops = list(zip(map(_triple, points), there.tolist(), strict=True))
    if returns:
        end = travel + pause
        # no pause, no stop of its own
        back = [(point, end + travel - time) for point, time in reversed(stops)]
        stops += back if pause > 0.0 else back[1:]
        stops += [(stops[0][0], 2.0 * (travel + pause))] if pause > 0.0 else []
    where, times = zip(*stops, strict=True)
    return PointToPoint(where, times, returns, name)


def _triple(vector: Array) -> Triple:
    x, y, z = (float(coordinate) for coordinate in vector)
    return (x, y, z)
