"""Solution of the extended task along lines, up to where J of (13) loses its rank but j does not."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.errors import SingularityError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap

# all lengths in multiples of the tip's distance from the arm's first joint
_LARGEST_STEP = 0.05
_SMALLEST_STEP = 2e-5
_LARGEST_TURN = 0.2  # of the arm's joints in a step, and of the heading (rad, m)
_CLOSED = 1e-6  # the task's and the auxiliary errors, over what they would be after a largest step
_CORRECTIONS = 4
_BETWEEN_TURNS = 0.25
_SETTLING = 50  # steps to get to f_a = 0
_SMALL = 1e-12
_KINEMATIC = 0.1  # singular values of j_e below this share of those at the start are its own loss


@dataclass(frozen=True)
class Degeneracy:
    """A place where the solution of the extended task ends or is not unique.

    Attributes:
        corners: The tip's way there from its start: points in the world (m), shape (3,) each, the start
            and the place itself among them.
        q: The configuration there, shape (nq,).
        singular_value: Least singular value of j_e there.
    """

    corners: list[Array]
    q: Array
    singular_value: float


def nearest_degeneracy(
    robot: MobileManipulator,
    q0: Array,
    directions: Iterable[Array],
    turns: Iterable[Array],
    farthest: float,
    scale: float,
) -> Degeneracy | None:
    """The nearest place where J loses its rank, but j does not, on lines from the tip.

    The solutions of f_e = p, f_a = 0 are followed along all the lines at once, and along those that
    turn off from the first of them. One ends where it folds back, or where it would go on with the
    determinant of N (H + D) N^T, the curvature of the criterion along the constraints, of the other
    sign: as a saddle of the criterion instead of its minimum.

    Args:
        robot: The robot; its posture criterion is meant.
        q0: Where the lines begin, shape (nq,).
        directions: Vectors of length 1 in the world, shape (3,).
        turns: The same, of the lines that turn off.
        farthest: How far to look (m).
        scale: The tip's distance from the arm's first joint (m).

    Returns:
        None if there is none.

    Raises:
        SingularityError: If J has no full rank at q0.
    """
    extended = ExtendedJacobian(robot, TaskMap(), Posture.of(robot))
    axes = extended.complement.copy()
    lines = []
    for direction in directions:
        extended.complement[:] = axes
        lines.append(_Solution(extended, robot, q0.copy(), direction, scale))
    turned_from = len(lines)  # lines from this number on are those that turn off
    fronts = [(0.0, i) for i in range(len(lines))]
    next_turn = _BETWEEN_TURNS * scale
    while fronts:
        length, i = heapq.heappop(fronts)
        line = lines[i]
        if line.is_algorithmic:
            return Degeneracy(line.corners, line.q, line.singular_value)
        if line.ended or length >= farthest or (i >= turned_from and line.distance >= scale):
            continue
        line.advance()
        heapq.heappush(fronts, (line.length, i))
        if i == 0 and not line.ended and line.length >= next_turn:
            next_turn += _BETWEEN_TURNS * scale
            for direction in turns:
                lines.append(line.turned(direction))
                heapq.heappush(fronts, (line.length, len(lines) - 1))
    return None


class _Solution:
    """f_e on a line, f_a = 0, from a configuration on.

    Args:
        extended: J of the robot; all lines use the same.
        robot: The robot.
        q: The configuration.
        direction: Direction of the line.
        scale: The unit of lengths (m).
    """

    def __init__(
        self,
        extended: ExtendedJacobian,
        robot: MobileManipulator,
        q: Array,
        direction: Array,
        scale: float,
    ) -> None:
        self._extended, self._rest = extended, np.zeros(robot.nz)
        self._turning = [
            i for i in range(robot.nq) if i in robot.arm_index or robot.tip_chain[i] > 0.0
        ]
        self.direction, self._scale = direction, scale
        self._step = _LARGEST_STEP * scale
        self.distance, self.q, self.ended = 0.0, q, False
        self._length, self._corners = 0.0, list[Array]()
        extended.at(q, self._rest)
        self._start = extended.f[:3].copy()
        for _ in range(_SETTLING):  # to f_a = 0 with the tip where it is, as far as small steps go
            change = self._correction(self.q, self._start)
            largest = float(np.abs(change[self._turning]).max())
            self.q = self.q + min(1.0, _LARGEST_TURN / max(largest, _SMALL)) * change
            if largest < _CLOSED:
                break
        self._keep()
        self._sign, self._first = self._orientation(), self.singular_value

    def turned(self, direction: Array) -> _Solution:
        """Another one, that leaves this one here."""
        other = copy(self)
        other.direction, other.distance = direction, 0.0
        other._step = _LARGEST_STEP * self._scale
        other._corners, other._start = self.corners[:-1], self.corners[-1]
        other._length = self.length
        return other

    @property
    def length(self) -> float:
        """Length of the whole way (m)."""
        return self._length + self.distance

    @property
    def corners(self) -> list[Array]:
        """The tip's way from the start."""
        return [*self._corners, self._start, self._start + self.distance * self.direction]

    @property
    def is_algorithmic(self) -> bool:
        """True if it has ended with j_e in good order."""
        return self.ended and self.singular_value > _KINEMATIC * self._first

    def advance(self) -> None:
        """A step; where even the smallest leads nowhere, or past a change of sign, it has ended."""
        while self._step >= _SMALLEST_STEP * self._scale:
            self._extended.complement[:] = self._complement
            if self._try(self.distance + self._step):
                self.distance += self._step
                self._keep()
                self._step = min(2.0 * self._step, _LARGEST_STEP * self._scale)
                return
            self._step *= 0.5
        self.ended = True

    def _try(self, distance: float) -> bool:
        """Go to a distance, by Newton's method from here."""
        q, target = self.q, self._start + distance * self.direction
        try:
            for _ in range(_CORRECTIONS):
                change = self._correction(q, target)
                turn = float(np.abs(change[self._turning]).max())
                if not turn <= _LARGEST_TURN:
                    return False
                q = q + change
                if turn < _CLOSED:
                    break
            else:
                return False
        except (SingularityError, np.linalg.LinAlgError):
            return False
        if self._orientation() != self._sign:
            return False
        self.q = q
        return True

    def _correction(self, q: Array, target: Array) -> Array:
        """J^-1 of what is missing, as a change of q."""
        extended = self._extended
        extended.at(q, self._rest)
        missing = np.concatenate([target - extended.f[:3], -extended.f[3:]])
        change: Array = extended.workspace.C @ np.linalg.solve(extended.J, missing)
        return change

    def _orientation(self) -> float:
        """The sign of det J, made independent of the axes of f_a: that of det N (H + D) N^T."""
        J, now = self._extended.J, self._extended
        regular = np.vstack([J[:3], now.complement @ now.workspace.C])
        both, _ = np.linalg.slogdet(np.stack([J, regular]))
        return float(both[0] * both[1])

    def _keep(self) -> None:
        """Keep what follows from J, which is that of a last, tiny correction of q ago."""
        J = self._extended.J
        self._complement = self._extended.complement.copy()
        self.singular_value = float(np.linalg.svd(J[:3], compute_uv=False)[-1])
