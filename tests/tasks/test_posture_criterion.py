"""The posture criterion (12)."""

from __future__ import annotations

import numpy as np
import pytest
from support.differences import derivative, jacobian
from support.states import random_states

from mobman.errors import UsageError
from mobman.model.criterion import Posture


def test_value_is_equation_12():
    criterion = Posture(np.array([2.0, 3.0]), np.array([1.0, -1.0]), 0.5)
    # c_F/2 (2 (3 - 1)^2 + 3 (0 + 1)^2)
    assert np.isclose(criterion.value(np.array([3.0, 0.0])), 0.25 * (8.0 + 3.0))


def test_derivatives(robot):
    criterion = Posture.of(robot, 1.7)
    for q, z in random_states(robot, 5):
        q_dot = robot.velocity_map(q) @ z
        gradient = jacobian(lambda p: np.array([criterion.value(p)]), q)[0]
        assert np.allclose(criterion.gradient(q), gradient, atol=1e-9)
        assert np.allclose(criterion.hessian(q), jacobian(criterion.gradient, q), atol=1e-9)
        rate = derivative(lambda s, q=q, d=q_dot: criterion.hessian(q + s * d))
        assert np.allclose(criterion.hessian_rate(q, q_dot), rate, atol=1e-9)


def test_criterion_of_a_robot_has_its_weights_and_rest(robot):
    criterion = Posture.of(robot)
    expected = np.diag(robot.criterion_weights) + robot.criterion_couplings
    assert np.array_equal(criterion.hessian(robot.q_rest), expected)
    assert criterion.value(robot.q_rest) == 0.0


@pytest.mark.parametrize(
    ("weights", "scale"),
    [([1.0, 0.0], 1.0), ([1.0, -1.0], 1.0), ([1.0, np.nan], 1.0), ([1.0, 1.0], 0.0)],
)
def test_weights_must_be_positive(weights, scale):
    with pytest.raises(UsageError, match="above 0"):
        Posture(np.array(weights), np.zeros(2), scale)


def test_weights_must_be_as_many_as_coordinates():
    with pytest.raises(UsageError, match="3 weights, the rest posture 2 coordinates"):
        Posture(np.ones(3), np.zeros(2))
