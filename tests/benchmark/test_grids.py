"""Grids, patterns and overrides of suites."""

from __future__ import annotations

import pytest
from support.suites import suite_of as suite_of_laws

from mobman.benchmark.expand import chosen, expand
from mobman.benchmark.suite import load_suite
from mobman.errors import SpecError, UnknownNameError, UsageError

GRIDS = """
schema = 1
name = "grids"
duration = 0.02
dt = [1e-3, 2e-3]

[controllers.tsm]
law = "tsm"

[controllers.damped]
law = "damped-least-squares"
grid = { mu = [0.01, 0.1] }

[scenarios.mass]
description = "A heavier or lighter plant."
grid = { mass_factor = [0.7, 1.3], payload = [0.0, 1.0] }

[scenarios.push]
disturbances = [{ type = "constant", acceleration = 1.0 }]
grid = { "disturbances.0.acceleration" = [0.5, 2.0] }

[[groups]]
robots = ["youbot"]
tasks = ["circle"]
scenarios = ["nominal", "mass", "push-*"]
"""


def suite_of(tmp_path, text):
    path = tmp_path / "grids.toml"
    path.write_text(text)
    return load_suite(path)


def one_scenario():
    return GRIDS.replace('["nominal", "mass", "push-*"]', '["nominal"]')


def test_all_combinations_have_names_of_their_own():
    found = expand("mass", {"a": {"b": 0}}, {"a.b": [1, 2], "c": [0.5, "x"]})
    assert found == {
        "mass-1-0.5": {"a": {"b": 1}, "c": 0.5},
        "mass-1-x": {"a": {"b": 1}, "c": "x"},
        "mass-2-0.5": {"a": {"b": 2}, "c": 0.5},
        "mass-2-x": {"a": {"b": 2}, "c": "x"},
    }
    assert expand("one", {"a": 1}, {}) == {"one": {"a": 1}}


def test_entries_of_a_grid_share_nothing():
    found = expand("x", {"list": [{"a": 1}]}, {"list.0.a": [1, 2]})
    assert [entry["list"][0]["a"] for entry in found.values()] == [1, 2]


@pytest.mark.parametrize("path", ["list.7.a", "list.b", "list.²", "number.a"])
def test_a_grid_within_what_has_no_such_part_is_refused(path):
    with pytest.raises(UsageError, match="grid field"):
        expand("x", {"list": [{"a": 1}], "number": 3}, {path: [1]})


def test_a_grid_may_change_an_entry_of_a_list_and_truth_values():
    found = expand("x", {"list": [1, 2]}, {"list.1": [5], "on": [True, False]})
    assert found == {
        "x-5-true": {"list": [1, 5], "on": True},
        "x-5-false": {"list": [1, 5], "on": False},
    }


@pytest.mark.parametrize(
    ("others", "fault"),
    [
        ({"tsm-1": {"law": "tsm"}}, "controllers.tsm-1: 'tsm-1' is the name of another entry, too"),
        ({}, "controllers.tsm: grid: two of its entries are called 'tsm-1'"),
    ],
)
def test_names_that_a_grid_gives_twice_are_one_fault(others, fault):
    grid = {"a": [1.0, 2.0] if others else [1.0, 1.0]}
    controllers = {"tsm": {"law": "tsm", "grid": grid}, **others}
    with pytest.raises(SpecError) as caught:
        suite_of_laws(["tsm"], controllers=controllers).runs()
    assert str(caught.value) == f"suite 'laws': {fault}"


def test_a_grid_of_more_than_can_be_listed_is_refused():
    grid = {f"field_{i}": list(range(10)) for i in range(9)}
    with pytest.raises(UsageError, match=r"it has 1000000000 combinations; allowed: 10000"):
        expand("law", {}, grid)


def test_more_runs_than_can_be_listed_are_refused():
    periods = [1e-3 + 1e-9 * i for i in range(20)]
    suite = suite_of_laws(["tsm"], seeds=20_000, dt=periods)
    with pytest.raises(SpecError, match=r"groups\.0 asks for 400000 runs; allowed: 100000"):
        suite.runs()


def test_values_that_read_alike_are_refused():
    with pytest.raises(UsageError, match="two of its entries are called 'x-1'"):
        expand("x", {}, {"a": [1.0, 1.00000001]})


def test_a_name_is_one_thing_or_a_grid_or_a_pattern():
    names, members = ["m-1", "m-2", "other"], {"m": ["m-1", "m-2"]}
    assert chosen("thing", "m-2", names, members) == ["m-2"]
    assert chosen("thing", "m", names, members) == ["m-1", "m-2"]
    assert chosen("thing", "*", names, members) == names
    with pytest.raises(UnknownNameError, match="did you mean 'other'"):
        chosen("thing", "othr", names, members)
    with pytest.raises(UnknownNameError, match="x-"):
        chosen("thing", "x-*", names, members)


def test_a_grid_is_all_its_combinations(tmp_path):
    suite = suite_of(tmp_path, GRIDS)
    runs = suite.runs()
    # (nominal + 4 masses + 2 pushes) x (tsm + 2 damped) x 2 sampling periods
    assert len(runs) == suite.size() == 7 * 3 * 2
    assert len({run.run_id for run in runs}) == len(runs)
    assert {run.label for run in runs} == {"tsm", "damped-0.01", "damped-0.1"}
    assert {run.gains.get("mu") for run in runs if run.law != "tsm"} == {0.01, 0.1}
    by_name = {run.scenario["name"]: run for run in runs}
    assert set(by_name) == {
        *("nominal", "mass-0.7-0", "mass-0.7-1", "mass-1.3-0", "mass-1.3-1"),
        *("push-0.5", "push-2"),
    }
    assert by_name["mass-1.3-1"].scenario["mass_factor"] == 1.3
    assert by_name["mass-1.3-1"].family == "mass"
    assert by_name["nominal"].family == "nominal"
    assert by_name["push-2"].scenario["disturbances"][0]["acceleration"] == 2.0
    assert {run.dt for run in runs} == {1e-3, 2e-3}


def test_overrides_change_and_leave_out_cells(tmp_path):
    text = (
        GRIDS
        + """
[[overrides]]
where = { controllers = ["damped"], scenarios = ["mass"] }
skip = true

[[overrides]]
where = { controllers = ["tsm"] }
gains = { a = 0.5 }
duration = 0.04

[[overrides]]
where = { controllers = ["tsm"], scenarios = ["push-2"] }
gains = { a = 0.25 }
seeds = [3, 4]
dt = 1e-3
"""
    )
    runs = suite_of(tmp_path, text).runs()
    damped = {run.scenario["name"] for run in runs if run.law != "tsm"}
    assert damped == {"nominal", "push-0.5", "push-2"}
    assert {run.duration for run in runs if run.law == "tsm"} == {0.04}
    assert {run.duration for run in runs if run.law != "tsm"} == {0.02}
    pushed = [r for r in runs if r.law == "tsm" and r.scenario["name"] == "push-2"]
    assert [(run.seed, run.dt, run.gains["a"]) for run in pushed] == [
        (3, 1e-3, 0.25),
        (4, 1e-3, 0.25),
    ]
    others = [r for r in runs if r.law == "tsm" and r.scenario["name"] == "nominal"]
    assert {run.gains["a"] for run in others} == {0.5}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('[[overrides]]\nwhere = { robots = ["tiago"] }\n', "overrides.0 fits no run"),
        ("[[overrides]]\nwhere = { }\n", "say of which robots"),
        ('[[overrides]]\nwhere = { robot = ["youbot"] }\n', "where.robot"),
        ("[scenarios.bad]\nmass_factor = -1\n", "mass_factor"),
        ("[scenarios.bad]\nmass = 1\n", ": scenario 'bad': field 'mass' is unknown"),
        ('[tasks.far]\ntask = "circl"\n', "did you mean 'circle'"),
        ('[controllers.x]\nlaw = "tsm"\ngrid = { width = [] }\n', "controllers.x.grid.width"),
        ('[controllers.x]\nlaw = "tsm"\ngrid = { a = [-1.0] }\n', "controller 'x--1'"),
        ('[[groups]]\nrobots = ["*bot_x*"]\ntasks = ["circle"]\n', "unknown robot"),
    ],
)
def test_faults_are_told_with_their_place(tmp_path, more, message):
    with pytest.raises(SpecError) as error:
        suite_of(tmp_path, GRIDS + more).runs()
    assert message in str(error.value)


def test_one_run_with_two_gains_is_refused(tmp_path):
    again = '\n[[groups]]\nrobots = ["youbot"]\ntasks = ["circle"]\ngains = { tsm = { a = 0.3 } }\n'
    with pytest.raises(SpecError, match="is asked for twice, with other gains"):
        suite_of(tmp_path, GRIDS + again).runs()


def test_a_pattern_of_robots_is_all_that_fit(tmp_path):
    text = one_scenario().replace('["youbot"]', '["youbot*"]')
    assert {run.robot for run in suite_of(tmp_path, text).runs()} == {"youbot", "youbot_mecanum"}


def test_who_edits_a_law_of_their_own_gets_new_runs(tmp_path, monkeypatch):
    law = tmp_path / "own_law.py"
    law.write_text(
        "class Own:\n"
        "    def reset(self, robot, task, dt):\n        self.nz = robot.nz\n"
        "    def step(self, t, q, z, z_dot):\n        return [0.0] * self.nz\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    import own_law

    from mobman.controllers.protocol import controllers

    monkeypatch.setitem(controllers._items, "own", own_law.Own)
    text = one_scenario().replace('law = "tsm"', 'law = "own"')

    def ids():
        return {run.run_id for run in suite_of(tmp_path, text).runs() if run.law == "own"}

    before = ids()
    assert before == ids()
    law.write_text(law.read_text().replace("0.0", "1.0"))
    assert not before & ids()
