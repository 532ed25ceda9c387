"""Torques that act late: borne by default, and predicted where the delay is told."""

from __future__ import annotations

import numpy as np
import pytest
from support.errors import largest_after
from support.settings import true_robot

import mobman as mm
from mobman.controllers.motors import (
    automatic_metric_scale,
    largest_eigenvalue,
    predict_acceleration,
)
from mobman.errors import GainError

DT = 1e-3


def _late(ticks, **scenario):
    late = [{"type": "delay", "delay": ticks * DT}]
    return mm.Scenario(name="late", actuation=late, **scenario)


def _run(robot, scenario, duration=5.0, task="circle", **gains):
    law = mm.make_controller("tsm", **gains)
    return mm.simulate(robot, law, task, duration=duration, scenario=scenario)


@pytest.mark.parametrize("delay", range(5))
def test_border_of_stability_is_where_a_root_leaves_the_unit_circle(delay):
    """x^(d+1) - x^d + gamma, by its roots."""

    def radius(gamma):
        polynomial = np.zeros(delay + 2)
        polynomial[:2], polynomial[-1] = (1.0, -1.0), polynomial[-1] + gamma
        if delay == 0:
            polynomial = np.array([1.0, gamma - 1.0])
        return np.abs(np.roots(polynomial)).max()

    border = largest_eigenvalue(delay)
    assert radius(0.999 * border) < 1.0 < radius(1.001 * border)
    assert radius(border) == pytest.approx(1.0, abs=1e-9)


def test_automatic_scale_of_the_metric():
    assert automatic_metric_scale(None, 1.0) == pytest.approx(0.8)
    assert automatic_metric_scale(None, 0.6) == pytest.approx(0.48)
    # told, and predicted: nothing is left for a delay
    assert automatic_metric_scale(0, 1.0) == automatic_metric_scale(2, 1.0) == 1.0
    for told, scale in ((None, 0.8), (1, 1.0)):
        law = mm.make_controller("tsm", delay_ticks=told)
        robot = mm.load_robot("youbot")
        law.reset(robot, mm.make_task("circle", robot), DT)
        assert law.settings()["metric_scale"] == pytest.approx(scale)


def test_no_plant_is_faster_than_its_lightest_scale(robot):
    """The largest eigenvalue of M_t^-1 M is 1/lightest: none exceeds 1 in `heavier`, on any robot."""
    random = np.random.default_rng(3)
    q = robot.q_rest + random.uniform(-0.3, 0.3, robot.nq)
    M = robot.dynamics(q, np.zeros(robot.nz)).M
    for factor, payload, bound in ((1.3, 1.0, 1.0), (0.6, 0.0, 1 / 0.6), (0.6, 1.0, 1 / 0.6)):
        true = true_robot(robot, factor, payload=payload).dynamics(q, np.zeros(robot.nz)).M
        largest = np.linalg.eigvals(np.linalg.solve(true, M)).real.max()
        assert largest <= bound * (1 + 1e-9)


def test_prediction_adds_what_is_under_way():
    """z' under v_{k-1-d} becomes z' under v_{k-1}."""
    random = np.random.default_rng(0)
    root = random.normal(size=(3, 3))
    M, B = root @ root.T + np.eye(3), random.normal(size=(3, 3))
    torques, bias = random.normal(size=(9, 3)), random.normal(size=3)
    late, (change, force), work = np.zeros((3, 3)), np.zeros((2, 3)), np.zeros((3, 3))
    for k, v in enumerate(torques):
        acting = torques[k - 2] if k >= 2 else np.zeros(3)
        z_dot = np.linalg.solve(M, B @ acting - bias)
        assert predict_acceleration(late, v, M, B, z_dot, change, force, work) == 0
        assert np.allclose(z_dot, np.linalg.solve(M, B @ v - bias))


@pytest.mark.parametrize("scenario", [{}, {"mass_factor": 1.3, "payload": 1.0}])
def test_one_tick_is_borne_by_default(scenario):
    record = _run("tiago_no_hand", _late(1, **scenario))
    assert record.status == "ok"
    assert largest_after(record, 4.5) < 1e-6


def test_whole_inertia_in_the_metric_bears_no_delay():
    """gamma = 1 is the border of one tick."""
    record = _run("tiago_no_hand", _late(1), metric_scale=1.0)
    assert not record.ok or largest_after(record, 4.5) > 1e-4


def test_two_ticks_are_borne_where_they_are_told():
    record = _run("youbot", _late(2), delay_ticks=2)
    assert record.status == "ok"
    assert largest_after(record, 4.5) < 1e-6


def test_delay_that_is_not_there_costs_the_prediction_nothing():
    """Told none is the paper's law, to the last bit."""
    told, paper = (
        _run("youbot", None, 0.3, delay_ticks=0),
        _run("youbot", None, 0.3, metric_scale=1.0),
    )
    assert np.array_equal(told.torque, paper.torque)


@pytest.mark.parametrize("ticks", [-1, 1.5, True, "2", 101])
def test_delay_is_a_whole_number_of_ticks(ticks):
    with pytest.raises(GainError, match=r"delay_ticks = .*: must be a whole number of ticks"):
        mm.make_controller("tsm", delay_ticks=ticks)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", [{}, {"mass_factor": 1.3, "payload": 1.0}])
def test_no_robot_diverges_with_a_tick_of_delay(robot, scenario):
    assert _run(robot, _late(1, **scenario), duration=10.0).status == "ok"
