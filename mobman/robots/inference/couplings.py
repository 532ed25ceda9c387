"""What the steering of a car is to follow, as nothing else moves it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.robots.inference.chain import Chain
from mobman.robots.inference.criterion import DEFAULT
from mobman.robots.inference.tree import Joint

_UPRIGHT = math.cos(0.1)  # an axis that is less tilted than 0.1 rad is vertical
_LEVER = 0.05  # m; a tip that is nearer to an axis is not moved by it


@dataclass(frozen=True)
class Following:
    """A steering joint that is to follow a joint of the arm.

    Attributes:
        joint: Steers.
        to: Turns the arm about the vertical.
        ratio: +1 where both turn to the left with positive angles, or both to the right; else -1.
        weight: 1/rad^2.
    """

    joint: str
    to: str
    ratio: float
    weight: float


def steering_couplings(
    steering: Sequence[Joint], chain: Chain, rest: Sequence[float]
) -> list[Following]:
    """Couplings for all steering joints; none if no joint of the arm turns it about the vertical.

    Args:
        steering: Joints that steer.
        chain: The arm.
        rest: Its rest posture (m, rad), in the chain's order.
    """
    centres, axes, tip = (values[0] for values in chain.places(np.array([rest])))
    for joint, centre, axis in zip(chain.joints, centres, axes, strict=True):
        if joint.prismatic or abs(axis[2]) < _UPRIGHT:
            continue
        if np.linalg.norm(tip[:2] - centre[:2]) < _LEVER:
            continue
        return [
            Following(
                wheel.name, joint.name, float(np.sign(wheel.axis[2]) * np.sign(axis[2])), DEFAULT
            )
            for wheel in steering
        ]
    return []
