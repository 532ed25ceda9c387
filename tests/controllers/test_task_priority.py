"""Task priority: the order of the tasks, singularities, and the joints' limits."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.controllers.task_errors import TaskSpace
from mobman.model.joint_limits import LimitZones
from mobman.tasks.singular import stretched

DT = 1e-3


class Stay:
    """A point that the tip has to come to."""

    def __init__(self, point):
        self.point = point

    def desired(self, t):
        return self.point, np.zeros(3), np.zeros(3), np.zeros(3)


# a robot a platform type, and every width of a task
CASES = [
    ("youbot", "circle"),
    ("hunter_ur10", "circle"),
    ("ridgeback_panda", "pose-circle"),
    ("ranger_xarm7", "circle"),
    ("fixed_panda", "pointing-circle"),
    ("tiago", "pose-circle"),
]


def _acceleration(robot, task, q, z, **gains):
    """z' that the law gives the nominal robot."""
    law = mm.make_controller("task-priority", **gains)
    law.reset(robot, task, DT)
    M, bias, B = robot.dynamics(q, z)
    return np.linalg.solve(M, B @ law.step(0.0, q, z, np.zeros(robot.nz)) - bias)


@pytest.mark.parametrize(("name", "task"), CASES)
def test_secondary_task_never_moves_the_tip(name, task):
    robot, random = mm.load_robot(name), np.random.default_rng(1)
    task = mm.make_task(task, robot)
    space = TaskSpace(robot, task)
    for _ in range(5):
        q = robot.consistent(robot.q_rest + 0.2 * random.standard_normal(robot.nq))
        z = 0.3 * random.standard_normal(robot.nz)
        # every joint is in its zone, and the threshold so high that most inverses are damped
        first = {"zone": 0.5, "epsilon": 3.0, "k_d": 8.0, "k_0": 0.0, "k_l": 0.0}
        alone = _acceleration(robot, task, q, z, **first)
        both = _acceleration(robot, task, q, z, **first | {"k_0": 3.0, "k_l": 20.0})
        space.at(0.0, q, z)
        assert np.abs(both - alone).max() > 1e-3
        assert np.abs(space.J @ (both - alone)).max() < 1e-9


@pytest.mark.parametrize(("name", "task"), CASES)
def test_primary_task_is_exact_away_from_singularities(name, task):
    """J z' + J' z - p_d'' = -K_v e' - K_p e, and no damping."""
    robot, random = mm.load_robot(name), np.random.default_rng(2)
    task = mm.make_task(task, robot)
    space = TaskSpace(robot, task)
    q = robot.consistent(robot.q_rest + 0.05 * random.standard_normal(robot.nq))
    z = 0.2 * random.standard_normal(robot.nz)
    z_dot = _acceleration(robot, task, q, z, K_p=9.0, K_v=7.0)
    space.at(0.0, q, z)
    m = space.p
    e, e_dot = space.f - space.p_d[0, :m], space.J @ z - space.p_d[1, :m]
    e_dotdot = space.J @ z_dot + space.J_dot_z - space.p_d[2, :m]
    assert np.allclose(e_dotdot, -7.0 * e_dot - 9.0 * e, atol=1e-8)


def test_singularity_is_passed_with_bounded_speeds():
    """Where the tip is as high as it can be; a law with the exact inverse ends there."""
    name = "husky_ur5"
    exact = mm.simulate(name, "pseudo-inverse", "kinematic-singularity", duration=8.0)
    assert exact.status == "singular"
    assert np.abs(exact.z).max() > 100.0
    record = mm.simulate(name, "task-priority", "kinematic-singularity", duration=11.0)
    assert record.ok, record.message
    assert np.abs(record.z).max() < 5.0
    errors = np.linalg.norm(record.task_error, axis=1)
    assert errors.max() < 0.1
    assert errors[-1] < 1e-4


def test_rest_posture_may_be_singular():
    """The arm straight up: the threshold of the damping is of postures around it."""
    robot = mm.load_robot("husky_ur5")
    robot.q_rest[:] = stretched(robot, robot.q_rest, np.array([0.0, 0.0, 1.0]), within_limits=False)
    J = robot.tip_jacobian(robot.q_rest)[:3] @ robot.velocity_map(robot.q_rest)
    assert np.linalg.svd(J, compute_uv=False)[-1] < 1e-6
    point = np.array(robot.tip_pose(robot.q_rest).translation) + np.array([0.05, 0.0, -0.1])
    exact = mm.simulate(robot, "pseudo-inverse", Stay(point), duration=3.0)
    assert exact.status == "singular"
    record = mm.simulate(robot, "task-priority", Stay(point), duration=3.0)
    assert record.ok
    assert np.abs(record.z).max() < 20.0
    assert record.metrics["task_error_final"] < 1e-4


def test_joint_leaves_its_limit_while_the_tip_is_on_its_task():
    robot = mm.load_robot("ridgeback_panda")
    q0, joint = robot.q_rest.copy(), robot.joint_names.index("panda_joint1")
    q0[joint] = robot.limits.upper[joint] - 0.05
    depths, errors = {}, {}
    for k_l in (0.0, 5.0):
        law = mm.make_controller("task-priority", k_l=k_l, k_0=0.0)
        record = mm.simulate(robot, law, "circle", duration=1.5, q0=q0)
        assert record.ok
        zones = LimitZones(robot, law.gains.zone)
        depths[k_l] = [np.linalg.norm(zones.depth(q)) for q in record.q[[0, -1]]]
        errors[k_l] = np.abs(record.task_error).max(axis=1)
    assert depths[0.0][0] == depths[5.0][0] > 0.4
    assert depths[5.0][1] < 0.05 * depths[5.0][0]
    assert depths[0.0][1] > 0.5 * depths[0.0][0]
    assert np.abs(errors[5.0] - errors[0.0]).max() < 1e-3
