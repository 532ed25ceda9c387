"""``tsm`` on the paper's task, sampled slowly, with z' differentiated, or in its printed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.errors import largest_after, size_at

import mobman as mm
from mobman.simulation.scenario import Scenario

PAPER = {"a": 0.2, "A": 0.2}


def _run(gains=PAPER, **options):
    given = {"duration": 10.0, **options}
    return mm.simulate("youbot", mm.make_controller("tsm", **gains), "paper", **given)


@pytest.fixture(scope="module")
def slow():
    return _run(dt=1e-2)


def test_ten_milliseconds_are_enough(slow):
    assert largest_after(slow, 7.0) < 1e-6
    assert slow.metrics["settling_time_1e-4"] <= 5.5


def test_automatic_bounds_do_no_harm(slow):
    """The implicit form bears any bound below the true one: the reaching is the same."""
    record = _run({}, dt=1e-2, duration=7.0)
    assert record.settings["a"] < 0.2
    for time in (1.0, 2.0, 3.0):
        assert np.isclose(size_at(record, time), size_at(slow, time), rtol=0.05)
    assert record.metrics["settling_time_1e-4"] <= 5.5
    assert record.metrics["task_error_final"] < 1e-6


def test_differentiated_acceleration_is_enough():
    record = _run(scenario=Scenario(name="differences", acceleration="backward-difference"))
    assert record.metrics["settling_time_1e-4"] <= 5.5
    assert largest_after(record, 7.0) < 2e-9
    assert largest_after(record, 5.0, record.auxiliary_error) < 1e-6


def test_differentiated_acceleration_is_not_the_exact_one():
    scenario = Scenario(name="differences", acceleration="backward-difference")
    one, other = (_run(duration=0.1, scenario=s) for s in (None, scenario))
    assert np.abs(one.torque - other.torque).max() > 1e-3


@pytest.mark.parametrize("layer", [0.0, 0.1])
def test_printed_form_diverges_where_the_implicit_one_settles(layer):
    """Euler's unit vector chatters with amplitudes of gain times dt; its end is a result."""
    record = _run({**PAPER, "discretization": "explicit", "boundary_layer": layer})
    assert record.status == "diverged"
    assert record.message.startswith("at t = ")
    assert record.t[-1] < 1.0
    assert record.metrics["success"] == 0.0
    assert math.isinf(record.metrics["task_error_final"])


def test_shorter_ticks_delay_the_end_of_the_printed_form_but_do_not_prevent_it():
    explicit = {**PAPER, "discretization": "explicit"}
    ends = []
    for dt in (1e-3, 1e-4):
        record = _run(explicit, dt=dt, duration=0.4)
        assert record.status == "diverged"
        ends.append(record.t[-1])
    assert ends[0] < ends[1] < 0.4


def test_boundary_layer_of_the_implicit_form_costs_accuracy():
    """Inside the layer s is kept small, not zero: milder, and coarser."""
    layered = _run({**PAPER, "boundary_layer": 0.1}, dt=1e-2)
    assert layered.status == "ok"
    assert 1e-6 < largest_after(layered, 7.0) < 1e-3
