"""``a`` and ``A`` when they are "auto": true bounds of what they bound, found once and reported."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.controllers.bounds import sampled_states
from mobman.controllers.task_errors import TaskSpace
from mobman.model.criterion import Posture


def _settings(law, robot, task, **gains):
    controller = mm.make_controller(law, **gains)
    controller.reset(robot, mm.make_task(task, robot), 1e-3)
    return controller.settings()


def _eigenvalues(robot, task, space):
    rest = np.zeros(robot.nz)
    for t, q in sampled_states(robot, task):
        space.at(t, q, rest)
        yield np.linalg.eigvalsh(space.J @ space.J.T)[0]


@pytest.mark.parametrize("law", ["tsm", "tsm-simplified"])
def test_a_lies_below_what_it_bounds(law, robot):
    """0 < a <= lambda_min(J J^T) (22) at the start and at every sampled state, with a margin."""
    a = _settings(law, robot, "circle")["a"]
    task = mm.make_task("circle", robot)
    space = TaskSpace(robot, task, None if law == "tsm-simplified" else Posture.of(robot))
    least = min(_eigenvalues(robot, task, space))
    assert isinstance(a, float)
    assert a > 0.0
    # 1e-12 is the least that is ever used
    assert a <= max(0.5 * least, 1e-12)


def test_a_is_no_smaller_than_the_samples_ask_for(youbot):
    task = mm.make_task("paper", youbot)
    least = min(_eigenvalues(youbot, task, TaskSpace(youbot, task, Posture.of(youbot))))
    assert _settings("tsm", youbot, "paper")["a"] > 1e-3 * least


def _inertias(robot):
    """lambda_max(M) at every sampled state."""
    rest = np.zeros(robot.nz)
    for _, q in sampled_states(robot, mm.make_task("circle", robot)):
        yield np.linalg.eigvalsh(robot.dynamics(q, rest).M)[-1]


@pytest.mark.parametrize("law", ["tsm", "tsm-simplified"])
def test_A_bounds_the_actuation(law, robot):
    """0 < A <= lambda_min(B B^T) (54); B of a differential drive does not depend on q.

    It is smaller still where w_7 = 6 does not bound the inertia as (53) asks: C/A makes up for it.
    """
    b = robot.dynamics(robot.q_rest, np.zeros(robot.nz)).B
    exact = np.linalg.eigvalsh(b @ b.T)[0]
    covering = min(1.0, 6.0 / max(_inertias(robot)))
    found = _settings(law, robot, "circle")["A"]
    assert 0.01 * covering * exact < found <= covering * exact


def test_A_of_the_inverse_law_bounds_the_inertia(robot):
    """0 < A' <= lambda_min(M^-1) (64)."""
    found = _settings("tsm-inverse-actuation", robot, "circle")["A"]
    least = 1.0 / max(_inertias(robot))
    assert 0.01 * least < found <= least


def test_auto_is_reported_as_asked_for_until_it_is_known(youbot):
    controller = mm.make_controller("tsm")
    assert controller.settings()["a"] == controller.settings()["A"] == "auto"
    controller.reset(youbot, mm.make_task("paper", youbot), 1e-3)
    assert all(isinstance(controller.settings()[name], float) for name in ("a", "A"))


def test_given_bounds_are_kept(youbot):
    settings = _settings("tsm", youbot, "paper", a=0.2, A=0.3)
    assert (settings["a"], settings["A"]) == (0.2, 0.3)


def test_auto_is_the_same_every_time(youbot):
    assert _settings("tsm", youbot, "paper") == _settings("tsm", youbot, "paper")


def test_bound_follows_the_robot_when_the_controller_is_used_again(youbot, tiago):
    controller = mm.make_controller("tsm")
    found = []
    for robot in (youbot, tiago, youbot):
        controller.reset(robot, mm.make_task("circle", robot), 1e-3)
        found.append(controller.settings()["a"])
    assert found[0] == found[2] != found[1]


def test_samples_of_a_fixed_arm_are_near_rest(fixed_robot):
    task = mm.make_task("circle", fixed_robot)
    for _, q in sampled_states(fixed_robot, task):
        assert np.all(q >= fixed_robot.model.lowerPositionLimit)
        assert np.all(q <= fixed_robot.model.upperPositionLimit)
        assert np.abs(q - fixed_robot.q_rest).max() <= 0.5


def test_samples_are_where_the_task_leads(driving_robot):
    """Within the limits, any heading, and the tip above the desired point."""
    robot = driving_robot
    task = mm.make_task("circle", robot)
    heading = robot.joint_names.index("base_theta")
    headings = []
    for t, q in sampled_states(robot, task):
        assert np.all(q >= robot.model.lowerPositionLimit)
        assert np.all(q <= robot.model.upperPositionLimit)
        assert np.allclose(robot.tip_pose(q).translation[:2], task.desired(t)[0][:2], atol=1e-9)
        headings.append(q[heading])
    assert np.ptp(headings) > 5.0
