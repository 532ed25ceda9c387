"""From the tip's pose at the start to another one, from rest to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import UNIT, product
from mobman.tasks.paths import (
    TRAVEL,
    KernelPath,
    Quadruple,
    Triple,
    place_of,
    quadruple,
    rest_to_rest,
    triple,
)
from mobman.tasks.task import Three, parameter, tasks

_TURN = 0.5  # rad, by default


@dataclass(frozen=True)
class PoseToPose(KernelPath):
    r"""From one pose to another, and to rest there: straight, and about one axis of the world, by the
    share :math:`35\tau^4 - 84\tau^5 + 70\tau^6 - 20\tau^7` of the way and the angle.

    Args:
        start: Position at t = 0 (m).
        end: Position from t = ``travel`` on (m).
        orientation: At t = 0, unit quaternion (w, x, y, z).
        turn: Axis times angle (rad) from there to the last orientation, in world axes.
        travel: s.
    """

    start: Triple
    end: Triple
    orientation: Quadruple
    turn: Triple
    travel: float
    name: str = "pose"

    width = 7

    def _kernel(self) -> tuple[Any, ...]:
        given = (self.start, self.end, self.orientation, self.turn)
        start, end, first, turn = (np.array(part, dtype=float) for part in given)
        return _pose_to_pose, start, end - start, first, turn, float(self.travel)


@kernel
def _pose_to_pose(
    t: Vector, start: Vector, way: Vector, first: Vector, turn: Vector, travel: float, p_d: Matrix
) -> None:
    share = rest_to_rest(min(max(t[0] / travel, 0.0), 1.0), travel)
    for i in range(3):
        p_d[0, i] = start[i] + share[0] * way[i]
        for order in range(1, 4):
            p_d[order, i] = share[order] * way[i]
            p_d[order, 3 + i] = share[order] * turn[i]
    # exp of the turned part of the rotation vector, times the first orientation
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    w = math.cos(0.5 * share[0] * angle)
    s = math.sin(0.5 * share[0] * angle) / angle if angle > 0.0 else 0.0
    turned = (w, s * turn[0], s * turn[1], s * turn[2])
    orientation = (first[0], first[1], first[2], first[3])
    p_d[0, 3], p_d[0, 4], p_d[0, 5], p_d[0, 6] = product(turned, orientation)
    p_d[1, 6] = p_d[2, 6] = p_d[3, 6] = 0.0


@tasks.register("pose")
def pose(
    robot: MobileManipulator,
    q0: Array,
    *,
    position: Annotated[
        Three | None,
        parameter(
            "m",
            "of the last pose in world axes; 0.5 m ahead of the tip, on a fixed base 0.15 times its "
            "distance towards it",
        ),
    ] = None,
    orientation: Annotated[
        Sequence[float] | None,
        parameter(
            "1",
            "of the last pose, unit quaternion (w, x, y, z); turned by 0.5 rad from the tip's",
            min_length=4,
            max_length=4,
        ),
    ] = None,
    travel: Annotated[float, parameter("s", "time for the way", gt=0)] = TRAVEL,
) -> PoseToPose:
    """From the tip's pose at q0 to another one, the shorter way round, at rest at both.

    Raises:
        UsageError: If the quaternion has not length 1.
    """
    place, first = place_of(robot, q0), robot.tip_pose(q0).rotation
    ahead = place.axes[0]
    if position is None:
        position = place.tip + (place.size if place.drives else -place.size) * ahead
    if orientation is None:
        turn = _TURN * place.axes.sum(axis=0) / math.sqrt(3.0)
    else:
        last = np.array(orientation, dtype=float)
        if not abs(last @ last - 1.0) <= UNIT:
            raise UsageError(
                f"task 'pose': parameter 'orientation' is {last.tolist()}, of length "
                f"{np.linalg.norm(last):.6g}: must be a quaternion (w, x, y, z) of length 1"
            )
        w, x, y, z = (last / np.linalg.norm(last)).tolist()
        turn = pin.log3(pin.Quaternion(w, x, y, z).toRotationMatrix() @ first.T)
    end = triple(np.asarray(position, dtype=float))
    return PoseToPose(triple(place.tip), end, quadruple(first), triple(turn), travel)
