"""Placements in suites: the same for all laws, told in records and frames, and others for tuning."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from support.suites import SMALL, run_suite, small_suite

import mobman as mm
from mobman.benchmark.report.data import read_results
from mobman.benchmark.store import Store
from mobman.benchmark.suite import load_suite
from mobman.benchmark.suite_tables import MOST_PLACEMENTS
from mobman.benchmark.tuning.tuning_set import tuning_runs
from mobman.errors import SpecError
from mobman.simulation.placements import placements
from mobman.simulation.rerun import verify

PLACED = SMALL.replace("seeds = [0, 1]", "placements = 3")


def suite_with(tmp_path, text):
    path = tmp_path / "small.toml"
    path.write_text(text.format(duration=0.02))
    return load_suite(path)


def test_every_law_and_scenario_has_the_same_ones(tmp_path):
    runs = suite_with(tmp_path, PLACED).runs()
    assert len(runs) == 12
    by_number = {}
    for run in runs:
        where = (tuple(run.q0), str(run.task_parameters))
        by_number.setdefault(run.placement, set()).add(where)
    assert [len(found) for found in by_number.values()] == [1, 1, 1]
    assert len(set().union(*by_number.values())) == 3
    robot = mm.load_robot("youbot")
    for number, placed in placements(robot, [1, 2]).items():
        assert next(iter(by_number[number]))[0] == tuple(placed.q0)


def test_runs_at_rest_are_those_of_a_suite_without_placements(tmp_path):
    before = {run.run_id for run in suite_with(tmp_path, SMALL).runs() if run.seed == 0}
    runs = suite_with(tmp_path, PLACED).runs()
    assert {run.run_id for run in runs if run.placement == 0} == before
    assert len({run.run_id for run in runs}) == len(runs)


def test_parts_of_a_suite_have_their_own_number(tmp_path):
    group = PLACED + "placements = 1\n"
    assert {run.placement for run in suite_with(tmp_path, group).runs()} == {0}
    override = '\n[[overrides]]\nwhere = {{ scenarios = ["disturbed"] }}\nplacements = 2\n'
    suite = suite_with(tmp_path, PLACED + override)
    found = {(run.scenario["name"], run.placement) for run in suite.runs()}
    assert found == {("nominal", i) for i in range(3)} | {("disturbed", i) for i in range(2)}
    assert suite.size() == len(suite.runs()) == 10
    with pytest.raises(SpecError, match="placements"):
        suite_with(tmp_path, PLACED.replace("placements = 3", "placements = 0"))


def test_record_frame_and_report_tell_it(tmp_path):
    suite = suite_with(tmp_path, PLACED)
    with ThreadPoolExecutor(1) as pool:
        run_suite(suite, tmp_path / "out", executor=pool)
    frame = mm.load_results(tmp_path / "out")
    assert sorted(frame.placement.unique()) == [0, 1, 2]
    store = Store(tmp_path / "out")
    for run in store.runs:
        record = store.record(run)
        assert record.spec.get("placement", 0) == run.placement == frame.placement[run.run_id]
        expected = run.q0 or mm.load_robot("youbot").q_rest.tolist()
        assert np.array_equal(record.q[0], expected)
    assert verify(store.path(store.runs[-1])).identical
    cells = read_results(store).cells
    assert len(cells) == 6
    assert list(cells.variant[:2]) == ["nominal, placement 0", "nominal, placement 1"]
    assert set(cells.case) == {"nominal", "disturbed"}


def test_a_scenario_displaces_the_start_of_a_placement(tmp_path):
    away = SMALL.replace("seeds = [0, 1]", "placements = 2").replace(
        'scenarios = ["nominal", "disturbed"]', 'scenarios = ["away"]'
    )
    suite = suite_with(tmp_path, away + "\n[scenarios.away]\nstart_offset = 0.5\n")
    with ThreadPoolExecutor(1) as pool:
        run_suite(suite, tmp_path / "out", executor=pool)
    store = Store(tmp_path / "out")
    run = next(run for run in store.runs if run.placement == 1)
    moved = store.record(run).q[0] - np.array(run.q0)
    assert np.linalg.norm(moved) == pytest.approx(0.5)
    assert np.count_nonzero(moved) == 2


def test_tuning_has_others_than_are_reported(tmp_path):
    suite = suite_with(tmp_path, PLACED)
    reported = suite.runs()
    tuning = tuning_runs(suite, list(suite.controllers), reported)["damped"]
    assert {run.placement for run in tuning} == {MOST_PLACEMENTS, MOST_PLACEMENTS + 1}
    starts = {(tuple(run.q0), str(run.task_parameters)) for run in tuning}
    assert not starts & {(tuple(run.q0), str(run.task_parameters)) for run in reported}
    one = load_suite(small_suite(tmp_path))
    assert {run.placement for run in tuning_runs(one, ["damped"], one.runs())["damped"]} == {0}


def test_shipped_suites_have_five_but_for_the_papers_task_and_a_first_look():
    for name in mm.list_suites():
        suite = mm.load_suite(name)
        plain = {"quick": 2, "paper": 1}
        assert suite.placements == plain.get(name, 5)
        others = {"quick": 4.0, "endurance": 120.0, "repeatability": 63.0}
        others |= dict.fromkeys(("paper", "fair", "estimators", "table", "table-tuned"), 10.0)
        assert suite.duration == others.get(name, 30.0)
    numbers = {}
    for run in mm.load_suite("paper").runs():
        numbers.setdefault((run.robot, run.task, run.duration), set()).add(run.placement)
    assert numbers == {
        ("youbot", "paper", 10.0): {0},
        ("tiago_no_hand", "circle", 30.0): set(range(5)),
    }
