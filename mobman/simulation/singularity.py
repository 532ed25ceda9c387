"""Singularities of a run: the verdict on one that ended early, and the prediction before it.

A run that ends early either met a singularity of the matrix that its law inverts, or its loop was
unstable. At the end both look the same, since a state that runs away passes through singular postures,
too. The verdict looks at the run before: up to where the tip had left its task, or the posture changed
by more in a tick than sampling resolves.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.bounds import jacobian_bound
from mobman.controllers.gains import CriterionGains
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import MobmanError, SingularityError
from mobman.model.criterion import Criterion
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.metrics import Run
from mobman.tasks.paths import place_of
from mobman.tasks.singular import determinant_sign
from mobman.tasks.task import Task, task_map_of

_RESOLVED = 0.05  # rad or m a tick: a posture that changes faster has run away
_FARTHER = 2.0  # times the error at the start
_ON_TASK = 0.05  # of the tip's distance from the arm's first joint: an error that is no failure
_AFTERMATH = 1.0  # s: how long after a singularity its consequences may show


@dataclass(frozen=True)
class Singularity:
    """A matrix below the bound of its least singular value, and where."""

    matrix: str
    """``"J"`` of (13), ``"J_e"`` of (43), ``"j"`` of (11), ``"M"``, ``"B"``; empty: not known."""
    time: float
    """s."""
    sigma_min: float
    """Least singular value; 0 where the sign of the determinant changed. NaN: not known."""
    bound: float
    """Least value that is regular; NaN where the matrix could not be factorised at all."""
    joint: str = ""
    """The joint of the arm that is nearest to its limits; empty if none has any."""
    margin: float = math.nan
    """Distance inside them (rad, m); negative: beyond."""

    def __str__(self) -> str:
        known = self.matrix and not math.isnan(self.sigma_min)
        found = f"sigma_min({self.matrix}) = {self.sigma_min:.2g}" if known else ""
        if self.sigma_min < self.bound:
            found += f", below its bound {self.bound:.2g} from t = {self.time:.6g} s on"
        if self.joint:
            side = "inside" if self.margin >= 0.0 else "beyond"
            limit = f"{self.joint} is {abs(self.margin):.2g} {side} its limits"
            found = f"{found}; {limit}" if found else limit
        return found

    def as_recorded(self) -> dict[str, Any]:
        """The fields that are known."""
        known = {name: value for name, value in vars(self).items() if value != ""}
        return {name: value for name, value in known.items() if value == value}  # not NaN


def sigma_min(matrix: Array) -> float:
    """Least singular value of a matrix."""
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])


class Jacobians:
    """J and J_e of a robot and its task at configurations that follow each other."""

    def __init__(self, robot: MobileManipulator, task: Task, criterion: Criterion) -> None:
        self.robot, self.m = robot, task_map_of(task).m
        self.extended = ExtendedJacobian(robot, task_map_of(task), criterion)
        self._of = robot, task, criterion

    @cached_property
    def bounds(self) -> dict[str, float]:
        """The roots of the bounds of (22) that ``a = "auto"`` takes; sampling takes 50 ms."""
        robot, task, criterion = self._of
        spaces = {"J": TaskSpace(robot, task, criterion), "J_e": TaskSpace(robot, task)}
        return {name: math.sqrt(jacobian_bound(robot, task, own)) for name, own in spaces.items()}

    def sigmas(self) -> tuple[float, float]:
        """Least singular values of J_e and J."""
        J_e, J = self.extended.J[: self.m], self.extended.J
        return sigma_min(J_e), sigma_min(J)

    def stiffness(self) -> float:
        """Least eigenvalue of N (H + D) N^T, symmetrised, on the motions that leave the tip at rest; inf
        if there are none."""
        J, extended = self.extended.J, self.extended
        free = np.linalg.svd(J[: self.m])[2][self.m :].T
        motion = extended.complement @ extended.buffers.C @ free
        stiffness = motion.T @ J[self.m :] @ free
        values = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
        return float(values[0]) if len(values) else math.inf


# The verdict ------------------------------------------------------------------------------------------


def verdict(run: Run, extended: bool, error: SingularityError | None) -> Singularity | None:
    """The singularity that ended a run early, or None if it ran away for another reason; whether its law
    drives the extended task of (13) or the tip alone, and what it or the plant raised, if it did."""
    last, left = len(run.t) - 1, left_its_task(run)
    where = nearest_limit(run.robot, run.q[left])
    if error is not None and error.matrix in ("M", "B"):
        robot = run.plant if error.matrix == "M" else run.robot
        sigma = sigma_min(getattr(robot.dynamics(run.q[last], run.z[last]), error.matrix))
        found = Singularity(error.matrix, run.t[last], sigma, math.nan, *where)
        return found if left == last else None
    first = max(0, left - round(_AFTERMATH / run.dt))
    with contextlib.suppress(MobmanError):  # a task whose points cannot be sampled
        jacobians = Jacobians(run.robot, run.task, run.criterion)
        values, signs = _along(jacobians, run.q[first : left + 1])
        for name in ("J_e", "J") if extended else ("J_e",):
            low = ~(values[name] >= jacobians.bounds[name])
            folds = np.append(np.diff(signs) != 0.0, False) & (name == "J")
            if (low | folds).any():
                begin = int(np.argmax(low | folds))
                return Singularity(
                    # j of (11) loses its rank where J_e does
                    error.matrix if error is not None and error.matrix else name,
                    float(run.t[first + begin]),
                    0.0 if folds.any() else float(values[name].min()),
                    jacobians.bounds[name],
                    *nearest_limit(run.robot, run.q[first + begin]),
                )
    if error is None or left < last:
        return None
    return Singularity(error.matrix, float(run.t[last]), math.nan, math.nan, *where)


def _along(jacobians: Jacobians, states: Array) -> tuple[dict[str, Array], Array]:
    """Least singular values along configurations, and the signs of the determinant."""
    rows: list[tuple[float, float, float]] = []
    for q in states:
        try:
            jacobians.extended.at(q, np.zeros(len(jacobians.extended.f)))
            rows.append((*jacobians.sigmas(), determinant_sign(jacobians.extended, jacobians.m)))
        except SingularityError:
            rows.append((0.0, 0.0, rows[-1][2] if rows else 1.0))
    tip, both, signs = np.array(rows).T
    return {"J_e": tip, "J": both}, signs


def left_its_task(run: Run) -> int:
    """The last tick at which a run that ended early was still what its law made of it: not yet
    farther from its task than twice the start and than a share of the arm's reach, for good, nor so
    fast that a tick does not resolve it."""
    near = 0.0
    with contextlib.suppress(MobmanError):
        near = _ON_TASK * place_of(run.robot, run.q[0]).reach
    distance = run.task_distance
    inside = np.flatnonzero(distance <= max(_FARTHER * float(distance[0]), near))
    on_task = int(inside[-1]) if len(inside) else 0
    steps = np.abs(np.diff(run.q[:, _posture(run.robot)], axis=0)).max(axis=1, initial=0.0)
    fast = np.flatnonzero(~(steps <= _RESOLVED))
    return min(on_task, int(fast[0])) if len(fast) else on_task


def nearest_limit(robot: MobileManipulator, q: Array) -> tuple[str, float]:
    """The joint of the arm that is nearest to its limits at q, or farthest beyond, and how far it is
    inside (rad, m); empty and NaN if none has limits."""
    limits = robot.limits
    margins = np.minimum(q - limits.lower, limits.upper - q)[robot.arm_index]
    margins = np.where(np.isfinite(margins), margins, math.inf)
    if not len(margins) or math.isinf(margins.min()):
        return "", math.nan
    nearest = int(np.argmin(margins))
    return robot.joint_names[robot.arm_index[nearest]], float(margins[nearest])


def _posture(robot: MobileManipulator) -> list[int]:
    """Coordinates that J depends on: the heading and the arm."""
    names, arm = robot.joint_names, set(robot.arm_index.tolist())
    return [i for i, name in enumerate(names) if i in arm or name == "base_theta"]


# The prediction ---------------------------------------------------------------------------------------

_STEP = 0.05  # s
_SMALLEST = 1e-3  # s: a posture that changes by 50 rad/s is at a singularity
_TURN = 0.05  # rad or m: the posture's largest change in a step
_RATE = 2.0  # 1/s, at which e goes to 0
_BETWEEN = 0.1  # s: at which singular values are kept


@dataclass(frozen=True)
class Prediction:
    """The motion of a robot that follows its task exactly, with f_a = 0, and what ends it."""

    t: Array
    """Times (s), shape (N,)."""
    q: Array
    """Configurations at them, shape (N, nq)."""
    sigma_tip: Array
    """Least singular value of J_e of (43) at them, shape (N,)."""
    sigma: Array
    """The same of J of (13)."""
    stiffness: Array
    """Least eigenvalue of N (H + D) N^T at them, shape (N,): above 0 where f_a = 0 is a minimum of F."""
    ended: bool
    """True if it ends early: the solution of the extended task folds back, or j loses its rank."""
    jacobians: Jacobians

    @cached_property
    def singular(self) -> Singularity | None:
        """Time and cause where the motion ends early."""
        if not self.ended:
            return None
        bounds, tip = self.jacobians.bounds, float(self.sigma_tip[-1])
        name, sigma = ("J_e", tip) if tip < bounds["J_e"] else ("J", 0.0)
        where = nearest_limit(self.jacobians.robot, self.q[-1])
        return Singularity(name, float(self.t[-1]), sigma, bounds[name], *where)


def predict_singularity(
    robot: MobileManipulator,
    task: Task,
    *,
    duration: float,
    q0: Array | None = None,
    criterion: Criterion | None = None,
    step: float = _STEP,
) -> Prediction:
    r"""Predict whether a law on the extended task (13) ends in a singularity, without any dynamics.

    :math:`\dot q = C J^{-1}(\dot p_d - \kappa e)` is integrated by the midpoint rule, at most 0.05 rad
    a step, as laws move that hold e = 0 from some seconds on, at a hundredth of a simulation's cost. It
    ends where the determinant of J changes its sign, or no step is small enough.

    Args:
        robot, task: As of :func:`mobman.simulate`, each an object.
        duration: How far to look (s).
        q0: Start (m, rad), shape (nq,); ``robot.q_rest`` by default.
        criterion: F; by default that of the laws, with the task's weights or the robot's.
        step: The longest (s).
    """
    criterion = CriterionGains().criterion(robot, task) if criterion is None else criterion
    jacobians = Jacobians(robot, task, criterion)
    extended, m, posture = jacobians.extended, jacobians.m, _posture(robot)
    space, rest = TaskSpace(robot, task, criterion), np.zeros(robot.nz)

    def rate(t: float, q: Array) -> Array:
        space.at(t, q, rest)
        wanted = -_RATE * space.f
        wanted[:m] += space.p_d[1] + _RATE * space.p_d[0]
        found: Array = space.now.C @ np.linalg.solve(space.J, wanted)
        return found

    q = robot.q_rest.copy() if q0 is None else robot.checked_configuration(q0)
    t, longest, sign, ended = 0.0, step, 0.0, False
    rows: list[tuple[Any, ...]] = []
    while not ended and t < duration:
        try:
            extended.at(q, rest)
            here, q_dot = determinant_sign(jacobians.extended, jacobians.m), rate(t, q)
            fastest = float(np.abs(q_dot[posture]).max(initial=0.0))
            step = min(longest, 2.0 * step, _TURN / max(fastest, _TURN))
            sign = sign or here
            ended = here != sign or not step > _SMALLEST
            if ended or not rows or step < longest or t >= rows[-1][0] + _BETWEEN:
                rows.append((t, q, *jacobians.sigmas(), jacobians.stiffness()))
            q, t = q + step * rate(t + 0.5 * step, q + 0.5 * step * q_dot), t + step
        except (SingularityError, np.linalg.LinAlgError):
            rows.append((t, q, 0.0, 0.0, 0.0))
            ended = True
    times, states, tip, both, stiffness = map(np.array, zip(*rows, strict=True))
    return Prediction(times, states, tip, both, stiffness, ended, jacobians)
