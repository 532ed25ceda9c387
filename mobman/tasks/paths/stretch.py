"""How far an arm gets one way: where it does, its tip cannot be moved that way at all."""

from __future__ import annotations

import math

import numpy as np

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap

_STARTS = 6  # postures from which it is sought, beside the given one
_SWEEPS = 40
_GAIN = 1e-6  # of a sweep that is worth another one (m)
_NEWTON = 20
_FLAT = 1e-9  # curvature of a direction that does not matter, over the largest
_SMALL = 1e-12


def stretched(
    robot: MobileManipulator, q: Array, direction: Array, *, within_limits: bool = False
) -> Array:
    """The configuration whose tip is farthest along a direction; the platform stays where it is.

    There the row of the arm's Jacobian along the direction is 0, unless a joint is at a limit. Joints
    that slide always have their limits, and stay where they are if they have none: else there would be
    no farthest point. Found from a few postures, always the same: what is not found may be farther.

    Args:
        robot: The robot.
        q: Configuration, shape (nq,).
        direction: In the world, shape (3,), of length 1.
        within_limits: Whether the joints that turn have their limits, too.
    """
    climb = _Climb(robot, q, direction, within_limits=within_limits)
    random = np.random.default_rng(0)
    best = climb.swept(q)
    for _ in range(_STARTS):
        other = climb.swept(climb.at_random(random))
        if climb.height(other) > climb.height(best) + _GAIN:  # of equals the nearest to q
            best = other
    return climb.polished(best)


def least_singular_value(robot: MobileManipulator, q: Array) -> float:
    """Of j_e = J_f C (43), the tip's three rows; 0 where j of (13) loses its rank."""
    j_e = robot.tip_jacobian(q)[:3] @ robot.velocity_map(q)
    if j_e.shape[1] < len(j_e):
        return 0.0
    return float(np.linalg.svd(j_e, compute_uv=False)[-1])


class _Climb:
    """The tip's height along a direction, as a function of the arm's joints."""

    def __init__(
        self, robot: MobileManipulator, q: Array, direction: Array, *, within_limits: bool
    ) -> None:
        self._robot, self._q, self._direction = robot, q, direction
        self._joints = [int(i) for i in robot.arm_index if robot.tip_chain[i] > 0.0]
        kinds = {joint.idx_q: joint.shortname() for joint in robot.model.joints[1:]}
        self._slides = {i for i in self._joints if kinds[i].startswith("JointModelP")}
        self._lower, self._upper = robot.limits.lower.copy(), robot.limits.upper.copy()
        for i in self._joints:
            if i not in self._slides and not within_limits:
                self._lower[i], self._upper[i] = -math.inf, math.inf
            elif i in self._slides and math.isinf(self._upper[i] - self._lower[i]):
                self._lower[i] = self._upper[i] = q[i]

    def height(self, q: Array) -> float:
        """Of the tip (m)."""
        return float(self._direction @ self._robot.tip_pose(q).translation)

    def at_random(self, random: np.random.Generator) -> Array:
        """Some posture."""
        q = self._q.copy()
        for i in self._joints:
            low, high = max(self._lower[i], -math.pi), min(self._upper[i], math.pi)
            q[i] = random.uniform(low, high) if low < high else self._clipped(i, low)
        return q

    def swept(self, q: Array) -> Array:
        """Each joint in turn where it holds the tip highest, from the tip's to the base's and again."""
        q = q.copy()
        last = -math.inf
        for _ in range(_SWEEPS):
            for i in reversed(self._joints):
                q[i] = self._highest(i, q)
            height = self.height(q)
            if height < last + _GAIN:
                break
            last = height
        return q

    def polished(self, q: Array) -> Array:
        """By Newton's method, to rounding."""
        last = self.height(q)
        for _ in range(_NEWTON):
            tip = self._robot.tip_kinematics(q, np.zeros(self._robot.nz))
            free = [
                i
                for i in self._joints
                if i not in self._slides and self._lower[i] < q[i] < self._upper[i]
            ]
            gradient = self._direction @ tip.jacobian[:3, free]
            if not free or float(np.abs(gradient).max()) < _SMALL:
                break
            hessian = TaskMap().hessian(tip, self._direction)[np.ix_(free, free)]
            curvature, axes = np.linalg.eigh(hessian)
            steep = np.abs(curvature) > _FLAT * np.abs(curvature).max()
            along = axes[:, steep]
            new = q.copy()
            new[free] += along @ ((along.T @ gradient) / np.abs(curvature[steep]))
            for i in free:
                new[i] = self._clipped(i, new[i])
            height = self.height(new)
            if height < last - _SMALL:
                break
            q, last = new, height
        return q

    def _highest(self, i: int, q: Array) -> float:
        """Where a joint holds the tip highest, the others as they are."""
        column = self._robot.tip_jacobian(q)[:, i]
        slope = float(self._direction @ column[:3])
        if i in self._slides:
            if abs(slope) < _SMALL:
                return float(q[i])
            return float(self._upper[i] if slope > 0.0 else self._lower[i])
        # on its circle, the height is bend cos(angle) + slope sin(angle) and a constant
        (wx, wy, wz), (vx, vy, vz) = column[3:], column[:3]
        turned = (wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx)
        bend = -float(self._direction @ turned)
        if math.hypot(slope, bend) < _SMALL:
            return float(q[i])
        best = float(q[i]) + math.atan2(slope, bend)
        turns = [best + 2.0 * math.pi * k for k in (0, -1, 1)]
        for angle in turns:
            if self._lower[i] <= angle <= self._upper[i]:
                return angle
        ends = (float(self._lower[i]), float(self._upper[i]))
        heights = [bend * math.cos(end - q[i]) + slope * math.sin(end - q[i]) for end in ends]
        return ends[int(heights[1] > heights[0])]

    def _clipped(self, i: int, value: float) -> float:
        return float(min(max(value, self._lower[i]), self._upper[i]))
