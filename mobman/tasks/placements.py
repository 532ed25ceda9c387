"""Random placements: a start and a circle that a robot can follow, and how it is known beforehand."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.errors import SingularityError, UsageError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.metric import base_metric
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.circle import Circle, circle_near_tip
from mobman.tasks.paths import place_of
from mobman.tasks.task import Task, task_map_of

_STEP = 0.05  # s, of following a path
_RATE = 2.0  # 1/s, at which an error that there is goes to 0
_FASTEST = 100.0  # of |z|: beyond it the solution is lost
_DRAWS = 50
_SPREAD = 0.3  # rad or m, of the arm's start about its rest
_ROOM = 1.0  # m, of the platform's start about its rest
_LAPS = 2.0  # that are foreseen of a drawn circle
_LEAST = 0.25  # of j_e's least singular value at the start: what is left of it on a drawn circle


class Foreseen(NamedTuple):
    """What lies ahead on a task, with the paper's extended task solved exactly, f_a = 0."""

    until: float
    """Time up to which it could be followed (s)."""
    kinematic: float
    """Least singular value of j_e in the base's metric on the way, over that at the start."""
    definite: float
    """Least eigenvalue of the symmetric part of N (H + D) N^T in the metric, over that at the start."""
    q: Array
    """Configuration at that time, shape (nq,)."""


def foresee(
    robot: MobileManipulator, task: Task, q0: Array, duration: float, step: float = _STEP
) -> Foreseen:
    """Follow a task's kinematic solution, z = J^-1 (p' - errors), without any dynamics.

    It is where a law that holds f_a = 0 takes the robot, at a hundredth of a simulation's cost: a
    posture that folds, or a path that leads out of reach, shows as a singular value that goes to 0.

    Args:
        robot: The robot, with its criterion.
        task: The task.
        q0: Start, shape (nq,).
        duration: How far to look (s).
        step: Of the integration, by the midpoint rule (s).
    """
    task_map = task_map_of(task)
    m = task_map.m
    own = getattr(task, "criterion_weights", None)
    weights = robot.criterion_weights if own is None else own(robot)
    criterion = Posture(weights, robot.q_rest, 1.0, robot.criterion_couplings)
    extended = ExtendedJacobian(robot, task_map, criterion)
    root, still = np.sqrt(base_metric(robot)), np.zeros(robot.nz)

    def velocity(t: float, q: Array) -> Array:
        extended.at(q, still)
        p, p_dot, *_ = (np.asarray(part, dtype=float) for part in task.desired(t))
        wanted = -_RATE * extended.f
        wanted[:m] += _RATE * p + p_dot
        z = np.linalg.solve(extended.J, wanted)
        if not np.abs(z).max() < _FASTEST:
            raise SingularityError("the solution is lost")
        return robot.velocity_map(q) @ z

    def measures(q: Array) -> tuple[float, float]:
        _, singular, axes = np.linalg.svd(extended.J[:m] * root)
        free = root[:, None] * axes[m:].T
        motion = extended.complement @ robot.velocity_map(q) @ free
        stiffness = motion.T @ extended.J[m:] @ free
        values = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
        return float(singular[-1]), float(values[0]) if len(values) else 1.0

    q, t = np.array(q0, dtype=float), 0.0
    found: list[tuple[float, float]] = []
    try:
        for k in range(math.ceil(duration / step)):
            t = k * step
            rate = velocity(t, q)
            found.append(measures(q))
            q = q + step * velocity(t + 0.5 * step, q + 0.5 * step * rate)
        t = duration
    except (SingularityError, np.linalg.LinAlgError):
        pass
    if not found:
        return Foreseen(t, 0.0, 0.0, q)
    least = np.min(found, axis=0) if t == duration else np.zeros(2)
    return Foreseen(t, float(least[0] / found[0][0]), float(least[1] / abs(found[0][1])), q)


def placement(robot: MobileManipulator, index: int, seed: int = 0) -> tuple[Array, Circle]:
    """A start and a circle that the robot can follow, the same for the same index and seed.

    The platform starts within 1 m of its rest at any heading, the arm within 0.3 rad (or m) of its
    rest and within its limits. The circle is horizontal, at the tip's height, placed as the task
    ``circle`` is, with 0.5 to 1.5 times its radius, 0.5 to 2 times its gap, 0.3 to 0.6 rad/s either
    way round. Draws are repeated until the circle can be followed for two laps (:func:`foresee`) with a
    quarter of the start's singular value, so that a car gets none that lies beyond its arm's reach.

    Args:
        robot: The robot.
        index: Which placement, 0 or more.
        seed: Of all of them, 0 or more.

    Raises:
        UsageError: If 50 draws give none.
    """
    random = np.random.default_rng([seed, index])
    lower = np.maximum(robot.model.lowerPositionLimit, robot.q_rest - _SPREAD)
    upper = np.minimum(robot.model.upperPositionLimit, robot.q_rest + _SPREAD)
    base = [robot.joint_names.index(name) for name in robot.platform.base_joints]
    for _ in range(_DRAWS):
        q0 = robot.q_rest.copy()
        q0[robot.arm_index] = random.uniform(lower, upper)[robot.arm_index]
        if base:
            q0[base[:-1]] += random.uniform(-_ROOM, _ROOM, len(base) - 1)
            q0[base[-1]] += random.uniform(-math.pi, math.pi)
        q0 = robot.consistent(q0)
        default = circle_near_tip(robot, robot.q_rest)
        radius = default.radius * random.uniform(0.5, 1.5)
        rate = random.uniform(0.3, 0.6) * random.choice([-1.0, 1.0])
        gap = random.uniform(0.5, 2.0) * (0.1 if place_of(robot, q0).drives else 0.2 * radius)
        circle = circle_near_tip(robot, q0, radius=radius, rate=float(rate), gap=gap)
        ahead = foresee(robot, circle, q0, _LAPS * circle.period)
        if ahead.kinematic > _LEAST and ahead.definite > 0.0:
            return q0, circle
    raise UsageError(
        f"robot {robot.name!r}: none of {_DRAWS} random circles near its tip can be followed; try "
        f"'mobman robots check {robot.name}'"
    )
