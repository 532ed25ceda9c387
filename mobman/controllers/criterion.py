"""The criterion of a law: the posture criterion (12) with the robot's weights, or its own."""

from __future__ import annotations

from mobman.controllers.gains import Diagonal, diagonal
from mobman.model.criterion import Posture
from mobman.model.mobile_manipulator import MobileManipulator


def posture_criterion(robot: MobileManipulator, c_F: float, K_F: Diagonal | None) -> Posture:
    """The criterion (12) of a law.

    Args:
        robot: The nominal robot.
        c_F: Its factor.
        K_F: Diagonal of its weights; the robot's own if None. The robot's couplings stay.

    Raises:
        GainError: If K_F has not one weight for each coordinate of q.
    """
    if K_F is None:
        return Posture.of(robot, c_F)
    weights = diagonal("K_F", K_F, robot.nq)
    return Posture(weights, robot.q_rest, c_F, robot.criterion_couplings)
