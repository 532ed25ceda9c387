"""``tsm`` with its default gains on robots that the paper does not know: one law for all."""

from __future__ import annotations

import numpy as np
import pytest
from support.errors import largest_after
from support.swept import swept

import mobman as mm


@pytest.fixture(scope="module")
def record():
    return mm.simulate("tiago_no_hand", "tsm", "circle", duration=10.0)


def test_tiago_follows_the_circle(record):
    assert record.status == "ok"
    assert record.metrics["settling_time_1e-4"] <= 6.0
    assert record.metrics["task_error_final"] < 1e-8
    assert largest_after(record, 7.0) < 1e-8


def test_tiagos_auxiliary_errors_vanish(record):
    assert record.auxiliary_error.shape[1] == 7
    assert largest_after(record, 7.0, record.auxiliary_error) < 1e-6


def test_tiagos_torques_are_continuous(record):
    assert record.metrics["torque_step"] < 0.01
    assert record.metrics["energy_residual"] < 1e-8
    assert record.metrics["constraint_residual"] < 1e-12


def test_gains_are_the_youbots_and_the_bounds_its_own(record):
    assert (record.settings["lambda_1"], record.settings["Lambda_0"]) == (11.0, 11.0)
    assert 0.0 < record.settings["a"] <= record.metrics["lambda_min"]


@pytest.mark.parametrize("name", swept())
def test_every_robot_follows_the_circle(name):
    """At 10 ms, for 6 s; the tip starts 0.1 m from the circle, or less in front of a fixed arm."""
    record = mm.simulate(name, "tsm", "circle", duration=6.0, dt=1e-2)
    assert record.status == "ok"
    assert 0.01 < np.linalg.norm(record.task_error[0]) < 0.1 + 1e-9
    assert record.metrics["settling_time_1e-4"] <= 5.0
    assert record.metrics["task_error_final"] < 1e-5
