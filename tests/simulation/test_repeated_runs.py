"""One seed, one result, to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mobman as mm

ARRAYS = ("t", "q", "z", "torque", "tip_position", "tip_desired", "task_error", "auxiliary_error")


def _run(seed, scenario="disturbed", controller="tsm", **options):
    return mm.simulate(
        "youbot", controller, "paper", duration=0.3, scenario=scenario, seed=seed, **options
    )


@pytest.mark.parametrize("controller", ["tsm", "pseudo-inverse"])
def test_same_seed_gives_bit_identical_datasets(controller):
    one, other = _run(3, controller=controller), _run(3, controller=controller)
    for name in ARRAYS:
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    for name in one.signals:
        assert np.array_equal(one.signals[name], other.signals[name]), name
    for name, value in one.metrics.items():
        if not name.startswith("compute_time"):
            same = other.metrics[name]
            assert value == same or (math.isnan(value) and math.isnan(same)), name


def test_controller_that_was_used_before_starts_anew():
    controller = mm.make_controller("tsm")
    one = _run(3, controller=controller)
    other = _run(3, controller=controller)
    assert np.array_equal(one.torque, other.torque)


def test_other_seed_gives_another_run_where_there_is_randomness():
    one, other = _run(3), _run(4)
    assert (one.seed, other.seed) == (3, 4)
    assert np.abs(one.q - other.q).max() > 1e-6


def test_seed_does_not_matter_where_there_is_no_randomness():
    assert np.array_equal(_run(3, "nominal").q, _run(4, "nominal").q)
