"""Each metric on runs whose answer is known."""

from __future__ import annotations

import math
from copy import copy

import numpy as np
import pytest
from support.runs import Still, Torque, hand_made_run
from support.settings import true_robot

import mobman as mm
from mobman.model.criterion import Posture
from mobman.simulation.metrics import compute_metrics, list_metrics, metrics


def _value(name, run):
    return metrics.get(name).function(run)


def _task_error(run, size):
    """Errors of that size as a function of time, in a direction that turns."""
    t = run.t
    direction = np.stack((np.cos(t), np.sin(t), np.zeros_like(t)), axis=1)
    return size(t)[:, None] * direction


def _with_error(robot, size, **changes):
    run = hand_made_run(robot, **changes)
    return hand_made_run(robot, task_error=_task_error(run, size), **changes)


@pytest.mark.parametrize(("threshold", "exponent"), [("1e-2", -2), ("1e-4", -4), ("1e-6", -6)])
def test_settling_time_is_when_the_error_stays_below_for_good(youbot, threshold, exponent):
    """|e| = 10^(-t) crosses 10^-p at t = p; an excursion at 8 s puts it off."""
    falling = _with_error(youbot, lambda t: 10.0**-t)
    name = f"settling_time_{threshold}"
    assert np.isclose(_value(name, falling), -exponent, atol=0.011)
    excursion = _with_error(youbot, lambda t: np.where(np.abs(t - 8.0) < 1e-6, 1.0, 10.0**-t))
    assert np.isclose(_value(name, excursion), 8.01)


def test_settling_time_of_runs_that_do_not_settle(youbot):
    assert math.isinf(_value("settling_time_1e-4", _with_error(youbot, lambda t: 1e-3 + 0 * t)))
    assert _value("settling_time_1e-4", hand_made_run(youbot)) == 0.0
    late = _with_error(youbot, lambda t: np.where(t > 9.995, 1.0, 0.0))
    assert math.isinf(_value("settling_time_1e-4", late))


def test_settling_time_counts_what_is_not_a_number_as_not_settled(youbot):
    run = _with_error(youbot, lambda t: np.where(np.abs(t - 5.0) < 1e-6, np.nan, 0.0))
    assert np.isclose(_value("settling_time_1e-4", run), 5.01)


def test_success_is_settling_below_a_tenth_of_a_millimetre(youbot):
    assert _value("success", _with_error(youbot, lambda t: 0.9e-4 + 0 * t)) == 1.0
    assert _value("success", _with_error(youbot, lambda t: 1.1e-4 + 0 * t)) == 0.0
    assert _value("success", hand_made_run(youbot, completed=False)) == 0.0


def test_errors_are_judged_in_the_last_three_tenths(youbot):
    """|e| = 1 until 6.99 s, then 2, 3 at the end."""

    def size(t):
        return np.where(t < 6.995, 100.0, np.where(t > 9.995, 3.0, 2.0))

    run = _with_error(youbot, size)
    assert np.isclose(_value("task_error_max", run), 3.0)
    assert np.isclose(_value("task_error_final", run), 3.0)
    assert np.isclose(_value("task_error_rms", run), math.sqrt((300 * 4.0 + 9.0) / 301))


def test_auxiliary_error(youbot):
    run = hand_made_run(youbot)
    error = np.zeros_like(run.auxiliary_error)
    error[run.t < 6.0] = 50.0
    error[-1] = (3.0, 4.0)
    assert np.isclose(
        _value("auxiliary_error_max", hand_made_run(youbot, auxiliary_error=error)), 5.0
    )


def test_criterion_at_the_end(youbot):
    q = np.tile(youbot.q_rest, (1001, 1))
    q[-1, youbot.joint_names.index("y_2")] += 2.0  # weight 0.05: F = 0.05 * 4 / 2
    assert np.isclose(_value("criterion_final", hand_made_run(youbot, q=q)), 0.1)


def test_least_eigenvalue(youbot):
    """0.0023 at the start with the paper's K_F; the least counts, wherever it is."""
    weights = np.array([0.001, 0.001, 0.001, 0.05, 0.05, 0.0001, 0.05, 0.05])
    paper = {"criterion": Posture(weights, youbot.q_rest)}
    assert np.isclose(_value("lambda_min", hand_made_run(youbot, **paper)), 0.0023, atol=5e-5)
    q = np.tile(youbot.q_rest, (1001, 1))
    q[:500, youbot.joint_names.index("y_2")] += 0.5
    assert _value("lambda_min", hand_made_run(youbot, q=q, **paper)) <= 0.00235
    upright = np.tile(youbot.q_rest, (1001, 1))
    upright[300:, 6:] = (-np.pi / 2, 0.0)
    assert _value("lambda_min", hand_made_run(youbot, q=upright, **paper)) < 1e-20


@pytest.mark.parametrize("period", [4.0, 3.7183])
def test_repeatability_is_what_the_arm_drifts_in_a_period(youbot, period):
    """Also if the period is no whole number of ticks."""
    run = hand_made_run(youbot)
    drift = np.array([0.1, -0.2, 0.05])
    q = run.q.copy()
    q[:, youbot.arm_index] += run.t[:, None] * drift
    q[:, :5] += 7.0 * run.t[:, None]  # the platform may go where it likes
    found = _value("repeatability", hand_made_run(youbot, q=q, task=Still(np.zeros(3), period)))
    assert np.isclose(found, period * np.linalg.norm(drift))


def test_repeatability_of_a_posture_that_comes_back(youbot):
    run = hand_made_run(youbot)
    q = run.q.copy()
    q[:, youbot.arm_index] += np.sin(2 * np.pi * run.t / 2.5)[:, None]
    found = _value("repeatability", hand_made_run(youbot, q=q, task=Still(np.zeros(3), 2.5)))
    assert found < 1e-12


def test_repeatability_has_no_meaning_for_open_paths_and_short_runs(youbot):
    assert math.isnan(_value("repeatability", hand_made_run(youbot)))
    assert math.isnan(_value("repeatability", hand_made_run(youbot, task=Still(np.zeros(3), 10.5))))


def test_torque_energy_is_the_integral_of_the_held_torque(youbot):
    torque = np.zeros((1001, 5))
    torque[:, 0], torque[:, 1] = 3.0, 4.0
    torque[-1] = 1e6  # computed at the last tick, but never applied
    assert np.isclose(_value("torque_energy", hand_made_run(youbot, torque=torque)), 250.0)


def test_torque_peak(youbot):
    torque = np.zeros((1001, 5))
    torque[3, 2], torque[5, 4] = 6.0, -7.0
    assert _value("torque_peak", hand_made_run(youbot, torque=torque)) == 7.0


def test_torque_variation(youbot):
    """Ten zigzags of 0.5 up and down on one motor, a ramp of 3 on another: 10 + 3."""
    torque = np.zeros((1001, 5))
    torque[100:120:2, 1] = 0.5
    torque[:, 3] = np.linspace(0.0, -3.0, 1001)
    assert np.isclose(_value("torque_variation", hand_made_run(youbot, torque=torque)), 13.0)


def test_variation_of_the_torque_rate(youbot):
    """A ramp that begins and ends within the run: its rate goes 0, 2, 0."""
    run = hand_made_run(youbot)
    torque = np.zeros((1001, 5))
    torque[:, 2] = 2.0 * np.clip(run.t - 3.0, 0.0, 4.0)
    assert np.isclose(_value("torque_rate_variation", hand_made_run(youbot, torque=torque)), 4.0)


def test_torque_step_is_judged_after_the_first_second(youbot):
    torque = np.zeros((1001, 5))
    torque[50:] = 10.0  # at 0.5 s
    torque[300:, 1] = 9.5
    assert np.isclose(_value("torque_step", hand_made_run(youbot, torque=torque)), 0.05)
    assert _value("torque_step", hand_made_run(youbot)) == 0.0


def test_constraint_residual_is_that_of_the_true_robot(youbot):
    """The largest of the run, and |A x'| of the plant where that is not 0."""

    def constraints(parameters, x, A, A_x):
        A[:], A_x[:] = 0.0, 0.0
        A[0, 3], A[1, 4] = 1.0, 2.0  # no wheel turns

    plant = true_robot(youbot, 2.0)
    plant.platform = copy(youbot.platform)
    plant.platform.equations = youbot.platform.equations._replace(constraints=constraints)
    push = np.array([4.0, -6.0, 0.0, 0.0, 0.0])
    controller = Torque(lambda t: push if t < 0.015 else -push)
    found = mm.simulate(youbot, controller, "circle", duration=0.03, plant=plant)
    turning = np.abs(found.z[:, :2] * youbot.platform.kappa) @ np.diag([1.0, 2.0])
    assert np.isclose(found.metrics["constraint_residual"], turning.max())
    assert turning[-1].max() < 0.9 * turning.max()
    right = mm.simulate(youbot, controller, "circle", duration=0.03)
    assert 0.0 < right.metrics["constraint_residual"] < 1e-12
    assert _value("constraint_residual", hand_made_run(youbot, constraint_residual=0.4)) == 0.4


def test_energy_residual_compares_what_was_gained_with_what_was_done(youbot):
    z = np.zeros((1001, 5))
    z[-1] = 1.0
    gained = youbot.energy(youbot.q_rest, z[-1]) - youbot.energy(youbot.q_rest, z[0])
    assert gained > 1.0
    exact = hand_made_run(youbot, z=z, work=gained)
    assert _value("energy_residual", exact) < 1e-12
    off = hand_made_run(youbot, z=z, work=0.9 * gained)
    assert np.isclose(_value("energy_residual", off), 0.1)
    assert np.isclose(_value("energy_residual", hand_made_run(youbot, work=0.01)), 0.01)


def test_compute_time(youbot):
    times = np.linspace(0.0, 1.0, 1001)
    run = hand_made_run(youbot, compute_time=times)
    assert np.isclose(_value("compute_time_median", run), 0.5)
    assert np.isclose(_value("compute_time_p99", run), 0.99)


INF = {
    "auxiliary_error_max", "criterion_final", "settling_time_1e-2", "settling_time_1e-4",
    "settling_time_1e-6", "task_error_max", "task_error_rms", "task_error_final",
}  # fmt: skip
NAN = {"energy_residual", "repeatability"}


def test_run_that_ended_early_is_no_good_one(youbot):
    """Two samples of ten seconds: what cannot be said is infinite or no number, never small."""
    short = {
        name: getattr(hand_made_run(youbot), name)[:2]
        for name in ("t", "q", "z", "torque", "task_error", "auxiliary_error", "compute_time")
    }
    task = Still(np.zeros(3), 4.0)
    found = compute_metrics(hand_made_run(youbot, completed=False, task=task, **short))
    assert {name for name, value in found.items() if math.isinf(value)} == INF
    assert {name for name, value in found.items() if math.isnan(value)} == NAN
    assert found["success"] == 0.0


def test_every_metric_says_what_it_is():
    assert len(list_metrics()) >= 18
    for item in list_metrics():
        assert item.unit
        assert item.description
        assert item.better in ("lower", "higher", "")


def test_all_metrics_are_computed(youbot):
    run = hand_made_run(youbot)
    found = compute_metrics(run)
    applying = [item.name for item in list_metrics() if item.applies is None or item.applies(run)]
    assert list(found) == applying
    # a task of the tip's position on the ideal plant, not monitored, leaves out what is of orientation,
    # the ground and the theorems, and nothing else
    others = {
        item.name
        for item in list_metrics()
        if item.section in ("ground", "theorems") or item.name.startswith("orientation_")
    }
    assert {item.name for item in list_metrics()} - set(found) == others
    assert all(isinstance(value, float) for value in found.values())


def test_saturation(youbot):
    limited = np.zeros(1001, dtype=bool)
    limited[200:300] = True
    run = hand_made_run(youbot, limited=limited)
    assert np.isclose(_value("saturation_share", run), 100 / 1001)
    assert np.isclose(_value("saturation_start", run), 2.0)
    run = hand_made_run(youbot)
    assert (_value("saturation_share", run), _value("saturation_start", run)) == (0.0, 10.0)
