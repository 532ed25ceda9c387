"""Random placements, and that trouble is foreseen."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.errors import UsageError
from mobman.tasks.circle import circle_near_tip
from mobman.tasks.placements import foresee, placement


def test_the_same_for_the_same_index_and_seed(tiago):
    q0, circle = placement(tiago, 3, seed=1)
    again, same = placement(tiago, 3, seed=1)
    assert np.array_equal(q0, again)
    assert circle == same
    assert placement(tiago, 4, seed=1)[1] != circle != placement(tiago, 3, seed=2)[1]


def test_it_starts_near_the_path_within_the_limits(robot):
    if (
        robot.spec.platform.type == "swerve"
    ):  # which the arm's yaw steers through an indefinite criterion
        with pytest.raises(UsageError, match="none of 50 random circles"):
            placement(robot, 0)
        return
    q0, circle = placement(robot, 0)
    assert np.all(robot.model.lowerPositionLimit <= q0)
    assert np.all(q0 <= robot.model.upperPositionLimit)
    away = np.linalg.norm(robot.tip_pose(q0).translation - circle.desired(0.0)[0])
    assert away <= 0.2 + 1e-9


def test_the_solution_that_is_foreseen_is_on_the_path_with_the_arm_at_rest():
    robot = mm.load_robot("jackal_ur3")
    task = mm.make_task("circle", robot)
    ahead = foresee(robot, task, robot.q_rest, 10.0)
    assert ahead.until == 10.0
    assert np.linalg.norm(robot.tip_pose(ahead.q).translation - task.desired(10.0)[0]) < 1e-3
    assert np.abs(ahead.q - robot.q_rest)[robot.arm_index].max() < 1e-3
    assert ahead.definite == pytest.approx(1.0, abs=1e-3)


def test_a_fold_is_foreseen():
    """With the paper's weights the wheels' angles drag the arm along until it folds."""
    robot = mm.load_robot("tiago_dual")
    task = mm.make_task("circle", robot)
    assert foresee(robot, task, robot.q_rest, 80.0, step=0.1).kinematic > 0.9
    for i, name in enumerate(robot.joint_names):
        robot.criterion_weights[i] = 0.001 if name.startswith("base_") else 0.05
    assert foresee(robot, task, robot.q_rest, 80.0, step=0.1).kinematic < 0.1


def test_a_car_gets_no_circle_beside_it():
    robot = mm.load_robot("hunter_ur10")
    x, y, z = robot.tip_pose(robot.q_rest).translation
    beside = type(circle_near_tip(robot, robot.q_rest))((x, y + 2.5, z), 0.5, 0.5)
    assert foresee(robot, beside, robot.q_rest, 30.0).kinematic < 0.25
    for index in range(3):
        q0, circle = placement(robot, index)
        assert foresee(robot, circle, q0, 60.0, step=0.1).kinematic > 0.25


@pytest.mark.slow
@pytest.mark.parametrize("law", ["tsm", "tsm-null-space"])
def test_placements_hold_for_two_minutes(robot, law):
    q0, circle = placement(robot, 0)
    record = mm.simulate(robot, law, circle, q0=q0, duration=120.0)
    assert record.status == "ok", record.message
    assert np.linalg.norm(record.task_error[-1]) < 1e-6
