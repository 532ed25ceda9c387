"""The paper's youBot: (68) to (71) typed here again, and the data of section 4."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pinocchio as pin
from support.differences import relative
from support.states import random_states

import mobman as mm
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.task_map import TaskMap

A, C, HEIGHT = 0.167, 0.161, 0.084
L1, L2, L3 = 0.033, 0.155, 0.342
W, R = 0.158, 0.05


def _sums(q):
    """c_theta1, c_theta12, c_theta123, s_theta1, s_theta12, s_theta123 under (68)."""
    theta, (y1, y2, y3) = q[2], q[5:]
    return (
        cos(-theta + y1),
        cos(-theta + y1 + y2) + cos(theta - y1 + y2),
        cos(-theta + y1 + y2 + y3) + cos(theta - y1 + y2 + y3),
        sin(-theta + y1),
        sin(-theta + y1 + y2) - sin(theta - y1 + y2),
        sin(-theta + y1 + y2 + y3) - sin(theta - y1 + y2 + y3),
    )


def equation_68(q):
    theta, y2, y3 = q[2], q[6], q[7]
    c1, c12, c123, s1, s12, s123 = _sums(q)
    return np.array(
        [
            A * cos(theta) + L1 * c1 + L2 / 2 * c12 + L3 / 2 * c123 + q[0],
            A * sin(theta) - L1 * s1 - L2 / 2 * s12 - L3 / 2 * s123 + q[1],
            C - L2 * sin(y2) - L3 * sin(y2 + y3) + HEIGHT,
        ]
    )


def equation_70(q):
    """Rows 1 to 3 of j. j24 and j26 are misprinted in (70): here is the derivative of (68)."""
    theta, (y1, y2, y3) = q[2], q[5:]
    c1, c12, c123, s1, s12, s123 = _sums(q)
    minus, plus = -theta + y1 + y2, theta - y1 + y2
    j13 = -A * sin(theta) + L1 * s1 + L2 / 2 * s12 + L3 / 2 * s123
    j14 = -L1 * s1 - L2 / 2 * s12 - L3 / 2 * s123
    j15 = L2 / 2 * (-sin(minus) - sin(plus)) + L3 / 2 * (-sin(minus + y3) - sin(plus + y3))
    j16 = L3 / 2 * (-sin(minus + y3) - sin(plus + y3))
    j23 = A * cos(theta) + L1 * c1 + L2 / 2 * c12 + L3 / 2 * c123
    j24 = -L1 * c1 - L2 / 2 * c12 - L3 / 2 * c123
    j25 = -L2 / 2 * (cos(minus) - cos(plus)) - L3 / 2 * (cos(minus + y3) - cos(plus + y3))
    j26 = -L3 / 2 * (cos(minus + y3) - cos(plus + y3))
    j35 = -L2 * cos(y2) - L3 * cos(y2 + y3)
    j36 = -L3 * cos(y2 + y3)
    return np.array(
        [
            [1, 0, j13, 0, 0, j14, j15, j16],
            [0, 1, j23, 0, 0, j24, j25, j26],
            [0, 0, 0, 0, 0, 0, j35, j36],
        ]
    )


def test_coordinates_are_the_papers(youbot):
    assert youbot.joint_names == [
        "base_x", "base_y", "base_theta", "phi_1", "phi_2", "y_1", "y_2", "y_3",
    ]  # fmt: skip
    assert (youbot.nq, youbot.nz, youbot.k) == (8, 5, 3)


def test_tip_position_is_equation_68(youbot):
    for q, _ in random_states(youbot):
        assert relative(youbot.tip_pose(q).translation, equation_68(q)) < 1e-14


def test_tip_jacobian_is_equation_70(youbot):
    for q, _ in random_states(youbot):
        assert relative(youbot.tip_jacobian(q)[:3], equation_70(q)) < 1e-14


def test_velocity_map_is_equation_69(youbot):
    for q, _ in random_states(youbot, 20):
        expected = np.zeros((8, 5))
        c, s = cos(q[2]), sin(q[2])
        expected[:5, :2] = [[c, c], [s, s], [1 / W, -1 / W], [2 / R, 0], [0, 2 / R]]
        expected[5:, 2:] = np.eye(3)
        assert relative(youbot.velocity_map(q), expected) < 1e-14


def test_actuation_is_equation_71(youbot):
    for q, z in random_states(youbot, 20):
        assert np.allclose(youbot.dynamics(q, z).B, np.diag([2 / R, 2 / R, 1, 1, 1]), atol=1e-13)


def test_start_is_the_papers(youbot):
    assert np.allclose(youbot.q_rest, [-0.4, 0, 0, 0, 0, 0, -pi / 18, pi / 9], atol=1e-15)


def test_criterion_weights_of_its_task_are_the_papers(youbot):
    """Those of its description hold for longer than the paper's 10 s."""
    expected = [0.001, 0.001, 0.001, 0.05, 0.05, 0.0001, 0.05, 0.05]
    task = mm.make_task("paper", youbot)
    assert task.criterion_weights(youbot).tolist() == expected
    for name in ("tsm", "extended-jacobian"):
        law = mm.make_controller(name)
        law.reset(youbot, task, 1e-3)
        assert law.settings()["K_F"] == expected
        law.reset(youbot, mm.make_task("circle", youbot), 1e-3)
        assert law.settings()["K_F"] == youbot.criterion_weights.tolist() != expected


def test_masses_are_the_papers(youbot):
    by_joint = {
        name: youbot.model.inertias[youbot.model.getJointId(name)].mass
        for name in ("base_theta", "phi_1", "phi_2", "y_1", "y_2", "y_3")
    }
    assert by_joint == {
        "base_theta": 19.803, "phi_1": 1.4, "phi_2": 1.4, "y_1": 1.39, "y_2": 1.318, "y_3": 2.496,
    }  # fmt: skip


def test_inertias_are_kukas(youbot):
    """Principal moments about the centres of mass; the last link is a composite, see its URDF."""

    def principal(joint):
        return np.linalg.eigvalsh(youbot.model.inertias[youbot.model.getJointId(joint)].inertia)

    assert np.allclose(principal("y_1"), sorted((0.0029525, 0.0060091, 0.0058821)))
    assert np.allclose(principal("y_2"), sorted((0.0031145, 0.0005843, 0.0031631)))
    assert np.allclose(principal("y_3")[1:], 0.0118, atol=1e-4)
    lever = youbot.model.inertias[youbot.model.getJointId("y_3")].lever
    assert np.allclose(lever, [0.181, 0.0, 0.0])


def test_platform_is_a_homogeneous_box(youbot):
    platform = youbot.model.inertias[youbot.model.getJointId("base_theta")]
    x, y, z = 0.57, 0.36, 0.10
    expected = 19.803 / 12 * np.array([y**2 + z**2, x**2 + z**2, x**2 + y**2])
    assert np.allclose(np.diag(platform.inertia), expected, atol=1e-6)


def test_arms_reach_along_the_heading_at_zero(youbot):
    """At y = 0 the arm lies stretched; joint 1 turns about -z, joints 2 and 3 about +y."""
    pin.forwardKinematics(youbot.model, youbot.data, np.zeros(8))
    axes = youbot.tip_jacobian(np.zeros(8))[3:, 5:].T
    assert np.allclose(axes, [[0, 0, -1], [0, 1, 0], [0, 1, 0]], atol=1e-12)
    tip = youbot.tip_pose(np.zeros(8)).translation
    assert np.allclose(tip, [A + L1 + L2 + L3, 0.0, HEIGHT + C], atol=1e-12)


def test_least_eigenvalue_of_the_extended_jacobian_at_the_start(youbot):
    """lambda_min(J J^T) = 0.0023: the paper's a = 0.2 holds only once the robot moves."""
    weights = mm.make_task("paper", youbot, youbot.q_rest).criterion_weights(youbot)
    criterion = Posture(np.asarray(weights), youbot.q_rest)
    kinematics = extended_kinematics(youbot, TaskMap(), criterion, youbot.q_rest, np.zeros(5))
    assert np.isclose(np.linalg.eigvalsh(kinematics.J @ kinematics.J.T)[0], 0.0023, atol=5e-5)
