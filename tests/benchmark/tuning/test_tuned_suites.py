"""The suite that a tuning writes: default and tuned gains, side by side."""

from __future__ import annotations

import tomllib

import pytest
from support.tuning import Inline, tuned_fields, tuned_suite

from mobman.benchmark.suite import load_suite
from mobman.benchmark.tuning.tune import tune_suite
from mobman.benchmark.tuning.tuning_set import candidates
from mobman.benchmark.work import simulated_run
from mobman.controllers.protocol import make_controller
from mobman.errors import SpecError
from mobman.model.build import load_robot


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """What came of a tuning of the small suite."""
    from support.tuning import register

    register()
    folder = tmp_path_factory.mktemp("tuned")
    return tune_suite(tuned_suite(), folder, executor=Inline())


def test_it_has_both_and_says_where_they_come_from(tuned):
    suite = load_suite(tuned.suite_file)
    assert suite == tuned.suite
    assert suite.name == "small-tuned"
    assert list(suite.controllers) == ["one", "one-tuned", "two", "two-tuned"]
    entry = suite.controllers["two-tuned"]
    best = tuned.best("two")
    assert entry.gains == {"scale": 2e-3, **best.gains}
    assert entry.tuned.label == "two"
    assert (entry.tuned.trials, entry.tuned.trial) == (6, best.number)
    assert (entry.tuned.score, entry.tuned.score_default) == (
        best.score,
        tuned.trials["two"][0].score,
    )
    assert entry.tuned.objective == "torque"
    assert entry.tuned.space["x"].log
    assert suite.controllers["two"].tuned is None
    budget = suite.tuning
    assert (budget.trials, budget.seeds, budget.duration) == (6, [5], 0.02)
    assert (budget.robots, budget.tasks) == (["youbot"], ["circle"])
    assert budget.definitions["heavy"]["mass_factor"] == 1.5


def test_it_is_plain_toml(tuned):
    content = tomllib.loads(tuned.suite_file.read_text())
    assert content["controllers"]["one-tuned"]["tuned"]["label"] == "one"


def test_it_runs(tuned):
    suite = load_suite(tuned.suite_file)
    runs = suite.runs()
    assert {run.label for run in runs} == set(suite.controllers)
    assert len({run.run_id for run in runs}) == len(runs)
    robot = load_robot("youbot")
    records = {
        run.label: simulated_run(run, robot, make_controller(run.law, **run.gains)) for run in runs
    }
    for label, entry in suite.controllers.items():
        assert records[label].ok
        assert entry.gains.items() <= records[label].settings.items()


def test_it_is_tuned_again_where_that_is_asked_for(tuned, tmp_path):
    with pytest.raises(SpecError, match=r"'one' has been tuned.*'one-tuned' is tuned already"):
        candidates(tuned.suite)
    again = tune_suite(tuned.suite, tmp_path, controllers=["one"], executor=Inline())
    assert list(again.suite.controllers) == list(tuned.suite.controllers)
    for label, entry in again.suite.controllers.items():
        assert entry == tuned.suite.controllers[label]


def test_places_of_a_tuned_entry_go_where_nothing_better_is_found_again(tuned, tmp_path):
    fields = tuned.suite.model_dump(mode="json", by_alias=True, exclude_unset=True)
    place = fields["groups"][0]
    fields["groups"] = [
        {**place, "controllers": ["one", "one-tuned", "two"], "gains": {"one-tuned": {"y": 0.3}}},
        {**place, "controllers": ["one-tuned"], "scenarios": ["heavier"]},
    ]
    fields["overrides"] = [{"where": {"controllers": ["one-tuned"]}, "duration": 0.03}]
    suite = tuned_suite(**fields)
    written = tune_suite(suite, tmp_path, trials=1, controllers=["one"], executor=Inline()).suite
    assert list(written.controllers) == ["one", "two", "two-tuned"]
    assert {run.label for run in written.runs()} == {"one", "two"}
    assert [group.controllers for group in written.groups] == [["one", "two"]]
    assert not written.overrides


def test_gains_of_groups_and_overrides_hold_for_the_tuned_but_for_what_was_tuned(tmp_path):
    space = {"x": {"low": 1.0, "high": 100.0, "log": True}}
    groups = [
        {
            "robots": ["youbot"],
            "tasks": ["circle"],
            "controllers": ["one"],
            "gains": {"one": {"y": 0.4, "x": 3.0}},
        },
        {"robots": ["youbot"], "tasks": ["circle"], "scenarios": ["heavier"]},
    ]
    overrides = [
        {"where": {"scenarios": ["heavier"]}, "gains": {"x": 4.0, "scale": 5e-3}},
        {"where": {"controllers": ["two"]}, "duration": 0.03},
    ]
    tuning = {**tuned_fields()["tuning"], "spaces": {"one": space, "two": space}, "trials": 3}
    suite = tuned_suite(groups=groups, overrides=overrides, tuning=tuning)
    result = tune_suite(suite, tmp_path, executor=Inline())
    x = {label: result.best(label).gains["x"] for label in ("one", "two")}
    written = load_suite(result.suite_file)
    found = {
        (run.label, run.scenario["name"]): (
            *(run.settings[name] for name in ("x", "y", "scale")),
            run.duration,
        )
        for run in written.runs()
    }
    assert found == {
        ("one", "nominal"): (3.0, 0.4, 1e-3, 0.02),
        ("one-tuned", "nominal"): (x["one"], 0.4, 1e-3, 0.02),
        ("one", "heavier"): (4.0, 0.1, 5e-3, 0.02),
        ("one-tuned", "heavier"): (x["one"], 0.1, 5e-3, 0.02),
        ("two", "heavier"): (4.0, 0.1, 5e-3, 0.03),
        ("two-tuned", "heavier"): (x["two"], 0.1, 5e-3, 0.03),
    }


def test_wrong_provenance_is_refused(tuned, tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(tuned.suite_file.read_text().replace('label = "one"', 'lable = "one"'))
    with pytest.raises(SpecError, match=r"controllers\.one-tuned\.tuned"):
        load_suite(path)


def test_patterns_of_labels_mean_what_they_meant(tmp_path):
    labels = {
        "one": {"law": "known-optimum"},
        "one-b": {"law": "known-optimum", "gains": {"x": 3.0}},
    }
    grid = {"g": {"law": "known-optimum", "grid": {"scale": [0.1, 0.2]}}}
    place = {"robots": ["youbot"], "tasks": ["circle"]}
    groups = [
        {**place, "controllers": ["one-*", "g-0.1"]},
        {**place, "controllers": ["one*"], "scenarios": ["heavier"]},
    ]
    overrides = [{"where": {"controllers": ["g-0.1", "one-b"]}, "gains": {"scale": 0.5}}]
    suite = tuned_suite(controllers={**labels, **grid}, groups=groups, overrides=overrides)
    written = tune_suite(suite, tmp_path, trials=3, executor=Inline()).suite
    found = {(run.label, run.scenario["name"]): run.settings["scale"] for run in written.runs()}
    assert found == {
        ("one-b", "nominal"): 0.5,
        ("one-b-tuned", "nominal"): 0.5,
        ("g-0.1", "nominal"): 0.5,
        ("one", "heavier"): 1e-3,
        ("one-tuned", "heavier"): 1e-3,
        ("one-b", "heavier"): 0.5,
        ("one-b-tuned", "heavier"): 0.5,
    }
