"""Tuning sets: the same cells for every controller, and none that is reported."""

from __future__ import annotations

import pytest
from support.tuning import tuned_fields, tuned_suite

from mobman.benchmark.suite import load_suite
from mobman.benchmark.tuning.tuning_set import own_scenarios, require_disjoint, tuning_runs
from mobman.errors import SpecError

TWO_PAIRS = [
    {"robots": ["youbot"], "tasks": ["circle"], "dt": 0.002, "gains": {"one": {"y": 0.3}}},
    {"robots": ["husky_ur5"], "tasks": ["circle"], "controllers": ["one"]},
]


def runs_of(suite):
    reported = suite.runs()
    return tuning_runs(suite, list(suite.controllers), reported), reported


def with_tuning(**tuning):
    return tuned_suite(tuning={**tuned_fields()["tuning"], **tuning})


def test_every_controller_has_the_same_cells():
    runs, _ = runs_of(tuned_suite(groups=TWO_PAIRS))
    one, two = ([(run.cell, run.seed) for run in runs[label]] for label in ("one", "two"))
    assert one == two
    assert {(c.robot, c.scenario, c.dt) for c, _ in one} == {
        (robot, scenario, dt)
        for robot, dt in (("youbot", 0.002), ("husky_ur5", 0.001))
        for scenario in ("heavy", "lighter")
    }
    assert {seed for _, seed in one} == {5}


def test_gains_of_groups_hold():
    runs, _ = runs_of(tuned_suite(groups=TWO_PAIRS))
    assert {run.robot: run.settings["y"] for run in runs["one"]} == {
        "youbot": 0.3,
        "husky_ur5": 0.1,
    }
    assert {run.settings["scale"] for run in runs["two"]} == {2e-3}


def test_robots_tasks_duration_and_period_can_be_chosen():
    chosen = {"robots": ["hus*"], "duration": 0.01, "dt": 0.005, "seeds": [5, 6]}
    suite = tuned_suite(groups=TWO_PAIRS, tuning={**tuned_fields()["tuning"], **chosen})
    runs, _ = runs_of(suite)
    assert {run.robot for run in runs["one"]} == {"husky_ur5"}
    assert {(run.duration, run.dt) for run in runs["one"]} == {(0.01, 0.005)}
    assert len(runs["one"]) == 4


def test_a_robot_that_is_not_reported_does_all_tasks():
    runs, _ = runs_of(with_tuning(robots=["husky_ur5"]))
    assert {(run.robot, run.task) for run in runs["one"]} == {("husky_ur5", "circle")}


def test_robots_and_tasks_that_do_not_meet_are_refused():
    groups = [
        {"robots": ["youbot"], "tasks": ["paper"]},
        {"robots": ["husky_ur5"], "tasks": ["circle"]},
    ]
    tuning = {**tuned_fields()["tuning"], "robots": ["youbot"], "tasks": ["circle"]}
    with pytest.raises(SpecError, match="none of its robots does one of its tasks"):
        runs_of(tuned_suite(groups=groups, tuning=tuning))


def test_wrong_names_are_told():
    with pytest.raises(SpecError, match=r"tuning set: .*'hevy'"):
        runs_of(with_tuning(scenarios=["hevy"]))
    with pytest.raises(SpecError, match="'heavy' is a scenario of the suite, too"):
        runs_of(with_tuning(definitions={"heavy": {"payload": 1.0}}))


def test_shipped_suites_have_a_tuning_set_by_default():
    suite = load_suite("paper")
    reported = suite.runs()
    runs = tuning_runs(suite, ["tsm"], reported)["tsm"]
    assert {run.scenario["name"] for run in runs} == set(own_scenarios())
    assert {(run.robot, run.task) for run in runs} == {(run.robot, run.task) for run in reported}
    assert {run.robot: run.gains for run in runs}["youbot"] == {
        "a": 0.2,
        "A": 0.2,
        "metric_scale": 1.0,
    }
    require_disjoint(runs, reported)


REPORTED = [{"robots": ["youbot"], "tasks": ["circle"], "scenarios": ["nominal", "disturbed"]}]


@pytest.mark.parametrize(
    ("tuning", "told"),
    [
        (
            {"scenarios": ["nominal"], "seeds": [0]},
            "circle · nominal, seed 0, is reported; give other",
        ),
        ({"scenarios": ["nominal"], "seeds": [7]}, "nothing random in it"),
        ({"scenarios": ["disturbed"], "seeds": [7, 0]}, "disturbed, seed 0, is reported"),
        # by another name it is the same
        ({"definitions": {"same": {"mass_factor": 1.0}}}, r"same is reported \(as 'nominal'\)"),
    ],
)
def test_what_is_reported_is_refused(tuning, told):
    runs, reported = runs_of(tuned_suite(groups=REPORTED, tuning=tuning))
    with pytest.raises(SpecError, match=told):
        require_disjoint(runs["one"], reported)


@pytest.mark.parametrize(
    "tuning",
    [
        {"scenarios": ["disturbed"], "seeds": [7]},  # random, so another seed is another run
        {"definitions": {"other": {"mass_factor": 1.01}}, "seeds": [0]},
        {"scenarios": ["nominal"], "seeds": [0], "robots": ["husky_ur5"]},
    ],
)
def test_what_is_not_reported_is_not_refused(tuning):
    runs, reported = runs_of(tuned_suite(groups=REPORTED, tuning=tuning))
    require_disjoint(runs["one"], reported)
    assert runs["one"]
    with pytest.raises(SpecError):  # the same runs, once one of them is reported
        require_disjoint(runs["one"], [*reported, runs["one"][-1]])


def test_own_scenarios_can_be_named_with_others():
    runs, _ = runs_of(
        with_tuning(definitions={}, scenarios=["nominal", "tuning-lighter"], seeds=[9])
    )
    told = {run.scenario["name"]: run.scenario.get("mass_factor", 1.0) for run in runs["one"]}
    assert told == {
        "nominal": 1.0,
        "tuning-lighter": own_scenarios()["tuning-lighter"]["mass_factor"],
    }
