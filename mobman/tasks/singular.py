"""Paths to where j or the extended Jacobian J of (13) loses its rank, and back."""

from __future__ import annotations

import math
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from mobman.arrays import Array
from mobman.errors import SingularityError, UsageError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.tasks.circle import paper_circle
from mobman.tasks.paths import PAUSE, TRAVEL, Pause, PointToPoint, Travel, excursion, place_of
from mobman.tasks.task import parameter, tasks

_SMALL = 1e-12
_ANGLES = 49  # tried of a joint that others follow
_DIGITS = 6  # of lengths (m) and singular values of the kinematic path, the same on all machines
_COARSE = 4  # the same of the algorithmic path
_DIRECTIONS = 8  # horizontal ones in which an algorithmic singularity is looked for
_REACHES = 6.0  # how far, over the tip's distance from the arm's first joint
_ABOVE = 1e-6  # horizontal share of that distance for a tip that is above the joint


@dataclass(frozen=True)
class SingularPath(PointToPoint):
    """The path, and what is at its end.

    Args:
        depth: How far its end is beyond the singularity (m); negative if it is short of it.
        singular_value: Least singular value of j_e (43) at the singularity. At a kinematic one, what a
            joint that slides, or a limit, leaves of the rank; at an algorithmic one j has its rank.
    """

    depth: float = 0.0
    singular_value: float = 0.0


class AlgorithmicPath(SingularPath):
    """A path to an algorithmic singularity of a criterion that holds the platform: the paper's.

    A platform that nothing holds follows the tip wherever it goes, and the arm is not pressed.
    """

    @staticmethod
    def criterion_weights(robot: MobileManipulator) -> Array:
        """Diagonal of K_F, shape (nq,): those of the task ``paper``."""
        return paper_circle(robot, robot.q_rest).criterion_weights(robot)


@tasks.register("kinematic-singularity")
def kinematic_singularity(
    robot: MobileManipulator,
    q0: Array,
    *,
    depth: Annotated[
        float, parameter("m", "how far beyond what the tip reaches; negative: short of it")
    ] = 0.0,
    direction: Annotated[
        Literal["up", "down", "out"] | None,
        parameter("1", "up or down; on a fixed base also out, away from it, the default there"),
    ] = None,
    within_limits: Annotated[
        bool, parameter("1", "whether the limits of the joints that turn count")
    ] = False,
    travel: Travel = TRAVEL,
    pause: Pause = PAUSE,
) -> SingularPath:
    """From the tip to its highest (lowest, farthest) point that the arm reaches, and back.

    There the tip cannot be moved that way at all, so that j loses its rank, whatever the platform does:
    it drives in the plane. An arm whose tip slides that way has no such point but the slide's limit,
    which simulation does not enforce: its rank stays, see ``singular_value``.

    Raises:
        UsageError: If a platform that drives is asked to go out; if depth takes the end of the path
            back to the tip.
    """
    name, place = "kinematic-singularity", place_of(robot, q0)
    direction = direction or ("up" if place.drives else "out")
    if direction == "out" and place.drives:
        raise UsageError(
            f"task {name!r}: robot {robot.name!r} drives, so that no point is too far "
            "out for it; allowed for 'direction': up, down"
        )
    *_, up = place.axes
    way = {"out": place.arm / np.linalg.norm(place.arm), "up": up, "down": -up}[direction]
    farthest = stretched(robot, q0, way, within_limits=within_limits)
    displacement = np.array(robot.tip_pose(farthest).translation) - place.tip
    reach = float(way @ displacement)
    if depth <= -reach:
        raise UsageError(
            f"task {name!r}: depth = {depth:g} m leaves nothing of the {reach:.3g} m "
            "that the tip has to go"
        )
    # what does not matter is rounded, to be the same on all machines
    lateral = np.round(displacement - reach * way, _DIGITS)
    end = place.tip + lateral + (round(reach, 2 * _DIGITS) + depth) * way
    j_e = robot.tip_jacobian(farthest)[:3] @ robot.velocity_map(farthest)
    value = round(least_singular_value(j_e), _DIGITS)
    return SingularPath(*excursion([place.tip, end], travel, pause), True, name, depth, value)


@tasks.register("algorithmic-singularity")
def algorithmic_singularity(
    robot: MobileManipulator,
    q0: Array,
    *,
    depth: Annotated[
        float, parameter("m", "how far beyond the singularity; negative: short of it")
    ] = 0.05,
    farthest: Annotated[
        float | None, parameter("m", "how far to look for one; 6 times the tip's distance", gt=0)
    ] = None,
    travel: Travel = TRAVEL,
    pause: Pause = PAUSE,
) -> AlgorithmicPath:
    """From the tip along a line, or around one corner, through the nearest such place, and back.

    A criterion is a spring, with the weights of :class:`AlgorithmicPath`: it holds the platform and the
    arm where they rest, and the task pushes the tip away. Where the arm is pushed towards its base, it
    buckles as a column does: the criterion's minimum under the task's constraints ceases to be one,
    N (H + D) N^T and with it J lose their rank. The solution of the extended task is followed along
    lines in ten directions, and along those that turn off from the line towards the base, until one
    comes to such a place.

    Raises:
        UsageError: If there is none, or depth takes the end of the path back to the last corner.
    """
    name, place = "algorithmic-singularity", place_of(robot, q0)
    who = f"task {name!r}: robot {robot.name!r}"
    if robot.nz <= TaskMap().m:
        raise UsageError(f"{who} has no redundant degree of freedom, so that J is j_e")
    ahead, _, up = place.axes
    level = np.array([*place.arm[:2], 0.0])
    length, scale = float(np.linalg.norm(level)), place.reach
    inward = -level / length if length > _ABOVE * scale else -ahead
    lateral = np.array([-inward[1], inward[0], 0.0])
    angles = 2.0 * math.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    directions = [math.cos(angle) * inward + math.sin(angle) * lateral for angle in angles]
    reach = _REACHES * scale if farthest is None else farthest
    held = robot.copy()
    held.criterion_weights[:] = AlgorithmicPath.criterion_weights(robot)
    ways, turns = [*directions, up, -up], [lateral, -lateral, up, -up]
    try:
        found = nearest_degeneracy(held, q0, ways, turns, reach, scale)
    except (SingularityError, np.linalg.LinAlgError) as error:
        raise UsageError(f"{who} cannot start there: {error}") from error
    if found is None:
        raise UsageError(
            f"{who} comes to no algorithmic singularity of its posture criterion within {reach:.3g} m "
            "on the lines that are looked at; another criterion in its description, or a larger "
            "'farthest', may have one"
        )
    *corners, last, end = found.corners
    way = end - last
    length = float(np.linalg.norm(way))
    if depth <= -length:
        raise UsageError(
            f"{who}: depth = {depth:g} m leaves nothing of the last {length:.3g} m of the way"
        )
    end = last + (round(length, _COARSE) + depth) * way / length
    there = excursion([*corners, last, end], travel, pause)
    return AlgorithmicPath(*there, True, name, depth, round(found.singular_value, _COARSE))


def least_singular_value(jacobian: Array) -> float:
    """Least singular value, of as many as there are rows; of j_e (43), 0 where j of (13) is singular."""
    if jacobian.shape[1] < len(jacobian):
        return 0.0
    return float(np.linalg.svd(jacobian, compute_uv=False)[-1])


def determinant_sign(extended: ExtendedJacobian, m: int) -> float:
    """The sign of det J over that of a matrix of full rank with the same axes of f_a: that of
    det N (H + D) N^T. The task has m coordinates."""
    regular = np.vstack([extended.J[:m], extended.complement @ extended.buffers.C])
    both, _ = np.linalg.slogdet(np.stack([extended.J, regular]))
    return float(both[0] * both[1])


# The farthest point of an arm along a direction --------------------------------------------------------

_STARTS = 6  # postures from which it is sought, in addition to the given one
_SWEEPS = 40
_GAIN = 1e-6  # of a sweep that is worth another one (m)
_NEWTON = 20
_FLAT = 1e-9  # curvature of a direction that does not matter, over the largest


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
    climb = _Climb(robot, q, direction, within_limits)
    random = np.random.default_rng(0)
    best = climb.swept(q)
    for _ in range(_STARTS):
        other = climb.swept(climb.at_random(random))
        if climb.height(other) > climb.height(best) + _GAIN:  # of equals the nearest to q
            best = other
    return climb.polished(best)


class _Climb:
    """The tip's height along a direction, as a function of the arm's joints."""

    def __init__(
        self, robot: MobileManipulator, q: Array, direction: Array, within_limits: bool
    ) -> None:
        self._robot, self._q, self._direction = robot, q, direction
        self._joints = [int(i) for i in robot.arm_index if robot.tip_chain[i] > 0.0]
        self._slides = {i for i in self._joints if robot.slides[i]}
        # a joint's column of C moves those that follow it, too
        self._moves = robot.velocity_map(q)[:, robot.n_alpha :].T
        self._column = {int(i): self._moves[c] for c, i in enumerate(robot.arm_index)}
        self._lower, self._upper = robot.limits.lower.copy(), robot.limits.upper.copy()
        for i in self._joints:
            if i not in self._slides and not within_limits:
                self._lower[i], self._upper[i] = -math.inf, math.inf
            elif i in self._slides and math.isinf(self._upper[i] - self._lower[i]):
                self._lower[i] = self._upper[i] = q[i]

    def height(self, q: Array) -> float:
        """Height of the tip (m)."""
        return float(self._direction @ self._robot.tip_pose(q).translation)

    def at_random(self, random: np.random.Generator) -> Array:
        q = self._q.copy()
        for i in self._joints:
            low, high = max(self._lower[i], -math.pi), min(self._upper[i], math.pi)
            q[i] = random.uniform(low, high) if low < high else min(low, self._upper[i])
        return self._robot.consistent(q)

    def swept(self, q: Array) -> Array:
        """Put each joint in turn where it holds the tip highest, from tip to base, repeatedly."""
        q, last = q.copy(), -math.inf
        for _ in range(_SWEEPS):
            for i in reversed(self._joints):
                q += (self._highest(i, q) - q[i]) * self._column[i]
            height = self.height(q)
            if height < last + _GAIN:
                break
            last = height
        return q

    def polished(self, q: Array) -> Array:
        """Maximise by Newton's method, to rounding."""
        last = self.height(q)
        for _ in range(_NEWTON):
            tip = self._robot.tip_kinematics(q, np.zeros(self._robot.nz))
            inside = (self._lower < q) & (q < self._upper)
            free = [i for i in self._joints if i not in self._slides and inside[i]]
            moves = np.array([self._column[i] for i in free]).reshape(-1, len(q))
            gradient = moves @ (self._direction @ tip.jacobian[:3])
            if not free or float(np.abs(gradient).max()) < _SMALL:
                break
            hessian = moves @ TaskMap().hessian(tip, self._direction) @ moves.T
            curvature, axes = np.linalg.eigh(hessian)
            steep = np.abs(curvature) > _FLAT * np.abs(curvature).max()
            along = axes[:, steep]
            new = q.copy()
            new[free] += along @ ((along.T @ gradient) / np.abs(curvature[steep]))
            new[free] = np.clip(new, self._lower, self._upper)[free]
            new = self._robot.consistent(new)
            height = self.height(new)
            if height < last - _SMALL:
                break
            q, last = new, height
        return q

    def _highest(self, i: int, q: Array) -> float:
        """Angle or slide of a joint that holds the tip highest, the others as they are."""
        column, lower, upper = self._column[i], self._lower[i], self._upper[i]
        turning = [j for j in np.flatnonzero(column) if j not in self._slides and j != i]
        if any(self._robot.tip_chain[j] for j in turning):
            return self._best_of_many(i, q)
        column = self._robot.tip_jacobian(q) @ column
        slope = float(self._direction @ column[:3])
        if i in self._slides:
            return float(q[i] if abs(slope) < _SMALL else upper if slope > 0.0 else lower)
        # on its circle, the height is bend cos(angle) + slope sin(angle) and a constant
        bend = -float(self._direction @ np.cross(column[3:], column[:3]))
        if math.hypot(slope, bend) < _SMALL:
            return float(q[i])
        best = float(q[i]) + math.atan2(slope, bend)
        for angle in (best, best - 2.0 * math.pi, best + 2.0 * math.pi):
            if lower <= angle <= upper:
                return angle
        ends = np.array([lower, upper])
        heights = bend * np.cos(ends - q[i]) + slope * np.sin(ends - q[i])
        return float(ends[heights.argmax()])

    def _best_of_many(self, i: int, q: Array) -> float:
        """The same for a joint that others follow by turning: the height is no plain sine then."""

        def height(angle: float) -> float:
            return self.height(q + (angle - q[i]) * self._column[i])

        low, high = max(self._lower[i], q[i] - math.pi), min(self._upper[i], q[i] + math.pi)
        angles = np.linspace(low, high, _ANGLES)
        near = float(max(angles, key=height))
        step = (high - low) / (_ANGLES - 1)
        bounds = (max(low, near - step), min(high, near + step))
        from scipy.optimize import minimize_scalar  # a tenth of a second, and few tasks need it

        return float(minimize_scalar(lambda angle: -height(angle), bounds=bounds).x)


# The solution of the extended task along lines ---------------------------------------------------------

# all lengths in multiples of the tip's distance from the arm's first joint
_LARGEST_STEP = 0.05
_SMALLEST_STEP = 2e-5
_LARGEST_TURN = 0.2  # of the arm's joints in a step, and of the heading (rad, m)
_CLOSED = 1e-6  # the task's and the auxiliary errors, over what they would be after a largest step
_CORRECTIONS = 4
_BETWEEN_TURNS = 0.25
_SETTLING = 50  # steps to get to f_a = 0
_KINEMATIC = 0.1  # singular values of j_e below this share of those at the start are its own loss


def nearest_degeneracy(
    robot: MobileManipulator,
    q0: Array,
    directions: Iterable[Array],
    turns: Iterable[Array],
    farthest: float,
    scale: float,
) -> SolutionLine | None:
    """The line to the nearest place where J loses its rank, but j does not, among lines from the tip.

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

    Raises:
        SingularityError: If J has no full rank at q0.
    """
    extended = ExtendedJacobian(robot, TaskMap(), Posture.of(robot))
    axes = extended.complement.copy()
    lines = []
    for direction in directions:
        extended.complement[:] = axes
        lines.append(SolutionLine(extended, robot, q0.copy(), direction, scale))
    first, next_turn = lines[0], _BETWEEN_TURNS * scale
    while lines:
        line = min(lines, key=lambda one: one.length)
        if line.is_algorithmic:
            return line
        done = line.length >= farthest or (line.has_turned and line.distance >= scale)
        if line.ended or done:
            lines.remove(line)
            continue
        line.advance()
        if line is first and not line.ended and line.length >= next_turn:
            next_turn += _BETWEEN_TURNS * scale
            lines += [line.turned(direction) for direction in turns]
    return None


class SolutionLine:
    """Solution of the extended task, f_e on a line and f_a = 0, from a configuration on.

    All lines use the same ``extended``, J of the robot; ``scale`` is the unit of lengths (m).

    Attributes:
        q: The configuration at the line's end so far, shape (nq,).
        singular_value: Least singular value of j_e there.
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
        extended.at(q, self._rest)
        self._length, self._turns = 0.0, [extended.f[:3].copy()]
        for _ in range(_SETTLING):  # to f_a = 0 with the tip where it is, as far as small steps go
            change = self._correction(self.q, self._turns[0])
            largest = float(np.abs(change[self._turning]).max())
            self.q = self.q + min(1.0, _LARGEST_TURN / max(largest, _SMALL)) * change
            if largest < _CLOSED:
                break
        self._keep()
        self._sign, self._first = determinant_sign(self._extended, 3), self.singular_value

    def turned(self, direction: Array) -> SolutionLine:
        """Another one, that leaves this one here."""
        other = copy(self)
        other._length, other._turns = self.length, self.corners
        other.direction, other.distance = direction, 0.0
        other._step = _LARGEST_STEP * self._scale
        return other

    @property
    def has_turned(self) -> bool:
        """True if it has left another one."""
        return len(self._turns) > 1

    @property
    def length(self) -> float:
        """Length of the whole way (m)."""
        return self._length + self.distance

    @property
    def corners(self) -> list[Array]:
        """The tip's way from its start: points in the world (m), shape (3,) each, both ends included."""
        return [*self._turns, self._turns[-1] + self.distance * self.direction]

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
        q, target = self.q, self._turns[-1] + distance * self.direction
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
        if determinant_sign(self._extended, 3) != self._sign:
            return False
        self.q = q
        return True

    def _correction(self, q: Array, target: Array) -> Array:
        """J^-1 of what is missing, as a change of q."""
        extended = self._extended
        extended.at(q, self._rest)
        missing = np.concatenate([target - extended.f[:3], -extended.f[3:]])
        change: Array = extended.buffers.C @ np.linalg.solve(extended.J, missing)
        return change

    def _keep(self) -> None:
        """Keep what follows from J, which is that of a last, tiny correction of q ago."""
        J = self._extended.J
        self._complement = self._extended.complement.copy()
        self.singular_value = least_singular_value(J[:3])
