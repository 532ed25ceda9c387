"""Laws that kill, hang or leave their process while they are tuned."""

from __future__ import annotations

from dataclasses import replace

from support import hostile_laws
from support.suites import small_suite

from mobman.benchmark.suite import load_suite
from mobman.benchmark.tuning.evaluation import Evaluation, evaluate
from mobman.benchmark.tuning.objective import objectives
from mobman.benchmark.tuning.processes import local_processes
from mobman.controllers.protocol import controllers


def test_each_is_scored_as_one_that_failed_and_costs_nothing_else(tmp_path, monkeypatch):
    runs = [run for run in load_suite(small_suite(tmp_path)).runs() if run.law == "pseudo-inverse"]
    laws = {"killer": hostile_laws.Killed, "hangs": hostile_laws.Hangs, "loops": hostile_laws.Loops}
    good = controllers.get("pseudo-inverse")
    evaluations = [Evaluation.of(run) for run in runs]
    for name, law in laws.items():
        monkeypatch.setitem(controllers._items, name, law)
        evaluations.insert(1, Evaluation.of(replace(runs[0], law=name, gains={})))
    assert sum(evaluation.law is good for evaluation in evaluations) == len(runs)
    objective = objectives.get("error")
    with local_processes(2) as pool:
        scores = dict(evaluate(evaluations, objective, pool, 1.0))
    assert len(scores) == len(evaluations)
    worst = objective.score("failed", {}, 0.0)
    for position, evaluation in enumerate(evaluations):
        found = scores[position]
        if evaluation.law is good:
            assert found.status == "ok", found
        else:
            assert (found.status, found.score) == ("failed", worst)
    messages = {evaluations[i].run.law: scores[i].message for i in scores}
    assert "SIGKILL" in messages["killer"]
    assert "SIGALRM" in messages["hangs"]
    assert "took longer than its time limit of 1 s" in messages["loops"]
