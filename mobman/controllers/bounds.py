"""The constants that the theorems need of a robot: bounds of (22), (54) and (64), by sampling."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mobman.arrays import Array
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import SingularityError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_SAMPLES = 200
SPREAD = 0.5  # rad or m: how far sampled arm coordinates are from rest
AUTO_MARGIN = (
    0.1  # of the sampled minimum: what "auto" uses, since sampling sees the worst state rarely
)
FLOOR = 1e-12
"""Below it, the samples are singular to the precision of J. Rows of J are as large as the criterion's
weights, so that a sound robot may have 1e-9: the platform's part of an omnidirectional one."""
_HORIZON = 10.0  # s: the part that is sampled of a task that does not say how long it is
SEED = 20_240_607
RATE_STEP = 1e-4
"""Of central differences along the motion (rad or m)."""
CONSTANT = 1e-12
"""Part of a matrix below which a difference is rounding."""


def sampled_states(robot: MobileManipulator, task: Task) -> list[tuple[float, Array]]:
    """Times and configurations that the task may lead through.

    The arm near its rest posture and inside its limits, any heading, and the platform where the tip
    is above the desired point of a random time: within the task's ``duration`` or ``period`` if it
    has one, else its first 10 s.
    """
    random = np.random.default_rng(SEED)
    horizon = getattr(task, "duration", None) or getattr(task, "period", None) or _HORIZON
    lower = np.maximum(robot.model.lowerPositionLimit, robot.q_rest - SPREAD)
    upper = np.minimum(robot.model.upperPositionLimit, robot.q_rest + SPREAD)
    heading = robot.joint_names.index("base_theta") if "base_theta" in robot.joint_names else None
    position = [robot.joint_names.index(n) for n in ("base_x", "base_y") if n in robot.joint_names]
    states = []
    for _ in range(_SAMPLES):
        t = random.uniform(0.0, horizon)
        q = robot.q_rest.copy()
        q[robot.arm_index] = random.uniform(lower, upper)[robot.arm_index]
        q = robot.consistent(q)
        if heading is not None:
            q[heading] = random.uniform(-math.pi, math.pi)
        if len(position) == 2:
            desired = np.asarray(task.desired(t)[0], dtype=float)
            tip = np.asarray(robot.tip_pose(q).translation)
            q[position] += desired[:2] - tip[:2]
        states.append((t, q))
    return states


def jacobian_bound(
    robot: MobileManipulator, task: Task, space: TaskSpace, metric: Array | None = None
) -> float:
    """``a = "auto"``: a tenth of the least lambda_min(J J^T) over :func:`sampled_states`, (22).

    With a ``metric``, the diagonal of Omega of shape (nz,), it is that of J Omega J^T.

    In the implicit form a bound that is lower than need be costs nothing; one above
    lambda_min(J J^T) lets the state fall off the manifold.
    """
    none = np.zeros(robot.nz)
    root = np.sqrt(np.ones(robot.nz) if metric is None else metric)
    least = math.inf
    for i, (t, q) in enumerate([(0.0, robot.q_rest), *sampled_states(robot, task)]):
        try:
            space.at(t, q, none)
        except SingularityError:
            continue  # (15) supposes that such configurations are not met
        # a turned platform is no orientation error that is met: the largest is at the start
        J = space.J if i == 0 else space.aligned_jacobian()
        least = min(least, float(np.linalg.svd(J * root, compute_uv=False)[-1] ** 2))
    return max(AUTO_MARGIN * least, FLOOR) if math.isfinite(least) else FLOOR


def actuation_bound(robot: MobileManipulator, task: Task, w_7: float) -> float:
    r"""``A = "auto"``: a lower bound of lambda_min(B B^T), (54), for a robot of any mass.

    Theorem 2 asks that chi bounds :math:`|M U + \dot M S/2|` (53), so that w_7 bounds
    :math:`|M|`; the paper's w_7 = 6 does so for light arms only. The gain C/A is what makes up for
    it: A is the least :math:`\lambda_{min}(B B^T)\min(1, w_7/\lambda_{max}(M))` over
    :func:`sampled_states`, times a margin.
    """
    none = np.zeros(robot.nz)
    least = math.inf
    for _, q in sampled_states(robot, task):
        m, _, b = robot.dynamics(q, none)
        covered = min(1.0, w_7 / float(np.linalg.eigvalsh(m)[-1]))
        least = min(least, covered * float(np.linalg.svd(b, compute_uv=False)[-1]) ** 2)
    return max(AUTO_MARGIN * least, FLOOR)


def inertia_bound(robot: MobileManipulator, task: Task) -> float:
    """``A`` of the inverse-actuation law when ``"auto"``: a lower bound A' of lambda_min(M^-1), (64),
    the least 1/lambda_max(M) over :func:`sampled_states`, times a margin."""
    none = np.zeros(robot.nz)
    return AUTO_MARGIN / max(
        float(np.linalg.eigvalsh(robot.dynamics(q, none).M)[-1])
        for _, q in sampled_states(robot, task)
    )


def rate_along(
    robot: MobileManipulator, q: Array, z: Array, value: Callable[[Array], Array]
) -> Array:
    """d/dt of a matrix of q along q' = C z, by central differences; for z of a length near 1."""
    step = RATE_STEP * (robot.velocity_map(q) @ z)
    before, after = value(q - step), value(q + step)
    change = after - before
    if np.abs(change).max() <= CONSTANT * max(np.abs(after).max(), np.abs(before).max()):
        return np.zeros_like(change)
    return change / (2.0 * RATE_STEP)
