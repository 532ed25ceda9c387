"""Pose and Jacobian of the tip and their rates, on every robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from support.differences import derivative, relative
from support.states import random_states


def test_linear_rows_of_the_jacobian(robot):
    random = np.random.default_rng(8)
    for q, _ in random_states(robot):
        direction = random.standard_normal(robot.nq)
        expected = derivative(
            lambda s, q=q, d=direction: np.array(robot.tip_pose(q + s * d).translation)
        )
        assert relative(robot.tip_jacobian(q)[:3] @ direction, expected) < 1e-6


def test_angular_rows_of_the_jacobian(robot):
    """R(s) = exp(s w) R(0) to first order, with w in world axes."""
    random = np.random.default_rng(9)
    for q, _ in random_states(robot):
        direction = random.standard_normal(robot.nq)
        start = np.array(robot.tip_pose(q).rotation)
        expected = derivative(
            lambda s, q=q, d=direction, r=start: pin.log3(
                np.array(robot.tip_pose(q + s * d).rotation) @ r.T
            )
        )
        assert relative(robot.tip_jacobian(q)[3:] @ direction, expected) < 1e-6


def test_every_column_of_the_jacobian_at_rest(robot):
    for column, direction in zip(robot.tip_jacobian(robot.q_rest).T, np.eye(robot.nq), strict=True):
        expected = derivative(
            lambda s, d=direction: np.array(robot.tip_pose(robot.q_rest + s * d).translation)
        )
        assert relative(column[:3], expected) < 1e-6


def test_rate_of_the_jacobian_along_the_motion(robot):
    """J' and J' z: C' included, since J of (13) is df/dq C."""
    for q, z in random_states(robot):
        _, q_dot, c_dot_z = robot.velocity(q, z)
        tip = robot.tip_kinematics(q, z)
        expected = derivative(lambda s, q=q, d=q_dot: robot.tip_jacobian(q + s * d))
        assert relative(tip.jacobian_rate, expected) < 1e-6
        reduced = derivative(
            lambda s, q=q, z=z, d=q_dot: (
                robot.tip_jacobian(q + s * d) @ (robot.velocity_map(q + s * d) @ z)
            )
        )
        assert relative(tip.jacobian_rate @ q_dot + tip.jacobian @ c_dot_z, reduced) < 1e-6


def test_one_pass_gives_what_the_single_calls_give(robot):
    for q, z in random_states(robot, 20):
        tip = robot.tip_kinematics(q, z)
        assert np.allclose(tip.position, robot.tip_pose(q).translation, atol=1e-14)
        assert np.allclose(tip.jacobian, robot.tip_jacobian(q), atol=1e-14)


def test_results_are_the_callers(robot):
    """The next call leaves them alone."""
    kept = []
    for q, z in random_states(robot, 3):
        tip = robot.tip_kinematics(q, z)
        kept.append((tip, [part.copy() for part in tip]))
    for tip, copies in kept:
        for part, copy in zip(tip, copies, strict=True):
            assert np.array_equal(part, copy)


def test_tip_is_the_frame_of_the_description(robot):
    data = robot.model.createData()
    for q, _ in random_states(robot, 5):
        pin.framesForwardKinematics(robot.model, data, q)
        frame = data.oMf[robot.model.getFrameId(robot.spec.arm.tip)]
        assert np.allclose(robot.tip_pose(q).homogeneous, frame.homogeneous, atol=1e-13)


def test_driving_moves_the_tip_with_the_platform(driving_robot):
    """Turning the platform in place carries the tip around its reference point."""
    robot = driving_robot
    q = robot.q_rest.copy()
    x, y, heading = (robot.joint_names.index(f"base_{name}") for name in ("x", "y", "theta"))
    before = np.array(robot.tip_pose(q).translation)
    q[heading] += np.pi / 2
    after = np.array(robot.tip_pose(q).translation)
    arm = before[:2] - q[[x, y]]
    assert np.allclose(after[:2] - q[[x, y]], [-arm[1], arm[0]], atol=1e-12)
    assert np.isclose(after[2], before[2], atol=1e-12)
