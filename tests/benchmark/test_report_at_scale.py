"""The report of suites of any size: who leads, what is drawn, and what is said of the rest."""

from __future__ import annotations

import csv
import dataclasses
import math
import re
import shutil
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner
from support.reported import made_up_record, made_up_run, made_up_runs
from support.suites import small_suite

from mobman.benchmark.report.cells import groups_of
from mobman.benchmark.report.content import FailedRun, ReportedSuite
from mobman.benchmark.report.latex import escape, latex_table, write_latex
from mobman.benchmark.report.leaderboard import leaderboard_of
from mobman.benchmark.report.limitations import limitations_of
from mobman.benchmark.report.overview_charts import periods_chart, prices_of
from mobman.benchmark.report.provenance import machines_table
from mobman.benchmark.report.report import Request, write_report
from mobman.benchmark.report.scores import field_of
from mobman.benchmark.report.selection import EACH, MOST, select
from mobman.benchmark.report.settings import settings_of, tuning_table, unequal_budgets
from mobman.benchmark.report.standings_tables import leaderboard_table, pairs_table, tuned_table
from mobman.benchmark.report.style import styles_of
from mobman.benchmark.report.summary import summary_lines
from mobman.benchmark.report.svg.draw import draw
from mobman.benchmark.report.table import Entry, Row, Table, heading, text
from mobman.benchmark.report.tables import endings_table, saturation_table, summary_table
from mobman.benchmark.report.time_charts import compact_chart
from mobman.benchmark.reporting import read_results, report_on
from mobman.benchmark.store import Store
from mobman.benchmark.suite import load_suite
from mobman.cli.bench import report_command
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.simulation.run_spec import Cell

SUITE = ReportedSuite("large", "Made up")
THREE = {"good": 1e-8, "fair": 2e-8, "poor": 1e-2}
SCENARIOS = ["nominal", *(f"changed-{i}" for i in range(23))]


def standings(runs, failures=()):
    groups = groups_of(runs, failures)
    field = field_of(groups)
    return field, leaderboard_of(field, groups)


def test_the_leaderboard_ranks_as_far_as_the_cells_settle_it():
    _, board = standings(made_up_runs(THREE, SCENARIOS))
    assert [(s.label, s.ranks) for s in board.standings] == [
        ("good", (1, 1)),
        ("fair", (2, 2)),
        ("poor", (3, 3)),
    ]
    good = board.standings[0]
    assert good.error.low <= good.error.estimate <= good.error.high
    assert (good.solved, good.cells) == (24, 24)
    assert good.rate.low < 1.0
    same = made_up_runs({"one": 1e-8, "other": 1e-8}, SCENARIOS)
    assert {s.ranks for s in standings(same)[1].standings} == {(1, 2)}
    few = made_up_runs(THREE, SCENARIOS[:3])
    assert {s.ranks for s in standings(few)[1].standings} == {(1, 3)}


def test_failures_count_and_are_counted():
    runs = made_up_runs(THREE, SCENARIOS)
    lost = [run for run in runs if run.label == "good"][:18]
    failures = [FailedRun("good", run.cell, run.seed, "out of memory") for run in lost[:17]]
    failures.append(FailedRun("good", lost[17].cell, 0, "not done yet", pending=True))
    kept = [run for run in runs if run not in lost]
    _, board = standings(kept, failures)
    good = next(s for s in board.standings if s.label == "good")
    assert math.isinf(good.error.estimate)
    assert (good.solved, good.cells, good.asked, good.lost) == (6, 23, 23, 17)
    row = next(row for row in leaderboard_table(board).rows if row.entries[0].text == "good")
    assert row.entries[-1].text == "17 without result"
    groups = groups_of(kept, failures)
    said = "\n".join(summary_lines(groups, kept, failures, *standings(kept, failures)))
    assert "17 runs gave no result" in said
    assert "Preliminary: 1 run was not done yet; only the 23 cells" in said


def test_seeds_are_no_cells_and_the_worst_of_them_counts():
    runs = [
        made_up_run("a", 1e-8 * 10.0**seed, scenario=scenario, seed=seed)
        for scenario in SCENARIOS
        for seed in range(3)
    ]
    field, board = standings(runs)
    assert board.standings[0].cells == len(SCENARIOS)
    assert board.standings[0].asked == 3 * len(SCENARIOS)
    np.testing.assert_allclose(field.errors(), 1e-6)
    runs[4] = made_up_run("a", math.inf, scenario=SCENARIOS[1], seed=1)
    field, board = standings(runs)
    assert math.isinf(field.errors()[0, 1])
    assert board.standings[0].solved == len(SCENARIOS) - 1


def test_only_what_all_were_asked_for_is_compared():
    runs = made_up_runs(THREE, SCENARIOS)
    runs += made_up_runs({"elsewhere": 1e-12}, ["another"])
    field, board = standings(runs)
    assert field.labels == tuple(THREE)
    assert field.others == ("elsewhere",)
    assert (len(field.cells), field.asked) == (24, 25)
    assert board.standings[-1].label == "elsewhere"
    assert board.standings[-1].ranks is None
    assert [s.ranks for s in board.standings[:3]] == [(1, 1), (2, 2), (3, 3)]


def test_families_have_standings_of_their_own():
    runs = [
        dataclasses.replace(run, family=run.cell.scenario.partition("-")[0])
        for run in made_up_runs(THREE, SCENARIOS)
    ]
    _, board = standings(runs)
    assert {item.family: len(item.cells) for item in board.families} == {
        "nominal": 1,
        "changed": 23,
    }
    assert board.families[1].standings["good"].ranks == (1, 1)
    assert board.families[0].standings["good"].ranks == (1, 3)  # one cell settles nothing


def test_pairs_are_compared_by_cell():
    _, board = standings(made_up_runs(THREE, SCENARIOS))
    table = pairs_table(board.pairs)
    rows = {row.head.text: [entry.text for entry in row.entries] for row in table.rows}
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
    _, board = standings(runs)
    assert board.pairs[0].error_p < 0.001
    assert pairs_table(board.pairs).rows[0].entries[-1].text == "errors alike"


def test_what_is_not_done_is_no_failure():
    runs = made_up_runs(THREE, SCENARIOS)
    late = [run for run in runs if run.label == "poor"][12:]
    failures = [FailedRun("poor", run.cell, 0, "not done yet", pending=True) for run in late]
    kept = [run for run in runs if run not in late]
    groups = groups_of(kept, failures)
    field, board = standings(kept, failures)
    assert (len(field.cells), field.pending) == (12, 12)
    assert all(math.isfinite(standing.error.estimate) for standing in board.standings)
    assert {standing.asked for standing in board.standings} == {12}
    said = summary_lines(groups, kept, failures, field, board)
    assert said[1].startswith("Preliminary: 12 runs were not done yet; only the 12 cells")
    assert not any("finish" in line or "no result" in line for line in said)
    column = [row.entries[2] for row in summary_table(groups[0]).rows]
    assert [entry.mark for entry in column if entry.text == "not run"] == ["faint"] * 12
    assert column[-1].text.endswith(" of 12")
    # where nothing is done in full, nothing is compared
    none = [FailedRun("late", run.cell, 0, "", pending=True) for run in runs if run.label == "good"]
    field, board = standings(runs, none)
    assert board.standings == []
    assert "nothing is compared" in "\n".join(
        summary_lines(groups_of(runs, none), runs, none, field, board)
    )


def test_the_leader_in_error_need_not_solve_most():
    errors = {"sharp": 1e-9, "steady": 1e-8}
    runs = made_up_runs(errors, SCENARIOS)
    ended = [run for run in runs if run.label == "sharp"][:3]
    runs = [
        made_up_run("sharp", math.inf, scenario=run.cell.scenario) if run in ended else run
        for run in runs
    ]
    field, board = standings(runs)
    said = "\n".join(summary_lines(groups_of(runs, []), runs, [], field, board))
    assert "sharp has the smallest steady |e^e|" in said
    assert "sharp solves 21 of 24 cells" in said
    assert "most are solved by steady: 24" in said


def test_the_summary_is_short_for_any_suite():
    robots = [f"robot-{i}" for i in range(3)]
    labels = {f"law-{i}": 10.0 ** (-9 + i) for i in range(9)}
    runs = made_up_runs(labels, SCENARIOS[:5], robots)
    runs += [made_up_run(label, math.inf, scenario="hard") for label in labels]
    failures = [FailedRun("law-0", runs[0].cell, 1, "out of memory")]
    failures.append(FailedRun("law-0", runs[-1].cell, 1, "", pending=True))
    field, board = standings(runs, failures)
    lines = summary_lines(groups_of(runs, failures), runs, failures, field, board)
    assert len(lines) <= 10
    assert max(map(len, lines)) < 500
    assert "and 4 more" in "\n".join(lines)


def test_cut_torques_are_shown_and_said_of_failures():
    cut_run = made_up_run("a", 1e-9, scenario="weak")
    found = {**cut_run.metrics, "saturation_share": 0.25, "saturation_start": 0.125}
    runs = [
        made_up_run("a", 1e-9),
        dataclasses.replace(cut_run, metrics=found),
        made_up_run("b", 1e-9, scenario="weak"),
        made_up_run("c", math.inf, scenario="weak"),
    ]
    runs[3] = dataclasses.replace(
        runs[3], metrics={**runs[3].metrics, "saturation_share": 1.0, "saturation_start": 0.0}
    )
    groups = groups_of(runs, [])
    (row,) = saturation_table(groups).rows
    assert row.head.text == "weak"
    assert [entry.text for entry in row.entries] == ["25 %", "0 %", "100 %"]
    assert row.entries[0].unit == "1 of 1 runs, from 0.125 s"
    (ended,) = endings_table(groups).rows
    assert ended.entries[-2].text == "0.25 s"
    assert ended.entries[-1].text == "at t = 0.25 s: |z| is 1e9; torques were cut from 0 s on"
    assert saturation_table(groups_of(runs[:1], [])) is None


def test_the_front_is_of_those_that_none_beats():
    costs = {"good": 9.0, "fair": 20.0, "poor": 1.0}
    runs = [
        dataclasses.replace(run, metrics={**run.metrics, "torque_energy": costs[run.label]})
        for run in made_up_runs(THREE, SCENARIOS)
    ]
    field, board = standings(runs)
    prices = {price.label: price for price in prices_of(field, board, "torque_energy")}
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
        dataclasses.replace(run, load=load)
        for run in made_up_runs({"good": 1e-8, "poor": 1e-2}, SCENARIOS, robots)
    ]
    assert len(runs) / 2 > MOST
    files = write_report(tmp_path, SUITE, runs)
    html = files.html.read_text(encoding="utf-8")
    assert len(html) < 15e6
    assert len(files.markdown.read_text(encoding="utf-8")) < 400_000
    # samples are read of what is drawn alone, each of them once
    assert len(loads) <= 2 * 4 * EACH
    assert html.count('<details class="cell">') >= 3 * EACH
    assert f"Of {len(runs) // 2} cells," in html
    assert "mobman bench report DIR --cell" in html
    # every cell stays in the tables, and every run in the list
    results = html[html.index('id="results"') : html.index('id="cells"')]
    for scenario in SCENARIOS:
        assert results.count(f'<th scope="row">{scenario}<') == len(robots)
    with files.csv.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(runs)
    assert float(rows[0]["task_error_max"]) == runs[0].metrics["task_error_max"]


def test_cells_in_between_are_all_drawn_small(tmp_path):
    runs = made_up_runs({"good": 1e-8, "poor": 1e-2}, [f"s{i}" for i in range(90)])
    html = write_report(tmp_path, SUITE, runs).html.read_text(encoding="utf-8")
    assert html.count('aria-label="Norms of task error, auxiliary error and torques') == 2 * 90


def test_cells_can_be_asked_for_by_name(tmp_path):
    groups = groups_of(made_up_runs(THREE, SCENARIOS), [])
    assert [cell.variant for cell in select(groups, ["*, changed-1"]).cells] == ["changed-1"]
    with pytest.raises(UsageError, match="near it are: youbot, circle, changed-"):
        select(groups, ["youbot, circle, changed-x"])
    files = write_report(
        tmp_path, SUITE, made_up_runs(THREE, SCENARIOS), request=Request(("*, changed-2?",))
    )
    html = files.html.read_text(encoding="utf-8")
    assert html.count('<details class="cell">') == 3


def test_sampling_periods_are_cells_and_have_a_figure():
    periods = (1e-3, 2e-3, 5e-3)
    runs = [
        made_up_run(label, error * dt**2 if dt < 4e-3 or label == "a" else math.inf, dt=dt)
        for dt in periods
        for label, error in (("a", 1.0), ("b", 1e3))
    ]
    groups = groups_of(runs, [])
    assert [cell.variant for cell in groups[0].cells] == [
        "nominal, dt 1 ms",
        "nominal, dt 2 ms",
        "nominal, dt 5 ms",
    ]
    chart = periods_chart(groups, styles_of(["a", "b"], runs))
    curves = [
        item for item in chart.panels[0].items if hasattr(item, "y") and hasattr(item, "thin")
    ]
    np.testing.assert_allclose(curves[0].x, [1.0, 2.0, 5.0])
    np.testing.assert_allclose(curves[0].y, [1e-6, 4e-6, 25e-6])
    assert np.isnan(curves[1].y[2])
    assert chart.panels[0].x.log
    assert chart.panels[0].y.log
    assert periods_chart(groups_of(runs[:2], []), styles_of(["a", "b"], runs)) is None
    # a scenario at one period alone is not mixed with those that have all
    more = [*runs, made_up_run("a", 0.5, scenario="hard"), made_up_run("a", 0.5, scenario="harder")]
    again = periods_chart(groups_of(more, []), styles_of(["a", "b"], more)).panels[0].items
    curve = next(item for item in again if hasattr(item, "y") and hasattr(item, "thin"))
    np.testing.assert_allclose(curve.y, [1e-6, 4e-6, 25e-6])
    # points of what is not done are not there, nor is a figure without any
    todo = [FailedRun("a", run.cell, 1, "", pending=True) for run in runs if run.label == "a"]
    half = periods_chart(groups_of(runs, todo), styles_of(["a", "b"], runs)).panels[0].items
    assert sum(hasattr(item, "thin") for item in half) == 1
    todo += [FailedRun("b", run.cell, 1, "", pending=True) for run in runs if run.label == "b"]
    assert periods_chart(groups_of(runs, todo), styles_of(["a", "b"], runs)) is None
    backwards = groups_of(runs[::-1], [])[0].cells
    assert [cell.dt for cell in backwards] == sorted(periods)


def test_samples_that_cannot_be_read_are_said_and_the_rest_is_drawn(tmp_path):
    def broken():
        raise RecordError("runs/x.h5 is not a whole record: its filter fails")

    runs = [made_up_run("a", 1e-9), made_up_run("b", 1e-6, load=broken)]
    html = write_report(tmp_path, SUITE, runs).html.read_text(encoding="utf-8")
    assert "its samples cannot be read: runs/x.h5 is not a whole record" in html
    assert "1 file in the folder could not be used in full" in html
    assert html.count('aria-label="Norm of the task error') == 2  # the figure, and what scrolls it


def test_curves_keep_their_shape_and_stay_in_their_frame():
    from mobman.benchmark.report.curves import read_curves

    n = 4001
    t = np.linspace(0.0, 1.0, n)
    error = 1e-3 * (1.0 + 0.9 * np.sin(300.0 * t))
    error[1000:1100] = np.nan
    record = made_up_record(
        n, t=t, task_error=np.stack([error, 0.0 * t], axis=1), torque=np.ones((n, 2))
    )
    group = groups_of([made_up_run("a", 1e-3, load=lambda: record)], [])[0]
    runs = [made_up_run("a", 1e-3)]
    drawing = draw("x", compact_chart(read_curves(group.cells[0], 200, 0), styles_of(["a"], runs)))
    paths = re.findall(r'class="k0" d="([^"]+)"', drawing.body)
    assert paths[0].count("M") == 2  # a gap
    width = 10.0 * drawing.size[0]
    for path in paths:
        for start in re.findall(r"M(\d+) (\d+)", path):
            assert 0 <= int(start[0]) <= width
    points = len(re.findall(r"-?\d+", paths[0])) / 2
    assert 100 < points < 850
    straight = re.search(r"l(.*)", paths[2])[1]
    assert len(re.findall(r"-?\d+", straight)) == 2  # a level line is two points


def test_tuned_gains_show_their_budget():
    runs = made_up_runs({"pinv": 1e-3, "pinv-tuned": 1e-4}, SCENARIOS[:2])
    tuned = {
        "pinv-tuned": {
            "label": "pinv",
            "trials": 30,
            "trial": 12,
            "objective": "error",
            "score_default": -2.0,
            "score": -4.5,
            "space": {"K_p": {"low": 1.0, "high": 100.0, "log": True}},
        }
    }
    remarks = {item.label: item.remark for item in settings_of(groups_of(runs, []), tuned)}
    assert remarks["pinv-tuned"].startswith("Tuned from pinv in 30 trials.")
    assert "Tuned" not in remarks["pinv"]
    row = tuning_table(tuned).rows[0]
    assert [entry.text for entry in row.entries] == [
        "pinv", "30", "12", "error", "-2.00", "-4.50", "K_p 1 to 100",
    ]  # fmt: skip
    assert tuning_table({}) is None
    assert unequal_budgets(tuned) == ""
    other = {"x-tuned": {**tuned["pinv-tuned"], "trials": 300}}
    assert "not equal" in unequal_budgets(tuned | other)
    field, board = standings(runs)
    (row,) = tuned_table(field, board, tuned).rows
    assert row.head.text == "pinv"
    better, solved, ended, energy = (entry.text for entry in row.entries[2:])
    assert (better, ended, energy) == ("2 / 0 / 0", "0 → 0 of 2", "1.0")
    assert solved.startswith("0 → ")
    said = "\n".join(summary_lines(groups_of(runs, []), runs, [], field, board, tuned))
    assert "like with like: with tuned gains pinv-tuned" in said
    looks = styles_of(["pinv", "pinv-tuned"], runs, tuned)
    assert looks["pinv"].colour == looks["pinv-tuned"].colour
    assert looks["pinv-tuned"].hollow
    assert "No controller was tuned" in "\n".join(limitations_of(runs))
    assert "No controller was tuned" not in "\n".join(limitations_of(runs, tuned=True))


def test_machines_are_those_of_the_records():
    known = {"processor": "A 1", "architecture": "x86_64", "system": "Linux"}
    runs = [made_up_run("a", 1e-9, machine=known, seed=seed) for seed in range(2)]
    runs.append(made_up_run("b", 1e-9))
    rows = [[row.head.text, *(e.text for e in row.entries)] for row in machines_table(runs).rows]
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
        made_up_record(scenario=run.scenario["name"], seed=run.seed, controller=run.law).save(
            store.path(run)
        )
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
    assert len(found.runs) == 4
    assert len(found.failures) == 4
    assert [failure.pending for failure in found.failures] == [False, False, False, True]
    reasons = {item.file: item.reason for item in found.unused}
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

    monkeypatch.setattr("pathlib.Path.write_text", refused)
    with pytest.raises(MobmanError, match="Permission denied; another folder can be given with -o"):
        report_on(results.folder)


# LaTeX -------------------------------------------------------------------------------------------


def test_latex_escapes_what_it_is_given():
    assert escape("50 % of a_b & {c} #1 ~x^2 \\d") == (
        r"50 \% of a\_b \& \{c\} \#1 \textasciitilde{}x\textasciicircum{}2 \textbackslash{}d"
    )
    assert escape("1.5e-9 to ∞") == r"$1.5\cdot10^{-9}$ to $\infty$"
    assert escape("|e^e| (m)") == r"$\lVert e^e\rVert$ (m)"
    rows = [heading("part_1"), Row(text("x_y"), [Entry("1e-3", "best")])]
    table = Table("c", [text("a"), Entry("b")], rows)
    assert latex_table(table).splitlines() == [
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"a & b \\",
        r"\midrule",
        r"\addlinespace \multicolumn{2}{l}{part\_1} \\",
        r"x\_y & {\boldmath\textbf{$1\cdot10^{-3}$}} \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]


@pytest.fixture(scope="module")
def latex(tmp_path_factory):
    """A folder of LaTeX, and the state of matplotlib before and after."""
    import matplotlib

    from mobman.benchmark.report import pdf

    folder = tmp_path_factory.mktemp("latex")
    runs = [
        made_up_run(label, error * dt * 1e3, scenario=scenario, dt=dt)
        for dt in (1e-3, 2e-3)
        for scenario in ("nominal", "50 %_heavier & more")
        for label, error in (("tsm", 1e-9), ("p_inv", 1e-3), ("lost", math.inf))
    ]
    failures = [FailedRun("tsm", Cell("youbot", "circle", "cold", 1e-3, 1.0), 0, "no <tip>")]
    before = dict(matplotlib.rcParams)
    with pytest.MonkeyPatch.context() as patch:
        # fonts that are not cut to the letters in use take a tenth of the time
        patch.setitem(pdf._SETTINGS, "pdf.fonttype", 3)
        write_latex(folder, SUITE, runs, failures)
    assert dict(matplotlib.rcParams) == before
    return folder


def test_latex_is_whole(latex):
    example = (latex / "example.tex").read_text(encoding="utf-8")
    included = re.findall(r"\\input\{([^}]+)\}", example)
    assert {"leaderboard", "comparisons", "results-1"} <= set(included)
    for name in included:
        content = (latex / f"{name}.tex").read_text(encoding="utf-8")
        columns = len(re.search(r"\\begin\{tabular\}\{([lr]+)\}", content)[1])
        rows = [line for line in content.splitlines() if line.endswith(r"\\")]
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


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="there is no pdflatex")
def test_latex_compiles(latex):
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
        write_latex(tmp_path, SUITE, made_up_runs(THREE, SCENARIOS[:2]), [], ["x"])
