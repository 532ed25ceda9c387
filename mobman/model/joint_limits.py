"""The criterion that keeps joints away from their limits, as a term beside the posture criterion."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.criterion import Criterion, Term, criteria
from mobman.model.mobile_manipulator import MobileManipulator


@criteria.register("joint-limits")
class JointLimitAvoidance(Term):
    r"""Avoidance of the arm's joint limits,
    :math:`F = \sum_i \tfrac{w}{12}\,d_i^4/b_i^2`.

    :math:`d_i` is the depth of a joint in the zone of width :math:`b_i` before the nearer limit, 0
    outside of it. F is of class C^3 and 0 in the middle; at a limit its curvature is w (rad^-2, m^-2),
    as of a posture weight; beyond it goes on to rise.
    """

    zone: float = Field(0.15, gt=0, le=0.5)  # width of each zone, as a share of the joint's range

    def on(self, robot: MobileManipulator) -> Criterion:
        """The term for a robot.

        Raises:
            UsageError: If no joint of its arm has limits.
        """
        zones = LimitZones(robot, self.zone)
        if not zones.bounded:
            raise UsageError(
                f"criterion 'joint-limits': no joint of {robot.name!r}'s arm has limits"
            )
        return _Avoidance(zones, self.weight)


class LimitZones:
    """The zones before the limits of an arm's joints.

    Args:
        robot: Has the limits.
        share: Width of each zone over the joint's range; over 1 (rad, m) where it has one end only.

    Attributes:
        joints: Places of the arm's joints in q.
        width: Width of their zones (rad, m).
        bounded: True if one of them has a limit.
    """

    def __init__(self, robot: MobileManipulator, share: float) -> None:
        self.joints = robot.arm_index
        lower, upper = robot.limits.lower[self.joints], robot.limits.upper[self.joints]
        ways = upper - lower
        self.width = share * np.where(np.isfinite(ways), ways, 1.0)
        self.bounded = bool(np.any(np.isfinite(lower) | np.isfinite(upper)))
        self._lower, self._upper = lower + self.width, upper - self.width

    def depth(self, q: Array) -> Array:
        """Depth of each joint in its zones (rad, m), negative in the lower one, shape (joints,)."""
        own = q[self.joints]
        depth: Array = np.minimum(own - self._lower, 0.0) + np.maximum(own - self._upper, 0.0)
        return depth


class _Avoidance:
    """See :class:`JointLimitAvoidance`."""

    def __init__(self, zones: LimitZones, weight: float) -> None:
        self._depth, self._weight = zones.depth, weight
        self._index, self._width = zones.joints, zones.width

    def value(self, q: Array) -> float:
        """F(q)."""
        return float(self._weight / 12.0 * np.sum(self._depth(q) ** 4 / self._width**2))

    def gradient(self, q: Array) -> Array:
        """dF/dq, shape (nq,)."""
        gradient = np.zeros(len(q))
        gradient[self._index] = self._weight / 3.0 * self._depth(q) ** 3 / self._width**2
        return gradient

    def hessian(self, q: Array) -> Array:
        """d2F/dq2, shape (nq, nq)."""
        diagonal = np.zeros(len(q))
        diagonal[self._index] = self._weight * (self._depth(q) / self._width) ** 2
        return np.diag(diagonal)

    def hessian_rate(self, q: Array, q_dot: Array) -> Array:
        """dH/dt along q', shape (nq, nq)."""
        diagonal = np.zeros(len(q))
        rate = q_dot[self._index] * self._depth(q) / self._width**2
        diagonal[self._index] = 2.0 * self._weight * rate
        return np.diag(diagonal)
