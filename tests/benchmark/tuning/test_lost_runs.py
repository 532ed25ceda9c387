"""Laws that kill, hang or leave their process while they are tuned."""

from __future__ import annotations

from dataclasses import replace

from support import hostile_laws
from support.suites import small_suite

from mobman.benchmark.backends import Local
from mobman.benchmark.suite import load_suite
from mobman.benchmark.tuning.objective import objectives
from mobman.benchmark.tuning.search import scores_of
from mobman.controllers.protocol import controllers


def test_each_is_scored_as_one_that_failed_and_costs_nothing_else(tmp_path, monkeypatch):
    runs = [run for run in load_suite(small_suite(tmp_path)).runs() if run.law == "pseudo-inverse"]
    good = len(runs)
    laws = {"killer": hostile_laws.Killed, "hangs": hostile_laws.Hangs, "loops": hostile_laws.Loops}
    for name, law in laws.items():
        monkeypatch.setitem(controllers._items, name, law)
        runs.insert(1, replace(runs[0], law=name, gains={}))
    objective = objectives.get("error")
    with Local(2, 1.0) as backend:
        scores = dict(scores_of(runs, objective, backend, 1.0))
    assert len(scores) == len(runs) == good + len(laws)
    worst = objective.score("failed", {}, 0.0)
    for position, run in enumerate(runs):
        found = scores[position]
        if run.law in laws:
            assert (found.status, found.score) == ("failed", worst)
        else:
            assert found.status == "ok", found
    messages = {runs[i].law: scores[i].message for i in scores}
    assert "SIGKILL" in messages["killer"]
    assert "took longer than its time limit of 1 s" in messages["hangs"]
    assert "took longer than its time limit of 1 s" in messages["loops"]
    assert all("tried 2 times" in messages[name] for name in laws)
