"""The criterion that repels from the arm's singularities: its derivatives, and what it does to runs."""

from __future__ import annotations

import numpy as np
import pytest
from support.differences import derivative, jacobian, relative

import mobman as mm
from mobman.errors import UsageError
from mobman.model.criterion import criteria

WEIGHT = 0.5


def term_of(robot):
    return criteria.get("manipulability")(weight=WEIGHT).on(robot)


def test_its_value_is_that_of_pinocchios_jacobian_and_its_derivatives_those_of_its_value(robot):
    term, random = term_of(robot), np.random.default_rng(1)
    q = robot.consistent(robot.q_rest + 0.2 * random.standard_normal(robot.nq))
    q_dot = random.standard_normal(robot.nq)
    J = robot.tip_jacobian(q)[:3] @ robot.velocity_map(q)[:, robot.nz - robot.n :]
    assert term.value(q) == pytest.approx(-0.5 * WEIGHT * np.log(np.linalg.det(J @ J.T)))
    h = 1e-3
    gradient = jacobian(lambda x: np.array([term.value(x)]), q, h)[0]
    assert relative(term.gradient(q), gradient) < 1e-9
    assert relative(term.hessian(q), jacobian(term.gradient, q, h)) < 1e-9
    rate = derivative(lambda s: term.hessian(q + s * q_dot), h)
    assert relative(term.hessian_rate(q, q_dot), rate) < 1e-9


@pytest.mark.parametrize("law", ["tsm", pytest.param("pseudo-inverse", marks=pytest.mark.slow)])
def test_the_arm_ends_farther_from_singularities(law):
    robot = mm.load_robot("locobot")
    measures = []
    for added in ((), [{"type": "manipulability", "weight": 0.01}]):
        record = mm.simulate(
            robot, mm.make_controller(law, criteria=added), "circle", duration=4.0, dt=4e-3
        )
        assert record.ok
        assert record.metrics["task_error_final"] < 1e-2
        measures.append(-term_of(robot).value(record.q[-1]) / WEIGHT)
    assert measures[1] > measures[0] + 0.02


def test_an_arm_that_is_singular_is_told():
    robot = mm.load_robot("youbot")
    robot.q_rest[robot.arm_index] = 0.0  # stretched straight up
    with pytest.raises(UsageError, match="the arm of 'youbot' alone does not move its tip"):
        term_of(robot)
