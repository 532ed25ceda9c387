"""Scores: failures are worse than everything else, and the earlier the worse."""

from __future__ import annotations

import math

import pytest

from mobman.benchmark.tuning.objective import CEILING, Objective, objectives
from mobman.benchmark.tuning.search import RunScore, Trial
from mobman.simulation.metrics import metrics

OWN = ("error", "error-chattering", "error-effort")


@pytest.mark.parametrize("name", OWN)
def test_every_objective_is_of_metrics_that_there_are(name):
    objective = objectives.get(name)
    assert set(objective.metrics) <= set(metrics.names())
    assert all(metric in objective.formula for metric in objective.metrics)
    values = dict.fromkeys(objective.metrics, 1.0)
    worse = dict.fromkeys(objective.metrics, 10.0)
    assert objective.function(values) == 0.0
    assert objective.function(worse) > 0.0


def test_error_is_its_logarithm_down_to_the_floor():
    objective = objectives.get("error")
    assert objective.score("ok", {"task_error_rms": 1e-2}, 1.0) == pytest.approx(-2.0)
    assert objective.score("ok", {"task_error_rms": 1e-11}, 1.0) == pytest.approx(-6.0)
    assert objective.score("ok", {"task_error_rms": 0.0}, 1.0) == pytest.approx(-6.0)


def test_effort_counts_by_half():
    objective = objectives.get("error-effort")
    same = [
        objective.score("ok", {"task_error_rms": error, "torque_energy": energy}, 1.0)
        for error, energy in ((1e-2, 1.0), (1e-3, 1e2))
    ]
    assert same[0] == pytest.approx(same[1])


def test_failures_are_worse_than_any_completed_run():
    huge = Objective("huge", "", (), lambda _: math.inf)
    lost = Objective("lost", "", (), lambda _: math.nan)
    assert huge.score("ok", {}, 1.0) == lost.score("ok", {}, 1.0) == CEILING
    scores = [huge.score("diverged", {}, fraction) for fraction in (0.999, 0.5, 0.1, 0.0)]
    assert scores == sorted(scores)
    assert scores[0] > CEILING
    assert scores[-1] == 2.0 * CEILING
    assert huge.score("singular", {}, 0.5) == huge.score("diverged", {}, 0.5)


def test_mean_does_not_depend_on_rounding():
    run = RunScore(0.1, "ok", "", {}, 0.0)
    assert Trial("one", 0, {}, (run,) * 10).score == 0.1
