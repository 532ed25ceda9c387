"""The report of suites of any size: who leads, what is drawn, and what is said of the rest."""

from __future__ import annotations

import csv
import math
import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner
from support.reported import lost_run, made_up_record, made_up_run, made_up_runs, results_of
from support.suites import small_suite

from mobman.benchmark.report import report
from mobman.benchmark.report.charts import (
    cell_figures,
    looks_for,
    periods_figure,
    sensitivity_figure,
)
from mobman.benchmark.report.data import read_results
from mobman.benchmark.report.findings import limitations_of, summary_lines
from mobman.benchmark.report.gains import settings_of, tuning_table, unequal_budgets
from mobman.benchmark.report.latex import escape, latex_table, write_latex
from mobman.benchmark.report.report import report_on, write_report
from mobman.benchmark.report.standings import EACH, MOST, board_of, prices_of, select
from mobman.benchmark.report.tables import (
    Entry,
    Table,
    endings_table,
    leaderboard_table,
    machines_table,
    metrics_table,
    pairs_table,
    saturation_table,
    summary_table,
    tuned_table,
)
from mobman.benchmark.store import Store
from mobman.benchmark.suite import load_suite
from mobman.benchmark.suite_tables import TunedFrom
from mobman.cli.bench import report_command
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.figures.files import Print

SUITE = {"name": "large", "description": "Made up"}
THREE = {"good": 1e-8, "fair": 2e-8, "poor": 1e-2}
SCENARIOS = ["nominal", *(f"changed-{i}" for i in range(23))]


def board(*rows):
    return board_of(results_of(*rows))


def said_of(*rows, **about):
    found = results_of(*rows, **about)
    return summary_lines(found, board_of(found))


def texts(row):
    return [entry.text for entry in row]


def test_the_leaderboard_ranks_as_far_as_the_cells_settle_it():
    found = board(made_up_runs(THREE, SCENARIOS))
    assert [(s.label, s.ranks) for s in found.standings] == [
        ("good", (1, 1)),
        ("fair", (2, 2)),
        ("poor", (3, 3)),
    ]
    good = found.standings[0]
    assert good.error.low <= good.error.estimate <= good.error.high
    assert (good.solved, good.cells) == (24, 24)
    assert good.rate.low < 1.0
    same = made_up_runs({"one": 1e-8, "other": 1e-8}, SCENARIOS)
    assert {s.ranks for s in board(same).standings} == {(1, 2)}
    few = made_up_runs(THREE, SCENARIOS[:3])
    assert {s.ranks for s in board(few).standings} == {(1, 3)}


def test_failures_count_and_are_counted():
    runs = made_up_runs(THREE, SCENARIOS)
    lost = [run for run in runs if run["label"] == "good"][:18]
    failures = [lost_run(run, "out of memory") for run in lost[:17]]
    failures.append(lost_run(lost[17], "not done yet", pending=True))
    kept = [run for run in runs if run not in lost]
    found = board(kept, failures)
    good = next(s for s in found.standings if s.label == "good")
    assert math.isinf(good.error.estimate)
    assert (good.solved, good.cells, good.asked, good.lost) == (6, 23, 23, 17)
    row = next(row for row in leaderboard_table(found).rows if row[1].text == "good")
    assert row[-2].text == "17 without result"
    said = "\n".join(said_of(kept, failures))
    assert "17 runs gave no result" in said
    assert "Preliminary: 1 run was not done yet; only the 23 cells" in said


def test_seeds_are_no_cells_and_the_worst_of_them_counts():
    runs = [
        made_up_run("a", 1e-8 * 10.0**seed, scenario=scenario, seed=seed)
        for scenario in SCENARIOS
        for seed in range(3)
    ]
    found = results_of(runs)
    first = board_of(found).standings[0]
    assert first.cells == len(SCENARIOS)
    assert first.asked == 3 * len(SCENARIOS)
    np.testing.assert_allclose(found.errors, 1e-6)
    runs[4] = made_up_run("a", math.inf, scenario=SCENARIOS[1], seed=1)
    found = results_of(runs)
    assert math.isinf(found.errors.iloc[1, 0])
    assert board_of(found).standings[0].solved == len(SCENARIOS) - 1


def test_only_cells_in_which_all_ran_are_compared():
    runs = made_up_runs(THREE, SCENARIOS)
    runs += made_up_runs({"elsewhere": 1e-12}, ["another"])
    found = board(runs)
    assert found.labels == list(THREE)
    assert found.others == ["elsewhere"]
    assert (len(found.cells), found.asked) == (24, 25)
    assert found.standings[-1].label == "elsewhere"
    assert found.standings[-1].ranks is None
    assert [s.ranks for s in found.standings[:3]] == [(1, 1), (2, 2), (3, 3)]


def test_families_have_standings_of_their_own():
    runs = [
        {**run, "family": run["scenario"].partition("-")[0]}
        for run in made_up_runs(THREE, SCENARIOS)
    ]
    families = board(runs).families
    assert {name: found["good"].cells for name, found in families.items()} == {
        "nominal": 1,
        "changed": 23,
    }
    assert families["changed"]["good"].ranks == (1, 1)
    assert families["nominal"]["good"].ranks == (1, 3)  # one cell settles nothing


def test_pairs_are_compared_by_cell():
    table = pairs_table(board(made_up_runs(THREE, SCENARIOS)).pairs)
    rows = {row[0].text: texts(row[1:]) for row in table.rows}
    assert set(rows) == {"good – fair", "good – poor", "fair – poor"}
    cells, wins, difference, _, p, effect, solved, solved_p, says = rows["good – poor"]
    assert (cells, wins, p, effect) == ("24", "24 / 0 / 0", "< 0.001", "−1.00")
    assert (solved, solved_p) == ("22 / 0", "< 0.001")
    assert says == "good has the smaller error and solves more"
    assert rows["good – fair"][-3:] == ["0 / 0", "1.000", "good has the smaller error"]
    assert -6.2 < float(difference.replace("−", "-")) < -5.8


def test_a_difference_that_is_sure_and_nothing_is_called_alike():
    random = np.random.default_rng(0)
    runs = []
    for scenario in SCENARIOS:
        error = 10.0 ** random.normal(-6.0, 1.0)
        runs.append(made_up_run("one", error, scenario=scenario))
        runs.append(made_up_run("other", 1.001 * error, scenario=scenario))
    pairs = board(runs).pairs
    assert pairs[0].error_p < 0.001
    assert pairs_table(pairs).rows[0][-1].text == "errors alike"


def test_what_is_not_done_is_no_failure():
    runs = made_up_runs(THREE, SCENARIOS)
    late = [run for run in runs if run["label"] == "poor"][12:]
    failures = [lost_run(run, "not done yet", pending=True) for run in late]
    kept = [run for run in runs if run not in late]
    found = board(kept, failures)
    assert (len(found.cells), found.pending) == (12, 12)
    assert all(math.isfinite(standing.error.estimate) for standing in found.standings)
    assert {standing.asked for standing in found.standings} == {12}
    said = said_of(kept, failures)
    assert said[1].startswith("Preliminary: 12 runs were not done yet; only the 12 cells")
    assert not any("finish" in line or "no result" in line for line in said)
    column = [row[3] for row in summary_table(results_of(kept, failures), "youbot, circle").rows]
    assert [entry.mark for entry in column if entry.text == "not run"] == ["faint"] * 12
    assert column[-1].text.endswith(" of 12")
    # where nothing is done in full, nothing is compared
    none = [
        lost_run({**run, "label": "late"}, "", pending=True)
        for run in runs
        if run["label"] == "good"
    ]
    assert board(runs, none).standings == []
    assert "nothing is compared" in "\n".join(said_of(runs, none))


def test_the_summary_of_odd_results():
    """Nothing tried, a success of its own for each of many, and none that completes every cell."""
    runs = made_up_runs(THREE, SCENARIOS[:2])
    said = said_of([lost_run(run, "not done yet", pending=True) for run in runs])
    assert said[-1] == "No run was tried yet."
    runs = [
        made_up_run(f"law{i}", 1e-8 if j < i else 1e-2, scenario=scenario)
        for i in range(9)
        for j, scenario in enumerate(SCENARIOS[:9])
    ]
    assert "law4 in 4 of 9; …; law0 in none of 9." in "\n".join(said_of(runs))
    ends = {("a", 2): math.inf, ("b", 2): math.inf}
    runs = [
        made_up_run(label, ends.get((label, j), 1e-8), scenario=scenario)
        for label in "abc"
        for j, scenario in enumerate(SCENARIOS[:4])
        if (label, j) != ("c", 3)
    ]
    alone = "youbot, circle: of a and b, which alone ran in every cell, none completes all."
    assert alone in said_of(runs)


def test_the_leader_in_error_need_not_solve_most():
    errors = {"sharp": 1e-9, "steady": 1e-8}
    runs = made_up_runs(errors, SCENARIOS)
    ended = [run for run in runs if run["label"] == "sharp"][:3]
    runs = [
        made_up_run("sharp", math.inf, scenario=run["scenario"]) if run in ended else run
        for run in runs
    ]
    said = "\n".join(said_of(runs))
    assert "sharp has the smallest steady |e^e|" in said
    assert "sharp solves 21 of 24 cells" in said
    assert "most are solved by steady: 24" in said


def test_the_summary_is_short_for_any_suite():
    robots = [f"robot-{i}" for i in range(3)]
    labels = {f"law-{i}": 10.0 ** (-9 + i) for i in range(9)}
    runs = made_up_runs(labels, SCENARIOS[:5], robots)
    runs += [made_up_run(label, math.inf, scenario="hard") for label in labels]
    failures = [lost_run({**runs[0], "seed": 1}, "out of memory")]
    failures.append(lost_run({**runs[-1], "label": "law-0", "seed": 1}, "", pending=True))
    lines = said_of(runs, failures)
    assert len(lines) <= 10
    assert max(map(len, lines)) < 500
    assert "and 4 more" in "\n".join(lines)


def test_cut_torques_are_shown_and_said_of_failures():
    cut_run = made_up_run("a", 1e-9, scenario="weak")
    cut_run["metrics"] |= {"saturation_share": 0.25, "saturation_start": 0.125}
    runs = [
        made_up_run("a", 1e-9),
        cut_run,
        made_up_run("b", 1e-9, scenario="weak"),
        made_up_run("c", math.inf, scenario="weak"),
    ]
    runs[3]["metrics"] |= {"saturation_share": 1.0, "saturation_start": 0.0}
    (row,) = saturation_table(results_of(runs)).rows
    assert texts(row) == ["weak", "25 %", "0 %", "100 %"]
    assert row[1].unit == "1 of 1 runs, from 0.125 s"
    (ended,) = endings_table(results_of(runs)).rows
    assert ended[-2].text == "0.25 s"
    assert ended[-1].text == "at t = 0.25 s: |z| is 1e9; torques were cut from 0 s on"
    assert saturation_table(results_of(runs[:1])) is None


def test_runs_beyond_the_robots_limits_are_counted_and_marked():
    runs = made_up_runs({"a": 1e-9, "b": 1e-8}, SCENARIOS)
    runs[0]["metrics"] |= {"time_beyond_limits": 0.5, "position_limit_excess": 0.2}
    found = results_of(runs)
    board = leaderboard_table(board_of(found))
    assert board.columns[-1].text == "of these, beyond limits"
    assert {row[1].text: (row[-1].text, row[-1].mark) for row in board.rows} == {
        "a": ("1", "bad"),
        "b": ("0", "faint"),
    }
    marked = [
        entry
        for row in summary_table(found, found.groups[0]).rows
        for entry in row
        if entry.unit == "beyond limits"
    ]
    assert [entry.mark for entry in marked] == ["bad"]
    cell = found.runs.cell[found.runs.beyond].iloc[0]
    rows = {row[0].text: row[2:] for row in metrics_table(found, cell).rows if len(row) > 2}
    assert [entry.mark == "bad" for entry in rows["position_limit_excess"]] == [True, False]
    assert [entry.mark == "bad" for entry in rows["time_beyond_limits"]] == [True, False]


def test_the_front_is_of_those_that_none_beats():
    costs = {"good": 9.0, "fair": 20.0, "poor": 1.0}
    runs = made_up_runs(THREE, SCENARIOS)
    for run in runs:
        run["metrics"]["torque_energy"] = costs[run["label"]]
    found = results_of(runs)
    prices = {p.label: p for p in prices_of(found, board_of(found), "torque_energy")}
    assert {label: price.front for label, price in prices.items()} == {
        "good": True,
        "fair": False,
        "poor": True,
    }
    assert prices["good"].effort.estimate == pytest.approx(9.0)


def test_a_suite_of_many_cells_is_whole_in_its_tables_and_selected_in_its_figures(tmp_path):
    loads = []

    def load():
        loads.append(1)
        return made_up_record()

    robots = [f"robot-{i}" for i in range(18)]
    runs = [
        {**run, "load": load}
        for run in made_up_runs({"good": 1e-8, "poor": 1e-2}, SCENARIOS, robots)
    ]
    assert len(runs) / 2 > MOST
    written = write_report(tmp_path, results_of(runs, **SUITE))
    html = written.html.read_text(encoding="utf-8")
    assert len(html) < 15e6
    assert len(written.markdown.read_text(encoding="utf-8")) < 15_000
    # samples are read of what is drawn alone, each of them once
    assert len(loads) <= 2 * 4 * EACH
    assert html.count('<details class="cell">') >= 3 * EACH
    assert f"Of {len(runs) // 2} cells," in html
    assert "mobman bench report DIR --cell" in html
    # every cell stays in the tables, and every run in the list
    results = html[html.index('id="results"') : html.index('id="cells"')]
    for scenario in SCENARIOS:
        assert results.count(f'<th scope="row">{scenario}<') == len(robots)
    with written.csv.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(runs)
    assert float(rows[0]["task_error_max"]) == runs[0]["metrics"]["task_error_max"]


def test_cells_in_between_are_all_drawn_small(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "_BUDGET", 10_000)
    runs = made_up_runs({"good": 1e-8, "poor": 1e-2}, [f"s{i}" for i in range(6)])
    written = write_report(tmp_path, results_of(runs))
    html = written.html.read_text(encoding="utf-8")
    for what in ("task error", "auxiliary error", "torque"):
        assert html.count(f'aria-label="Norm of the {what} against time') == 6


def test_figures_of_all_cells_keep_to_their_bytes(monkeypatch):
    """Also where nothing can be left out of a curve, as of noise."""
    random = np.random.default_rng(0)

    def noisy():
        n = 600
        torque = random.standard_normal((n, 8))
        return made_up_record(
            n,
            torque=torque,
            task_error=random.random((n, 3)),
            velocity_names=[f"v{i}" for i in range(8)],
        )

    runs = made_up_runs({"good": 1e-8, "poor": 1e-2}, [f"s{i}" for i in range(8)])
    runs = [{**run, "load": noisy} for run in runs]
    found = results_of(runs)
    sizes = []
    for budget in (report._BUDGET, 850_000):
        monkeypatch.setattr(report, "_BUDGET", budget)
        drawn = report._drawn(found, looks_for(found), list(found.cells.index), None)
        sizes.append(sum(map(report._size, drawn.values())))
    assert sizes[0] > 850_000
    assert sizes[1] < 850_000


def test_cells_can_be_asked_for_by_name(tmp_path):
    found = results_of(made_up_runs(THREE, SCENARIOS))
    chosen = select(found, ["*, changed-1"]).cells
    assert list(found.cells.variant[chosen]) == ["changed-1"]
    with pytest.raises(UsageError, match="near it are: youbot, circle, changed-"):
        select(found, ["youbot, circle, changed-x"])
    html = write_report(tmp_path, found, ["*, changed-2?"]).html.read_text(encoding="utf-8")
    assert html.count('<details class="cell">') == 3


def test_sampling_periods_are_cells_and_have_a_figure():
    periods = (1e-3, 2e-3, 5e-3)
    runs = [
        made_up_run(label, error * dt**2 if dt < 4e-3 or label == "a" else math.inf, dt=dt)
        for dt in periods
        for label, error in (("a", 1.0), ("b", 1e3))
    ]
    found = results_of(runs)
    assert list(found.cells.variant) == ["nominal, dt 1 ms", "nominal, dt 2 ms", "nominal, dt 5 ms"]

    def points(*rows):
        """Where each controller is drawn, and where it fails, by the sampling period (ms)."""
        found = results_of(*rows)
        figure = periods_figure(found, looks_for(found))
        if figure is None:
            return None
        assert [k["encoding"]["x"]["scale"]["type"] for k in _lines(figure.charts[0])] == ["log"]
        drawn = figure.charts[0]["data"]["values"]
        return {(p["label"], p["at"]): math.inf if p["failed"] else p["error"] for p in drawn}

    a = {("a", 1.0): 1e-6, ("a", 2.0): 4e-6, ("a", 5.0): 25e-6}
    b = {("b", 1.0): 1e-3, ("b", 2.0): 4e-3, ("b", 5.0): math.inf}
    assert points(runs) == a | b
    assert points(runs[:2]) is None
    # a scenario at one period alone is not mixed with those that have all
    more = [*runs, made_up_run("a", 0.5, scenario="hard"), made_up_run("a", 0.5, scenario="harder")]
    assert points(more) == a | b
    # points of what is not done are not there, nor is a figure without any
    todo = [lost_run({**run, "seed": 1}, "", pending=True) for run in runs if run["label"] == "a"]
    assert points(runs, todo) == b
    todo += [lost_run({**run, "seed": 1}, "", pending=True) for run in runs if run["label"] == "b"]
    assert points(runs, todo) is None
    backwards = results_of(runs[::-1]).cells
    assert list(backwards.dt) == sorted(periods)


def test_a_number_that_a_grid_sweeps_has_a_figure():
    runs = [
        made_up_run(label, error * value, scenario=f"payload-{value:g}", family="payload")
        for value in (0.5, 1.0, 2.0)
        for label, error in (("a", 1e-6), ("b", 1e-3))
    ]
    found = results_of(runs, [made_up_run("a", 1e-9), made_up_run("b", 1e-9)])
    figure = sensitivity_figure(found, looks_for(found))
    (chart,) = figure.charts
    assert chart["title"] == "payload"
    drawn = {(p["label"], p["at"]): p["error"] for p in chart["data"]["values"]}
    assert drawn == {(n, v): e * v for v in (0.5, 1.0, 2.0) for n, e in (("a", 1e-6), ("b", 1e-3))}
    words = [{**run, "scenario": run["scenario"].replace("1", "one")} for run in runs]
    assert sensitivity_figure(results_of(words), looks_for(found)) is None


def _lines(spec):
    return [
        layer
        for layer in spec["layer"]
        if layer["mark"]["type"] == "line" and "color" in layer["encoding"]
    ]


def test_samples_that_cannot_be_read_are_said_and_the_rest_is_drawn(tmp_path):
    def broken():
        raise RecordError("runs/x.h5 is not a whole record: its filter fails")

    runs = [made_up_run("a", 1e-9), made_up_run("b", 1e-6, load=broken)]
    html = write_report(tmp_path, results_of(runs)).html.read_text(encoding="utf-8")
    assert "its samples cannot be read: runs/x.h5 is not a whole record" in html
    assert "1 file in the folder could not be used in full" in html
    assert html.count('aria-label="Norm of the task error') == 1


def test_curves_keep_their_shape_with_few_points():
    n = 4001
    t = np.linspace(0.0, 1.0, n)
    error = 1e-3 * (1.0 + 0.9 * np.sin(300.0 * t))
    error[1000:1100] = np.nan
    record = made_up_record(
        n, t=t, task_error=np.stack([error, 0.0 * t], axis=1), torque=np.ones((n, 2))
    )
    found = results_of([made_up_run("a", 1e-3, load=lambda: record)])
    (figure,) = cell_figures(found, 0, looks_for(found), 200, 0)
    curves = [chart["data"]["values"] for chart in figure.charts]
    assert all(len(rows) == 1 for rows in curves)
    drawn = curves[0][0]
    assert len(drawn["t"]) == len(drawn["y"])
    assert 100 < len(drawn["t"]) < 850
    gaps = [x for x, y in zip(drawn["t"], drawn["y"], strict=True) if y is None]
    assert gaps
    assert all(t[1000] <= x <= t[1099] for x in gaps)
    assert max(y for y in drawn["y"] if y) == pytest.approx(1.9e-3, rel=1e-3)
    assert len(curves[2][0]["t"]) < 20  # a level line


def test_tuned_gains_show_their_budget():
    runs = made_up_runs({"pinv": 1e-3, "pinv-tuned": 1e-4}, SCENARIOS[:2])
    origin = TunedFrom(
        label="pinv",
        trials=30,
        trial=12,
        objective="error",
        score_default=-2.0,
        score=-4.5,
        space={"K_p": {"low": 1.0, "high": 100.0, "log": True}},
    )
    tuned = {"pinv-tuned": origin}
    remarks = {item.label: item.remark for item in settings_of(results_of(runs, tuned=tuned))}
    assert remarks["pinv-tuned"].startswith("Tuned from pinv in 30 trials.")
    assert "Tuned" not in remarks["pinv"]
    row = tuning_table(tuned).rows[0]
    assert texts(row[1:]) == [
        "pinv", "30", "12", "error", "-2.00", "-4.50", "K_p 1 to 100",
    ]  # fmt: skip
    assert tuning_table({}) is None
    assert unequal_budgets(tuned) == ""
    other = {"x-tuned": origin.model_copy(update={"trials": 300})}
    assert "not equal" in unequal_budgets(tuned | other)
    found = results_of(runs, tuned=tuned)
    (row,) = tuned_table(found, board_of(found)).rows
    assert row[0].text == "pinv"
    better, solved, ended, energy = texts(row[3:])
    assert (better, ended, energy) == ("2 / 0 / 0", "0 → 0 of 2", "1.0")
    assert solved.startswith("0 → ")
    said = "\n".join(summary_lines(found, board_of(found)))
    assert "like with like: with tuned gains pinv-tuned" in said
    looks = looks_for(found)
    assert looks["pinv"].colour == looks["pinv-tuned"].colour
    assert looks["pinv-tuned"].dashes != looks["pinv"].dashes
    assert "No controller was tuned" in "\n".join(limitations_of(results_of(runs)))
    assert "No controller was tuned" not in "\n".join(limitations_of(found))


def test_a_law_that_does_not_say_what_it_uses_is_not_said_to_do_without():
    laws = {"tsm": "tsm", "mine": "a-law-of-somebody", "pinv": "pseudo-inverse"}
    runs = [made_up_run(label, 1e-6, law=law, acceleration="exact") for label, law in laws.items()]
    text = "\n".join(limitations_of(results_of(runs)))
    assert "tsm use it; pinv do not and mine do not say whether they do." in text


def test_machines_are_those_of_the_records():
    known = {"processor": "A 1", "architecture": "x86_64", "system": "Linux"}
    runs = [made_up_run("a", 1e-9, machine=known, seed=seed) for seed in range(2)]
    runs.append(made_up_run("b", 1e-9))
    rows = [texts(row) for row in machines_table(results_of(runs)).rows]
    assert rows == [["A 1", "x86_64", "Linux", "2"], ["unknown", "unknown", "unknown", "1"]]


# Folders -----------------------------------------------------------------------------------------


@pytest.fixture
def results(tmp_path):
    """A folder of 8 runs that were never computed."""
    suite = load_suite(small_suite(tmp_path))
    store = Store(tmp_path / "results")
    runs = suite.runs()
    store.begin(suite, runs)
    for run in runs:
        what = {"scenario": run.scenario["name"], "controller": run.law, "spec": run.as_dict()}
        made_up_record(seed=run.seed, **what).save(store.path(run))
    store.rebuild_index()
    return store


def test_files_that_are_no_records_are_listed_and_the_others_are_used(results):
    import h5py

    whole, cut, old, other, gone = (results.path(run) for run in results.runs[:5])
    stranger = whole.with_name("0123456789abcdef.h5")
    shutil.copy(whole, stranger)
    whole.with_name("notes.txt").write_text("mine")
    cut.write_bytes(cut.read_bytes()[:3000])
    with h5py.File(old, "r+") as file:
        file.attrs["schema_version"] = 0
    shutil.copy(results.path(results.runs[7]), other)  # of another scenario
    gone.unlink()
    found = read_results(results)
    assert sorted(found.runs.state) == ["done"] * 4 + ["failed"] * 3 + ["not run"]
    reasons = found.unused
    assert set(reasons) == {f"runs/{path.name}" for path in (cut, old, other, stranger)} | {
        "runs/notes.txt"
    }
    assert "not a readable HDF5 file" in reasons[f"runs/{cut.name}"]
    assert "has schema version 0" in reasons[f"runs/{old.name}"]
    assert "is another run's record" in reasons[f"runs/{other.name}"]
    assert "does not ask for" in reasons[f"runs/{stranger.name}"]
    html = report_on(results.folder).html.read_text(encoding="utf-8")
    assert "5 files in the folder could not be used in full" in html
    assert "has schema version 0" in html


def test_a_report_elsewhere_leaves_the_folder_as_it_is(results, tmp_path):
    before = {path: path.stat().st_mtime_ns for path in results.folder.rglob("*")}
    elsewhere = tmp_path / "out" / "report"
    done = CliRunner().invoke(report_command, [str(results.folder), "-o", str(elsewhere)])
    assert done.exit_code == 0, done.output
    assert str(elsewhere / "report.html") in done.output
    assert {path: path.stat().st_mtime_ns for path in results.folder.rglob("*")} == before
    html = (elsewhere / "report.html").read_text(encoding="utf-8")
    links = re.findall(r'href="(\.\./[^"]+\.h5)"', html)
    assert len(set(links)) == 8
    assert all((elsewhere / link).is_file() for link in links)


def test_a_folder_that_cannot_be_written_is_said_with_the_way_out(results, monkeypatch):
    def refused(self, *args, **kwargs):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr("pathlib.Path.write_bytes", refused)
    with pytest.raises(MobmanError, match="Permission denied; another folder can be given with -o"):
        report_on(results.folder)


# LaTeX -------------------------------------------------------------------------------------------


def test_latex_escapes_what_it_is_given():
    assert escape("50 % of a_b & {c} #1 ~x^2 \\d") == (
        r"50 \% of a\_b \& \{c\} \#1 \textasciitilde{}x\textasciicircum{}2 \textbackslash{}d"
    )
    assert escape("1.5e-9 to ∞") == r"\num{1.5e-9} to $\infty$"
    assert escape("1.5e-9 to 0.2") == r"\numrange{1.5e-9}{0.2}"
    assert escape("0.52") == r"\num{0.52}"
    assert escape("−0.23 to −0.01") == r"\numrange{-0.23}{-0.01}"
    assert escape("0 to 32 %") == r"\numrange{0}{32}\,\%"
    assert escape("|e^e| (m)") == r"$\lVert e^e\rVert$ (m)"
    rows = [[Entry("part_1")], [Entry("x_y"), Entry("1e-3", "best")]]
    table = Table("c", [Entry("a", number=False), Entry("b")], rows)
    assert latex_table(table).splitlines() == [
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"a & b \\",
        r"\midrule",
        r"\addlinespace \multicolumn{2}{l}{part\_1} \\",
        r"x\_y & {\boldmath\textbf{\num{1e-3}}} \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]


def test_one_winner_is_bold_and_only_where_the_intervals_allow_it():
    def bold(errors, cells):
        found = board_of(results_of(made_up_runs(errors, SCENARIOS[:cells])))
        return [row for row in latex_table(leaderboard_table(found)).splitlines() if "bold" in row]

    far = {"best": 1e-9, "one": 1e-2, "other": 1e-2}
    assert len(bold(far, 20)) == 1
    assert "best" in bold(far, 20)[0]
    assert bold(far, 3) == []
    assert bold({**far, "one": 1e-9}, 20) == []
    table = Table("c", [Entry("a")], [[Entry("1", "best")]])
    assert "bold" not in latex_table(table, winners=False)


def test_figures_are_of_the_columns_width_in_the_font(latex, tmp_path):
    how = Print("double", "serif", 9.0)
    write_latex(tmp_path, results_of(made_up_runs(THREE, SCENARIOS[:3])), (), how)
    for folder, inches, star in ((latex, 3.5, ""), (tmp_path, 7.16, "*")):
        for path in folder.glob("*.pdf"):
            content = path.read_bytes()
            width = float(re.search(rb"/MediaBox *\[ *0 0 ([0-9.]+)", content)[1])
            assert width == pytest.approx(72.0 * inches, abs=1.5), path.name
            assert b"Serif" in b"".join(re.findall(rb"/BaseFont */\S+", content))
        example = (folder / "example.tex").read_text(encoding="utf-8")
        assert rf"\begin{{figure{star}}}" in example
        captions = re.findall(r"\\caption\{(.*)\}", example)
        assert all("youbot" in caption and "circle" in caption for caption in captions)


def test_a_font_that_is_not_there_is_told(tmp_path):
    found = results_of(made_up_runs(THREE, SCENARIOS[:1]))
    with pytest.raises(UsageError, match="'Nowhere Sans' is not installed"):
        write_latex(tmp_path, found, (), Print(font="Nowhere Sans"))
    assert not list(tmp_path.iterdir())
    for wrong in ({"column": "triple"}, {"size": 1.0}):
        with pytest.raises(UsageError, match="allowed are"):
            Print(**wrong)


@pytest.fixture(scope="module")
def latex(tmp_path_factory):
    """A folder of LaTeX."""
    folder = tmp_path_factory.mktemp("latex")
    runs = [
        made_up_run(label, error * dt * 1e3, scenario=scenario, dt=dt)
        for dt in (1e-3, 2e-3)
        for scenario in ("nominal", "50 %_heavier & more")
        for label, error in (("tsm", 1e-9), ("p_inv", 1e-3), ("lost", math.inf))
    ]
    failure = lost_run({**runs[0], "scenario": "cold"}, "no <tip>")
    write_latex(folder, results_of(runs, [failure], **SUITE), (), Print("single", "serif", 9.0))
    return folder


def test_latex_is_whole(latex):
    example = (latex / "example.tex").read_text(encoding="utf-8")
    included = re.findall(r"\\input\{([^}]+)\}", example)
    assert {"leaderboard", "information", "comparisons", "results-1"} <= set(included)
    for name in included:
        content = (latex / f"{name}.tex").read_text(encoding="utf-8")
        columns = len(re.search(r"\\begin\{tabular\}\{([lr]+)\}", content)[1])
        whole = [line for line in content.splitlines() if line.endswith(r"\\")]
        rows = [line for line in whole if r"\multicolumn" not in line]  # titles of groups
        assert rows
        assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {columns - 1}
        assert content.count(r"\begin") == content.count(r"\end") == 1
        plain = re.sub(r"\\[\\{}%&#_$]", "", content)
        assert plain.count("{") == plain.count("}")
        assert plain.count("$") % 2 == 0
        assert not re.search(r"[%#_]", re.sub(r"\$[^$]*\$", "", plain))
        assert content.isascii()
    figures = re.findall(r"\\includegraphics\[[^]]*\]\{([^}]+)\}", example)
    assert {"leaderboard.pdf", "profiles.pdf", "pareto.pdf", "task-error.pdf"} <= set(figures)
    assert {"torque.pdf", "sampling-periods.pdf"} <= set(figures)
    for name in figures:
        assert (latex / name).read_bytes().startswith(b"%PDF")


def test_latex_compiles(latex):
    if shutil.which("pdflatex") is None and "MOBMAN_REQUIRE_LATEX" not in os.environ:
        pytest.skip("there is no pdflatex")
    assert "\\begin{table*}" in (latex / "example.tex").read_text(encoding="utf-8")  # wide ones
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "example.tex"],
        cwd=latex,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:]


def test_latex_is_of_the_cell_asked_for(tmp_path):
    with pytest.raises(UsageError, match="no cell has the name 'x'"):
        write_latex(tmp_path, results_of(made_up_runs(THREE, SCENARIOS[:2])), ["x"])
