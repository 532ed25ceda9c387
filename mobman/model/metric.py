r"""The metric of reduced velocities that a redundancy resolution is measured in, and what follows from
it for the platform's weights in the posture criterion (12), for any platform and arm.

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
from mobman.model.criterion import Criterion
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.spec import DRIVEN

BASE_COST = 0.3
"""Cost of 1 m/s of the base's speed, in rad/s (m/s of a slide) of an arm joint (rad/m)."""
TURNING_ARM = 0.3  # distance at which turning counts as the base's speed (m)
_TIP = 3  # rows of the tip's Jacobian: its position
_RANK = 1e-9  # of the largest singular value
_ENOUGH = 0.9  # of the best conditioning: what a weight of the heading must not gain
_DECADES, _PER_DECADE = 4, 5  # below the arm's weight, where the best is looked for
_STEERING = 0.3  # m/s per unit of an alpha that does not move the base at once: what turns a wheel


def base_metric(robot: MobileManipulator) -> Array:
    r"""Diagonal of :math:`\Omega`, the inverse metric of z, shape (nz,).

    :math:`z^T\Omega^{-1}z` is the sum of the squares of the arm's joint rates and, for each platform
    velocity, of ``BASE_COST`` times the speed that it gives the base; so it does not matter how large
    the wheels are, nor which quasi-velocities alpha describe them. It is a convention about rates of
    different units, not the kinetic energy (:math:`\Omega = M^{-1}` would have the light wrist do
    nearly everything), and it is constant: the speeds are those in the rest posture.
    """
    speeds = np.zeros(robot.n_alpha)
    if robot.platform.base_joints:
        index = [robot.joint_names.index(name) for name in robot.platform.base_joints]
        twist = robot.velocity_map(robot.q_rest)[index, : robot.n_alpha]
        speeds = np.linalg.norm(twist * np.array([[1.0], [1.0], [TURNING_ARM]]), axis=0)
    omega = np.ones(robot.nz)
    omega[: robot.n_alpha] = (BASE_COST * np.where(speeds > 0.0, speeds, _STEERING)) ** -2
    return omega


def unit_stiffness(robot: MobileManipulator, criterion: Criterion) -> float:
    r"""The factor by which :math:`-\Omega C^T \partial F/\partial q` has the stiffness 1 s^-2 (as an
    acceleration; 1 s^-1 as a velocity) in its stiffest motion.

    It is :math:`1/\lambda_{max}(\Omega C^T H C)` in the rest posture, with :func:`base_metric`; 0 where
    F is flat.
    """
    root, C = np.sqrt(base_metric(robot))[:, None], robot.velocity_map(robot.q_rest)
    # Omega^1/2 C^T H C Omega^1/2 has the eigenvalues of Omega C^T H C
    stiffness = root * (C.T @ criterion.hessian(robot.q_rest) @ C) * root.T
    largest = float(np.abs(np.linalg.eigvalsh(stiffness)).max())
    return 1.0 / largest if largest > 0.0 else 0.0


def reduced_stiffness(robot: MobileManipulator, K_F: Array) -> Array:
    r""":math:`Z^T\Omega^{1/2}C^TK_FC\,\Omega^{1/2}Z` at rest, shape (nz - rank, nz - rank).

    Z has orthonormal columns, those of the kernel of :math:`j_e\Omega^{1/2}` for the tip's position: it
    is :math:`\mathcal N(H + D)\mathcal N^T` at rest, where D = 0, in the metric of
    :func:`base_metric`. A pose task leaves a part of that kernel, on which the
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
