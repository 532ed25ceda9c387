"""The metric of reduced velocities that a redundancy resolution is measured in."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.model.criterion import Criterion
from mobman.model.mobile_manipulator import MobileManipulator

BASE_COST = 0.3
"""Cost of 1 m/s of the base's speed, in rad/s (m/s of a slide) of an arm joint (rad/m)."""
TURNING_ARM = 0.3
"""Distance at which turning counts as the base's speed (m)."""
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
