"""The criterion that keeps joints away from their limits, as a term beside the posture criterion."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.criterion import ByComplexStep, Criterion, Term, criteria
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
        """The term for a robot; UsageError if no joint of its arm has limits."""
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
        """Depth of each joint in its zones (rad, m), negative in the lower one, shape (joints,), for q
        that may be complex."""
        own = q[self.joints]
        depth: Array = np.minimum(own - self._lower, 0.0) + np.maximum(own - self._upper, 0.0)
        return depth


class _Avoidance(ByComplexStep):
    """See :class:`JointLimitAvoidance`."""

    def __init__(self, zones: LimitZones, weight: float) -> None:
        self._zones, self._weight = zones, weight

    def value(self, q: Array) -> float:
        """F(q)."""
        zones = self._zones
        return float(self._weight / 12.0 * np.sum(zones.depth(q) ** 4 / zones.width**2))

    def derivatives(self, q: Array, along: Array) -> tuple[Array, Array]:
        """See :class:`ByComplexStep`."""
        zones, depth = self._zones, self._zones.depth(along)
        gradient, diagonal = np.zeros((2, len(q)), dtype=along.dtype)
        gradient[zones.joints] = self._weight / 3.0 * depth**3 / zones.width**2
        diagonal[zones.joints] = self._weight * (depth / zones.width) ** 2
        return gradient, np.diag(diagonal)
