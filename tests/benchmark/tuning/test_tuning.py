"""Tuning: the optimum is found, by an equal budget, whoever computes and wherever it is interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from click.testing import CliRunner
from support.tuning import (
    BEST,
    EXPLODES,
    REFUSED,
    Inline,
    KnownOptimum,
    torque,
    trials_in,
    tuned_fields,
)
from support.tuning import tuned_suite as small

from mobman.benchmark import work
from mobman.benchmark.tuning.objective import CEILING, Objective, objectives
from mobman.benchmark.tuning.tune import tune_suite
from mobman.cli.bench import bench
from mobman.errors import MobmanError, SpecError
from mobman.simulation.simulate import simulate


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """A tuning that nothing disturbed: its folder."""
    from support.tuning import register

    register()
    folder = tmp_path_factory.mktemp("reference")
    tune_suite(small(), folder, executor=Inline())
    return folder


def test_known_optimum_is_approached(tmp_path):
    tuning = {**tuned_fields()["tuning"], "scenarios": ["heavy"], "duration": 0.002}
    suite = small(controllers={"one": {"law": "known-optimum"}}, tuning=tuning)
    result = tune_suite(suite, tmp_path, trials=40, executor=Inline())
    best = result.best("one")
    assert BEST["x"] / 2 < best.gains["x"] < BEST["x"] * 2
    assert abs(best.gains["y"] - BEST["y"]) < 0.2
    assert best.score < result.trials["one"][0].score - 1.0
    # better than as many trials at random would be: the search learns
    late = sorted(trial.score for trial in result.trials["one"][20:])
    early = sorted(trial.score for trial in result.trials["one"][:10])
    assert late[len(late) // 2] < early[len(early) // 2]


def test_budget_is_equal(tmp_path, monkeypatch):
    calls: Counter = Counter()

    def counted(robot, controller, task, **options):
        calls[controller.gains.scale, options["scenario"].name, options["seed"]] += 1
        return simulate(robot, controller, task, **options)

    monkeypatch.setattr(work, "simulate", counted)
    # a law that takes all gains, so that all trials are simulated
    monkeypatch.setattr(KnownOptimum, "search_space", {"y": {"low": 0.0, "high": 1.0}})
    plans = []
    tune_suite(small(), tmp_path, executor=Inline(), on_start=plans.append)
    cells = [(scenario, 5) for scenario in ("heavy", "lighter")]
    assert calls == {(scale, *cell): 6 for scale in (1e-3, 2e-3) for cell in cells}
    assert plans[0].total == sum(calls.values()) == 24
    assert plans[0].gains == {"one": 1, "two": 1}


def test_first_trial_is_the_suites_own_and_the_best_is_not_worse(reference):
    content = json.loads((reference / "tuning.json").read_text())
    for entry in content["controllers"].values():
        assert entry["trials"][0]["gains"] == {}
        assert entry["default"] == {"x": 2.0, "y": 0.1}
        assert entry["score"] == min(trial["score"] for trial in entry["trials"])
        assert entry["score_default"] == entry["trials"][0]["score"]
    assert content["schema_version"] == 1
    assert content["tuning"]["trials"] == 6
    assert content["sampler"]["optuna"]
    assert {"versions", "machine", "seconds", "finished"} <= content.keys()


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_number_of_workers_changes_nothing(reference, tmp_path, workers):
    """By the command, with processes; the reference was computed without any."""
    suite = _as_toml(tmp_path)
    options = ["tune", str(suite), "-o", str(tmp_path), "--workers", str(workers), "--json"]
    done = CliRunner().invoke(bench, options, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert trials_in(tmp_path) == trials_in(reference)
    told = json.loads(done.stdout)
    assert told["controllers"]["one"]["trials"] == 6
    assert "24 runs" in done.stderr
    assert "[12/12]" in done.stderr


def _as_toml(folder):
    import tomli_w

    path = folder / "small.toml"
    path.write_text(tomli_w.dumps(tuned_fields()))
    return path


@pytest.mark.parametrize("after", [1, 9, 17])
def test_interrupted_tuning_goes_on(reference, tmp_path, after):
    steps = []

    def interrupt(step):
        steps.append(step)
        if len(steps) == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune_suite(small(), tmp_path, executor=Inline(), on_step=interrupt)
    kept = sum(step.trial is not None for step in steps)
    again, plans = Inline(), []
    tune_suite(small(), tmp_path, executor=again, on_start=plans.append)
    assert plans[0].done == kept
    assert again.count == 2 * (12 - kept)  # what was done is not done again
    assert trials_in(tmp_path) == trials_in(reference)
    assert (tmp_path / "small-tuned.toml").read_text() == (
        reference / "small-tuned.toml"
    ).read_text()


def test_more_trials_go_on_from_fewer(reference, tmp_path):
    tune_suite(small(), tmp_path, trials=3, executor=Inline())
    again = Inline()
    tune_suite(small(), tmp_path, trials=6, executor=again)
    assert again.count == 2 * 2 * 3
    assert trials_in(tmp_path) == trials_in(reference)


def test_half_a_line_of_a_killed_process_is_left_out(reference, tmp_path):
    tune_suite(small(), tmp_path, executor=Inline())
    journal = tmp_path / "trials.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[:-1]) + lines[-1][:40])
    again = Inline()
    tune_suite(small(), tmp_path, executor=again)
    assert again.count == 2
    assert trials_in(tmp_path) == trials_in(reference)


def test_trials_of_something_else_are_refused(tmp_path):
    tune_suite(small(), tmp_path, trials=1, executor=Inline())
    other = {**tuned_fields()["tuning"], "seeds": [6]}
    with pytest.raises(MobmanError, match="with another tuning set"):
        tune_suite(small(tuning=other), tmp_path, executor=Inline())
    tune_suite(small(tuning=other), tmp_path, trials=1, executor=Inline(), fresh=True)
    journal = tmp_path / "trials.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    for number, wrong in enumerate(["{}\n", "no JSON\n", '{"op_code": 99}\n', "[]\n"], 1):
        journal.write_text("".join([*lines[: number - 1], wrong]))
        with pytest.raises(MobmanError, match=rf"line {number}, is no trial.*--fresh"):
            tune_suite(small(), tmp_path, executor=Inline())
    foreign = [json.loads(line) for line in lines]
    for line in foreign:
        line.pop("user_attrs", None)
    journal.write_text("".join(json.dumps(line) + "\n" for line in foreign))
    with pytest.raises(MobmanError, match=r"no trial of a tuning.*--fresh"):
        tune_suite(small(tuning=other), tmp_path, executor=Inline())


def test_failing_trials_are_scored_and_count(tmp_path):
    space = {"x": {"low": 200.0, "high": 400.0}, "y": {"low": 0.85, "high": 0.95}}
    tuning = {**tuned_fields()["tuning"], "spaces": {"one": space}, "trials": 16}
    suite = small(controllers={"one": {"law": "known-optimum"}}, tuning=tuning)
    result = tune_suite(suite, tmp_path, executor=Inline())
    trials = result.trials["one"]
    assert len(trials) == 16
    seen = set()
    for trial in trials[1:]:
        statuses = {run.status for run in trial.runs}
        seen |= statuses
        if trial.gains["x"] > REFUSED:
            assert statuses == {"infeasible"}
            assert "must be at most" in trial.runs[0].message
            assert trial.score == 2.0 * CEILING
        elif trial.gains["y"] > EXPLODES:
            assert statuses == {"diverged"}
            # it lasted for 11 of its 20 ms
            assert trial.score == pytest.approx(CEILING * (2.0 - 0.010 / 0.020), abs=0.4)
        else:
            assert statuses == {"ok"}
            assert trial.score < CEILING
    assert seen == {"infeasible", "diverged", "ok"}


def test_law_that_breaks_down_is_scored_but_not_with_the_suites_own_gains(tmp_path, monkeypatch):
    def step(self, t, q, z, z_dot):
        raise ZeroDivisionError("no gains for this")

    good = KnownOptimum.step
    monkeypatch.setattr(
        KnownOptimum,
        "step",
        lambda self, *state: (good if self.gains.x == 2.0 else step)(self, *state),
    )
    suite = small(controllers={"one": {"law": "known-optimum"}})
    result = tune_suite(suite, tmp_path, trials=3, executor=Inline())
    assert result.best("one").number == 0
    assert result.trials["one"][1].runs[0].message == "ZeroDivisionError: no gains for this"
    # tuned in vain, which the suite says
    assert list(result.suite.controllers) == ["one"]
    assert result.suite.controllers["one"].tuned.score == result.best("one").score
    monkeypatch.setattr(KnownOptimum, "step", step)
    with pytest.raises(
        MobmanError, match=r"'one'.* fails with the suite's own gains.*no gains for"
    ):
        tune_suite(suite, tmp_path / "broken", trials=3, executor=Inline())


def test_full_disk_is_no_fault_of_gains(tmp_path, monkeypatch):
    def broken(*arguments, **options):
        raise OSError("no space left on device")

    monkeypatch.setattr(work, "simulate", broken)
    with pytest.raises(OSError, match="no space left"):
        tune_suite(small(), tmp_path, trials=1, executor=Inline())


def test_lack_of_memory_is_no_fault_of_gains(tmp_path, monkeypatch):
    def step(self, t, q, z, z_dot):
        raise MemoryError

    monkeypatch.setattr(KnownOptimum, "step", step)
    executor = Inline()
    with pytest.raises(OSError, match="ran out of memory; tried 2 times"):
        tune_suite(small(), tmp_path, trials=1, executor=executor)


def test_a_killed_process_goes_on(reference, tmp_path):
    """It is killed with a trial half done, and leaves half a line of its journal, and a lock on it."""
    suite = _as_toml(tmp_path)
    code = f"""
import os, signal
from support.tuning import Inline, register
from mobman.benchmark.suite import load_suite
from mobman.benchmark.tuning.tune import tune_suite
register()
steps = []
def kill(step):
    steps.append(step)
    if len(steps) == 7:
        with open({str(tmp_path / "trials.jsonl")!r}, "a") as file:
            file.write('{{"op_code": 4, "study')
        os.symlink("trials.jsonl", {str(tmp_path / "trials.jsonl.lock")!r})
        os.kill(os.getpid(), signal.SIGKILL)
tune_suite(load_suite({str(suite)!r}), {str(tmp_path)!r}, executor=Inline(), on_step=kill)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run([sys.executable, "-c", code], env=environment, check=False)
    assert ended.returncode == -signal.SIGKILL
    assert (tmp_path / "trials.jsonl.lock").is_symlink()
    again, plans = Inline(), []
    result = tune_suite(small(), tmp_path, executor=again, on_start=plans.append)
    assert again.count == 2 * (12 - 3)
    (plan,) = plans
    assert plan.done == 3
    own = {label: [trial.score for trial in trials] for label, trials in result.trials.items()}
    assert plan.scores
    assert all(plan.scores[k] in np.minimum.accumulate(own[k]) for k in plan.scores)
    assert trials_in(tmp_path) == trials_in(reference)


def test_trials_are_a_journal_of_optuna(reference):
    optuna = pytest.importorskip("optuna")
    backend = optuna.storages.journal.JournalFileBackend(str(reference / "trials.jsonl"))
    storage = optuna.storages.JournalStorage(backend)
    content = json.loads((reference / "tuning.json").read_text())
    for label, entry in content["controllers"].items():
        study = optuna.load_study(study_name=label, storage=storage)
        assert len(study.trials) == 6
        assert study.best_value == entry["score"]
        assert study.best_params == (entry["gains"] or entry["default"])


@pytest.mark.parametrize("library", ["optuna", "tomli_w"])
def test_without_its_libraries_it_says_what_to_install(tmp_path, monkeypatch, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MobmanError, match=rf"needs {library}.*pip install 'mobman\[tune\]'"):
        tune_suite(small(), tmp_path, executor=Inline())


def test_what_is_reported_is_not_tuned_on(tmp_path):
    tuning = {**tuned_fields()["tuning"], "scenarios": ["nominal"]}
    executor = Inline()
    with pytest.raises(SpecError, match="is reported"):
        tune_suite(small(tuning=tuning), tmp_path, executor=executor)
    assert executor.count == 0


def test_unknown_objective_and_folder_that_cannot_be(tmp_path):
    tuning = {**tuned_fields()["tuning"], "objective": "eror"}
    with pytest.raises(MobmanError, match="did you mean 'error'"):
        tune_suite(small(tuning=tuning), tmp_path, executor=Inline())
    (tmp_path / "file").write_text("")
    with pytest.raises(MobmanError, match="cannot use"):
        tune_suite(small(), tmp_path / "file" / "x", executor=Inline())


def test_objective_of_a_metric_that_is_not_there(tmp_path):
    objectives.register("odd", Objective("odd", "odd", ("oddity",), torque))
    suite = small(tuning={**tuned_fields()["tuning"], "objective": "odd"})
    with pytest.raises(MobmanError, match="'odd' needs the metric 'oddity'"):
        tune_suite(suite, tmp_path, executor=Inline())
