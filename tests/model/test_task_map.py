"""The task map and its second derivatives, which come from the Jacobian's columns alone."""

from __future__ import annotations

import numpy as np
import pytest
from support.differences import derivative, jacobian, relative
from support.states import random_states

from mobman.errors import UsageError
from mobman.model.task_map import TaskMap, task_map_for

ALL = {
    "position": TaskMap(),
    "planar": TaskMap((0, 1)),
    "pose": TaskMap((0, 1, 2, 3, 4, 5)),
    "pointing": TaskMap(axis=(0.6, 0.0, -0.8)),
}


@pytest.fixture(params=ALL)
def task_map(request):
    return ALL[request.param]


def _gradient(robot, task_map, q, multiplier):
    """J_f^T lam."""
    return task_map.jacobian(robot.tip_kinematics(q, np.zeros(robot.nz))).T @ multiplier


def test_map_selects_components_of_the_tip(robot, task_map):
    rows = list(task_map.rows)
    for q, z in random_states(robot, 5):
        tip = robot.tip_kinematics(q, z)
        assert np.array_equal(task_map.position(tip), tip.position[rows[:3]])
        assert np.array_equal(task_map.jacobian(tip)[: len(rows)], tip.jacobian[rows])
        assert np.array_equal(task_map.jacobian_rate(tip)[: len(rows)], tip.jacobian_rate[rows])
    assert task_map.m == len(task_map.jacobian(tip))


def test_pointing_rows_are_the_angular_velocity_across_the_axis(robot):
    task_map = ALL["pointing"]
    for q, z in random_states(robot, 5):
        tip = robot.tip_kinematics(q, z)
        axis = tip.rotation @ task_map.axis
        across = tip.jacobian[3:] - np.outer(axis, axis @ tip.jacobian[3:])
        rows = task_map.jacobian(tip)[3:]
        assert np.allclose(rows.T @ rows, across.T @ across, atol=1e-12)


@pytest.mark.parametrize("kind", ["pose", "pointing"])
def test_rates_of_the_orientation_rows(robot, kind):
    task_map = ALL[kind]
    for q, z in random_states(robot, 5):
        q_dot = robot.velocity_map(q) @ z
        expected = derivative(
            lambda s, q=q, z=z, d=q_dot: task_map.jacobian(robot.tip_kinematics(q + s * d, z))
        )
        assert relative(task_map.jacobian_rate(robot.tip_kinematics(q, z)), expected) < 1e-8


def test_hessian(robot, task_map):
    random = np.random.default_rng(10)
    for q, z in random_states(robot, 8):
        multiplier = random.standard_normal(task_map.m)
        expected = jacobian(lambda p, lam=multiplier: _gradient(robot, task_map, p, lam), q)
        found = task_map.hessian(robot.tip_kinematics(q, z), multiplier)
        assert relative(found, expected) < 1e-6
        # an angular velocity is no gradient
        assert np.array_equal(found, found.T) or task_map.m > 3


def test_rate_of_the_hessian(robot, task_map):
    random = np.random.default_rng(11)
    for q, z in random_states(robot, 20):
        multiplier = random.standard_normal(task_map.m)
        q_dot = robot.velocity_map(q) @ z
        expected = derivative(
            lambda s, q=q, z=z, d=q_dot, lam=multiplier: task_map.hessian(
                robot.tip_kinematics(q + s * d, z), lam
            )
        )
        found = task_map.hessian_rate(robot.tip_kinematics(q, z), multiplier)
        assert relative(found, expected) < 1e-6


def test_map_follows_from_the_task_dimension():
    assert task_map_for(3).rows == (0, 1, 2)
    assert task_map_for(2).rows == (0, 1)
    assert task_map_for(7, 6).rows == (0, 1, 2, 3, 4, 5)
    assert task_map_for(6).axis == (0.0, 0.0, 1.0)
    maps = [task_map_for(*sizes) for sizes in ((3,), (2,), (7, 6), (6,))]
    assert [(one.m, one.width) for one in maps] == [(3, 3), (2, 2), (6, 7), (5, 6)]


@pytest.mark.parametrize("sizes", [(0, 0), (1, 1), (4, 4), (7, 7), (3, 6)])
def test_other_dimensions_are_refused(sizes):
    found = f"{sizes[0]} components and its derivatives {sizes[1]}; allowed: 3 .* 2 .* 6 .* 7 "
    with pytest.raises(UsageError, match=found):
        task_map_for(*sizes)
