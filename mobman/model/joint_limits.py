"""The criterion that keeps joints away from their limits, as a term beside the posture criterion."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.criterion import Criterion, Term, criteria
from mobman.model.mobile_manipulator import MobileManipulator


class JointLimitAvoidance(Term):
    r"""Avoidance of the arm's joint limits,
    :math:`F = \sum_i \tfrac{w}{12}\,d_i^4/b_i^2`.

    :math:`d_i` is the depth of a joint in the zone of width :math:`b_i` before the nearer limit, 0
    outside of it. F is of class C^3 and 0 in the middle; at a limit its curvature is w (rad^-2, m^-2),
    as of a posture weight; beyond it goes on to rise.
    """

    zone: float = Field(0.15, gt=0, le=0.5)
    """Width of each zone, as a share of the joint's range."""

    def on(self, robot: MobileManipulator) -> Criterion:
        """The term for a robot.

        Raises:
            UsageError: If no joint of its arm has limits.
        """
        lower, upper = robot.limits.lower, robot.limits.upper
        index = [i for i in robot.arm_index if np.isfinite(lower[i]) and np.isfinite(upper[i])]
        if not index:
            raise UsageError(
                f"criterion 'joint-limits': no joint of {robot.name!r}'s arm has limits"
            )
        places = np.array(index)
        return _Zones(places, lower[places], upper[places], self.weight, self.zone)


class _Zones:
    """See :class:`JointLimitAvoidance`."""

    def __init__(
        self, index: Array, lower: Array, upper: Array, weight: float, share: float
    ) -> None:
        self._index, self._weight, self._width = index, weight, share * (upper - lower)
        self._lower, self._upper = lower + self._width, upper - self._width

    def _depth(self, q: Array) -> Array:
        """Depth in the zone, negative in the lower one; shape (joints with limits,)."""
        own = q[self._index]
        depth: Array = np.minimum(own - self._lower, 0.0) + np.maximum(own - self._upper, 0.0)
        return depth

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


criteria.register("joint-limits", JointLimitAvoidance)
