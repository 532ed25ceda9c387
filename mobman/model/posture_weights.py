r"""The rule for the platform's weights in the posture criterion (12), for any platform and arm.

What grows with the way that is driven (x1, x2, wheel angles) must not pull: the pull would grow with it,
until the posture folds. Where it does not, and the platform alone can take the tip along a path, F has
its least, 0, all along it: the arm rests, g = 0, so that lam = 0, D(lam) = 0, and
:math:`\mathcal N(H + D)\mathcal N^T` is the constant :math:`\mathcal N H\mathcal N^T`. A base that has
more velocities than that takes (it can turn under the tip) must be held by the weight of its heading,
as the arm is by its own; one that has not need not be, and then the heading, which grows with the turns,
should not pull either.
"""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.model.metric import base_metric
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.spec import DRIVEN

_TIP = 3  # rows of the tip's Jacobian: its position
_RANK = 1e-9  # of the largest singular value
_ENOUGH = 0.9  # of the best conditioning: what a weight of the heading must not gain
_DECADES, _PER_DECADE = 4, 5  # below the arm's weight, where the best is looked for


def reduced_stiffness(robot: MobileManipulator, K_F: Array) -> Array:
    r""":math:`Z^T\Omega^{1/2}C^TK_FC\,\Omega^{1/2}Z` at rest, shape (nz - rank, nz - rank).

    Z has orthonormal columns, those of the kernel of :math:`j_e\Omega^{1/2}` for the tip's position: it
    is :math:`\mathcal N(H + D)\mathcal N^T` at rest, where D = 0, in the metric of
    :func:`mobman.model.metric.base_metric`. A pose task leaves a part of that kernel, on which the
    stiffness is conditioned no worse.
    """
    q, root = robot.q_rest, np.sqrt(base_metric(robot))
    C = robot.velocity_map(q) * root
    _, singular, axes = np.linalg.svd(robot.tip_jacobian(q)[:_TIP] @ C)
    rank = int(np.sum(singular > _RANK * singular[0]))
    free = C @ axes[rank:].T
    stiffness: Array = free.T @ K_F @ free
    return stiffness


def conditioning(robot: MobileManipulator, weights: Array) -> float:
    """Least over largest eigenvalue of :func:`reduced_stiffness` of a diagonal K_F; 1 if it is empty."""
    values = np.linalg.eigvalsh(reduced_stiffness(robot, np.diag(weights)))
    return float(values[0] / values[-1]) if len(values) else 1.0


def heading_weight(robot: MobileManipulator) -> float:
    """The weight of the heading: none to speak of where that has nearly the best :func:`conditioning`,
    else that of the arm's joints (their median).

    With less of it than the arm has, J of (13) is small along the turns under the tip: lambda_min(J J^T)
    of (22) falls with the square of the weight. The other weights are the robot's. Couplings are left
    out: what they are for, steering, stands still while the heading turns.
    """
    heading = robot.joint_names.index(robot.platform.base_joints[-1])
    weights = robot.criterion_weights.copy()
    arms = float(np.median(weights[robot.arm_index]))
    values = []
    for candidate in (DRIVEN, *arms * np.logspace(-_DECADES, 0.0, _DECADES * _PER_DECADE + 1)):
        weights[heading] = candidate
        values.append(conditioning(robot, weights))
    return DRIVEN if values[0] >= _ENOUGH * max(values) else arms
