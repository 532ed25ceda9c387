"""The circles: the paper's, and the one near any robot's tip."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.differences import derivative

import mobman as mm
from mobman.tasks.circle import Circle

PAPER_TIMES = np.linspace(0.0, 10.0, 41)


def test_paper_circle_is_the_papers(youbot):
    """p_d = (2 + cos t, 3 + sin t, 0.35)."""
    task = mm.make_task("paper", youbot)
    for t in PAPER_TIMES:
        assert np.allclose(task.desired(t)[0], [2 + math.cos(t), 3 + math.sin(t), 0.35], atol=1e-14)


@pytest.fixture(params=["paper", "circle", "clockwise"])
def task(request, tiago):
    if request.param == "clockwise":
        return Circle(centre=(1.0, -2.0, 0.7), radius=0.3, rate=-1.7, phase=0.4)
    return mm.make_task(request.param, tiago)


def test_derivatives(task):
    for t in (0.0, 0.7, 3.3, 9.1):
        for order in range(3):
            expected = derivative(lambda s, t=t, k=order: task.desired(t + s)[k], h=0.05)
            assert np.allclose(task.desired(t)[order + 1], expected, atol=1e-9)


def test_path_closes_after_its_period(task):
    assert task.period > 0.0
    for part, later in zip(task.desired(0.3), task.desired(0.3 + task.period), strict=True):
        assert np.allclose(part, later, atol=1e-12)
    half = task.desired(0.3 + 0.5 * task.period)[0]
    assert np.linalg.norm(half - task.desired(0.3)[0]) > task.radius


def test_circle_of_a_fixed_arm_is_between_the_tip_and_the_base(fixed_robot):
    robot, q0 = fixed_robot, fixed_robot.q_rest
    tip, base = np.array(robot.tip_pose(q0).translation), robot.arm_origin(q0)
    task = mm.make_task("circle", robot)
    reach = np.linalg.norm(tip - base)
    start = task.desired(0.0)[0]
    assert 0.0 < np.linalg.norm(start - tip) < 0.05 * reach
    for t in np.linspace(0.0, task.period, 50):
        p = task.desired(t)[0]
        assert np.isclose(p[2], tip[2])
        assert np.linalg.norm((p - base)[:2]) < np.linalg.norm((tip - base)[:2])


def test_circle_starts_just_ahead_of_the_tip(driving_robot):
    robot = driving_robot
    q0 = robot.q_rest.copy()
    q0[robot.joint_names.index("base_theta")] = 0.8
    heading = np.array([math.cos(0.8), math.sin(0.8), 0.0])
    p, p_dot, _, _ = mm.make_task("circle", robot, q0).desired(0.0)
    assert np.allclose(p, robot.tip_pose(q0).translation + 0.1 * heading, atol=1e-12)
    # and first runs along the heading
    assert np.allclose(p_dot, np.linalg.norm(p_dot) * heading, atol=1e-12)
    assert np.linalg.norm(p_dot) > 0.1


def test_circle_keeps_to_the_tips_height(robot):
    task = mm.make_task("circle", robot)
    height = robot.tip_pose(robot.q_rest).translation[2]
    assert all(np.isclose(task.desired(t)[0][2], height) for t in PAPER_TIMES)


def test_circle_starts_at_rest_unless_told_otherwise(robot):
    default = mm.make_task("circle", robot).desired(0.0)[0]
    assert np.array_equal(default, mm.make_task("circle", robot, robot.q_rest).desired(0.0)[0])
