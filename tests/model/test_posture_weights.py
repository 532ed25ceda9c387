"""The rule for the platform's weights: what it is derived from, and what is shipped."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

import mobman as mm
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.metric import base_metric, conditioning, heading_weight, reduced_stiffness
from mobman.model.task_map import TaskMap
from mobman.robots.spec import DRIVEN


def heading_of(robot):
    return robot.joint_names.index("base_theta")


def test_robots_that_come_with_mobman_follow_the_rule(driving_robot):
    names = {"base_x", "base_y", *(wheel.joint for wheel in driving_robot.platform.wheels)}
    own = dict(
        zip(driving_robot.joint_names, driving_robot.criterion_weights.tolist(), strict=True)
    )
    assert {own[name] for name in names} == {DRIVEN}
    assert own["base_theta"] == heading_weight(driving_robot)


def test_the_heading_is_held_where_that_gains_conditioning(driving_robot):
    heading, weights = heading_of(driving_robot), driving_robot.criterion_weights.copy()
    weights[heading] = DRIVEN
    without = conditioning(driving_robot, weights)
    weights[heading] = 2e-3
    held = driving_robot.criterion_weights[heading] > DRIVEN
    assert (without < 0.5 * conditioning(driving_robot, weights)) == held
    if driving_robot.spec.platform.type in ("omnidirectional", "planar", "turret"):
        assert held
        assert without < 1e-2 * conditioning(driving_robot, weights)  # it can turn under its tip


def least(robot, weight):
    """lambda_min(J J^T) at rest with such a weight of the heading."""
    weights = robot.criterion_weights.copy()
    weights[heading_of(robot)] = weight
    now = extended_kinematics(
        robot, TaskMap(), Posture(weights, robot.q_rest), robot.q_rest, np.zeros(robot.nz)
    )
    return np.linalg.svd(now.J, compute_uv=False)[-1] ** 2


def test_a_light_heading_makes_the_extended_jacobian_small(driving_robot):
    weight = driving_robot.criterion_weights[heading_of(driving_robot)]
    if weight <= DRIVEN:
        return
    assert weight == np.median(driving_robot.criterion_weights[driving_robot.arm_index])
    small, smaller = least(driving_robot, 0.1 * weight), least(driving_robot, 0.01 * weight)
    assert 50.0 < small / smaller < 200.0  # the square of the weight
    assert least(driving_robot, weight) > 10.0 * small


def test_reduced_stiffness_is_that_of_the_extended_jacobian(driving_robot):
    """J_a w = N (H + D) C w for w in the kernel of j_e; at rest C w = N^T (N C w), and D = 0."""
    criterion = Posture(driving_robot.criterion_weights, driving_robot.q_rest)
    none = np.zeros(driving_robot.nz)
    now = extended_kinematics(driving_robot, TaskMap(), criterion, driving_robot.q_rest, none)
    root = np.sqrt(base_metric(driving_robot))
    free = root[:, None] * null_space(now.J[:3] * root)
    C = driving_robot.velocity_map(driving_robot.q_rest)
    by_jacobian = (now.complement @ C @ free).T @ now.J[3:] @ free
    found = reduced_stiffness(driving_robot, np.diag(driving_robot.criterion_weights))
    assert np.allclose(np.linalg.eigvalsh(by_jacobian), np.linalg.eigvalsh(found), atol=1e-12)


def test_where_a_description_says_nothing_the_rule_does():
    fields = mm.load_robot("ridgeback_panda").spec.model_dump(by_alias=True, exclude={"file"})
    fields["folder"] = mm.load_robot("ridgeback_panda").spec.folder
    for criterion, expected in (
        ({}, mm.load_robot("ridgeback_panda").criterion_weights),
        ({"platform": 0.001}, None),  # which was the heading's weight, too
        ({"weights": {"base_theta": 0.02}}, None),
    ):
        robot = mm.load_robot({**fields, "criterion": criterion})
        if expected is not None:
            assert np.array_equal(robot.criterion_weights, expected)
        else:
            weight = 0.001 if "platform" in criterion else 0.02
            assert robot.criterion_weights[heading_of(robot)] == weight


@pytest.mark.parametrize("name", ["jackal_ur3", "ridgeback_panda"])
def test_the_arm_comes_to_rest(name):
    """The platform alone takes the tip round: F is nearly 0; with the paper's weights it grows."""
    robot = mm.load_robot(name)
    papers = np.where(np.isin(np.arange(robot.nq), robot.arm_index), 0.05, 0.001)
    deviations = []
    for K_F in (None, papers.tolist()):
        law = mm.make_controller("tsm", K_F=K_F)
        record = mm.simulate(robot, law, "circle", duration=15.0, dt=4e-3)
        deviations.append(np.abs(record.q - robot.q_rest)[-1, robot.arm_index].max())
    assert deviations[0] < 1e-3
    assert deviations[1] > 1e-2


@pytest.mark.slow
def test_runs_of_two_minutes(robot):
    record = mm.simulate(robot, "tsm", "circle", duration=120.0)
    assert record.status == "ok", record.message
    assert np.linalg.norm(record.task_error[-1]) < 1e-8
