"""Plants that are not what the controllers suppose: masses, a payload, disturbance torques."""

from __future__ import annotations

import pytest
from support.errors import largest_after

import mobman as mm


def _tsm(scenario, **options):
    controller = mm.make_controller("tsm", a=0.2, A=0.2)
    return mm.simulate("youbot", controller, "paper", duration=10.0, scenario=scenario, **options)


@pytest.fixture(scope="module")
def heavier():
    return _tsm("heavier")


def test_tsm_does_not_mind_a_heavier_robot(heavier):
    """Masses and inertias x1.3 and 1 kg at the tip, unknown to the law."""
    assert heavier.status == "ok"
    assert heavier.metrics["task_error_final"] < 1e-6
    assert largest_after(heavier, 7.0) < 1e-6
    assert heavier.metrics["settling_time_1e-4"] <= 5.5


def test_energy_is_that_of_the_true_robot(heavier):
    assert heavier.metrics["energy_residual"] < 1e-8


@pytest.mark.parametrize("law", ["pseudo-inverse", "extended-jacobian"])
def test_computed_torque_of_the_wrong_model_fails(law):
    """They depend on the model: errors of decimetres stay, and they are reported as what they are."""
    record = mm.simulate("youbot", law, "paper", duration=10.0, dt=1e-2, scenario="heavier")
    assert record.status == "ok"
    assert record.metrics["success"] == 0.0
    assert record.metrics["task_error_final"] > 0.1


def test_tsm_does_not_mind_a_lighter_robot():
    record = _tsm("lighter", dt=5e-3)
    assert record.metrics["settling_time_1e-4"] <= 5.5
    assert largest_after(record, 7.0) < 1e-6


def test_unknown_torques_are_rejected():
    """Constant, sinusoidal and in steps: each step costs a short excursion, then it is gone."""
    record = _tsm("disturbed", dt=5e-3)
    assert record.status == "ok"
    assert record.metrics["settling_time_1e-2"] <= 5.5
    assert largest_after(record, 7.0) < 1e-3
    baseline = mm.simulate(
        "youbot", "pseudo-inverse", "paper", duration=10.0, dt=1e-2, scenario="disturbed"
    )
    assert baseline.metrics["task_error_rms"] > 30.0 * record.metrics["task_error_rms"]
