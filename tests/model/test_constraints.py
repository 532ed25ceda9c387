"""A N = 0, and what C = blkdiag(N, I) is made of, on every robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from support.differences import derivative, jacobian, relative
from support.states import random_states


def test_velocity_map_lies_in_the_kernel_of_the_constraints(robot):
    for q, z in random_states(robot):
        a, c = robot.constraint_matrix(q), robot.velocity_map(q)
        # entries of C are as large as 2/R
        assert np.abs(a @ c).max(initial=0.0) <= 1e-12 * max(1.0, np.abs(c).max())
        assert np.abs(a @ (c @ z)).max(initial=0.0) <= 1e-12 * max(1.0, np.abs(c @ z).max())


def test_constraints_and_velocity_map_have_full_rank(robot):
    for q, _ in random_states(robot, 20):
        assert np.linalg.matrix_rank(robot.constraint_matrix(q)) == robot.k
        assert np.linalg.matrix_rank(robot.velocity_map(q)) == robot.nz


def test_arm_coordinates_are_free_of_the_platform(robot):
    for q, _ in random_states(robot, 5):
        c, a = robot.velocity_map(q), robot.constraint_matrix(q)
        arm = c[robot.arm_index]
        assert np.array_equal(arm[:, : robot.n_alpha], np.zeros((robot.n, robot.n_alpha)))
        assert np.array_equal(arm[:, robot.n_alpha :], np.eye(robot.n))
        assert not c[np.ix_(robot.platform_index, range(robot.n_alpha, robot.nz))].any()
        assert not a[: robot.k - len(robot.followers), robot.arm_index].any()


def test_rate_of_the_velocity_map(robot):
    for q, z in random_states(robot):
        q_dot = robot.velocity_map(q) @ z
        expected = derivative(lambda s, q=q, d=q_dot: robot.velocity_map(q + s * d), 1e-3)
        assert relative(robot.velocity_map_rate(q, z), expected) < 1e-6


def test_velocity_gathers_the_map_the_motion_and_the_drift(robot):
    for q, z in random_states(robot, 50):
        c, q_dot, c_dot_z = robot.velocity(q, z)
        assert np.array_equal(c, robot.velocity_map(q))
        assert relative(q_dot, c @ z) < 1e-14
        assert relative(c_dot_z, robot.velocity_map_rate(q, z) @ z) < 1e-13


def test_rate_of_the_constraints(robot):
    for q, z in random_states(robot):
        q_dot = robot.velocity_map(q) @ z
        expected = derivative(lambda s, q=q, d=q_dot: robot.constraint_matrix(q + s * d), 1e-3)
        assert relative(robot.constraint_matrix_rate(q, q_dot), expected) < 1e-6


def test_hessian_of_the_constraints(robot):
    random = np.random.default_rng(3)
    for q, _ in random_states(robot, 20):
        multiplier = random.standard_normal(robot.k)
        expected = jacobian(lambda p, lam=multiplier: robot.constraint_matrix(p).T @ lam, q)
        assert relative(robot.constraint_hessian(q, multiplier), expected) < 1e-6


def test_rate_of_the_hessian_of_the_constraints(robot):
    random = np.random.default_rng(4)
    for q, _ in random_states(robot):
        # along any motion, not only an admissible one
        q_dot, multiplier = random.standard_normal(robot.nq), random.standard_normal(robot.k)
        expected = derivative(
            lambda s, q=q, d=q_dot, lam=multiplier: robot.constraint_hessian(q + s * d, lam)
        )
        assert relative(robot.constraint_hessian_rate(q, q_dot, multiplier), expected) < 1e-6


def test_driven_wheels_roll_without_slip(differential_robot):
    """The material point of a driven wheel that touches the ground stands still."""
    robot = differential_robot
    model, data = robot.model, robot.model.createData()
    radius = robot.platform.radius
    for q, z in random_states(robot, 50):
        q_dot = robot.velocity_map(q) @ z
        pin.forwardKinematics(model, data, q, q_dot)
        for wheel in robot.platform.coordinates[3:]:
            index = model.getJointId(wheel)
            twist = pin.getVelocity(model, data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            height = data.oMi[index].translation[2]
            assert abs(height - radius) < 1e-9
            contact = twist.linear + np.cross(twist.angular, [0.0, 0.0, -radius])
            assert np.abs(contact).max() < 1e-12 * max(1.0, np.abs(q_dot).max())
