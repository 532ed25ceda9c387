"""The task map and its second derivatives, which come from the Jacobian's columns alone."""

from __future__ import annotations

import numpy as np
import pytest
from support.differences import derivative, jacobian, relative
from support.states import random_states

from mobman.errors import UsageError
from mobman.model.task_map import TaskMap, task_map_for


@pytest.fixture(params=[(0, 1, 2), (0, 1)], ids=["position", "planar"])
def task_map(request):
    return TaskMap(request.param)


def _gradient(robot, task_map, q, multiplier):
    """(df_e/dq)^T lam."""
    return robot.tip_jacobian(q)[list(task_map.rows)].T @ multiplier


def test_map_selects_components_of_the_tip(robot, task_map):
    rows = list(task_map.rows)
    for q, z in random_states(robot, 5):
        tip = robot.tip_kinematics(q, z)
        assert np.array_equal(task_map.position(tip), tip.position[rows])
        assert np.array_equal(task_map.jacobian(tip), tip.jacobian[rows])
        assert np.array_equal(task_map.jacobian_rate(tip), tip.jacobian_rate[rows])
    assert task_map.m == len(rows)


def test_hessian(robot, task_map):
    random = np.random.default_rng(10)
    for q, z in random_states(robot, 20):
        multiplier = random.standard_normal(task_map.m)
        expected = jacobian(lambda p, lam=multiplier: _gradient(robot, task_map, p, lam), q)
        found = task_map.hessian(robot.tip_kinematics(q, z), multiplier)
        assert relative(found, expected) < 1e-6
        assert np.array_equal(found, found.T)


def test_rate_of_the_hessian(robot, task_map):
    random = np.random.default_rng(11)
    for q, z in random_states(robot, 50):
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


@pytest.mark.parametrize("dimension", [0, 1, 4, 6])
def test_other_dimensions_are_refused(dimension):
    with pytest.raises(UsageError, match=f"{dimension} components; allowed: 3 .* 2 "):
        task_map_for(dimension)
