"""There and back along a straight line, from rest to rest."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.paths import PAUSE, TRAVEL, Pause, PointToPoint, Travel, excursion, place_of
from mobman.tasks.task import Three, parameter, tasks


@tasks.register("line")
def line(
    robot: MobileManipulator,
    q0: Array,
    *,
    displacement: Annotated[
        Three | None,
        parameter(
            "m",
            "ahead, left and up; 1 m ahead, on a fixed base 0.3 times the tip's distance towards it",
        ),
    ] = None,
    travel: Travel = TRAVEL,
    pause: Pause = PAUSE,
    returns: Annotated[bool, parameter("1", "whether it goes back, and again and again")] = True,
) -> PointToPoint:
    """From the tip at q0 to another point and back, at rest at both.

    Raises:
        UsageError: If there is no way to go.
    """
    place = place_of(robot, q0)
    if displacement is None:
        displacement = (2.0 * place.size if place.drives else -2.0 * place.size, 0.0, 0.0)
    if not np.any(displacement):
        raise UsageError(
            "task 'line': parameter 'displacement' (m) must not be 0 in all directions"
        )
    way = np.array(displacement, dtype=float) @ place.axes
    points, times = excursion([place.tip, place.tip + way], travel, pause, returns=returns)
    return PointToPoint(points, times, returns, "line")
