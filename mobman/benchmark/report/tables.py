"""The tables of results."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mobman.benchmark.report.cells import Cell, Group, unique
from mobman.benchmark.report.content import FailedRun, ReportedRun
from mobman.benchmark.report.format import (
    UNDEFINED,
    end_time,
    ending,
    instant,
    metric_unit,
    metric_value,
    number,
)
from mobman.benchmark.report.table import Entry, Row, Table, heading, text
from mobman.simulation.metrics.metric import Metric, list_metrics

_SECTIONS = {
    "tracking": "Tracking",
    "redundancy": "Redundancy",
    "effort": "Effort",
    "consistency": "Consistency of the simulation",
    "timing": "Computing time",
}
_NOT_RANKED = "consistency"  # says something of the integrator, not of the controller


def summary_table(group: Group) -> Table:
    """Controller x scenario: the largest steady task error, the worst of the seeds."""
    scenarios = [cell.scenario for cell in group.cells]
    columns = [text("controller"), *map(Entry, scenarios), Entry("succeeded")]
    best = {cell.scenario: _best_of_summary(cell, group.labels) for cell in group.cells}
    rows = []
    for label in group.labels:
        entries = [
            _summary_entry(cell.of(label), cell.failures_of(label), best[cell.scenario])
            for cell in group.cells
        ]
        won, asked = successes(group.cells, label)
        entries.append(Entry(f"{won} of {asked}", "" if won == asked else "bad"))
        rows.append(Row(text(label, label=label), entries))
    return Table("Largest |e^e| in the steady part (m)", columns, rows)


def successes(cells: Sequence[Cell], label: str) -> tuple[int, int]:
    """How many runs of a label succeeded, and how many were asked for."""
    runs = [run for cell in cells for run in cell.of(label)]
    lost = sum(len(cell.failures_of(label)) for cell in cells)
    return sum(run.succeeded for run in runs), len(runs) + lost


def worst_error(runs: Sequence[ReportedRun]) -> float:
    """The largest steady task error (m); inf where a run did not go to its end."""
    errors = [run.record.metrics.get("task_error_max", math.inf) for run in runs]
    return math.inf if any(math.isnan(error) for error in errors) else max(errors, default=math.inf)


def metrics_table(cell: Cell) -> Table:
    """Every metric of every run of a cell; failures have a column too."""
    seeds = {run.record.seed for run in cell.runs} | {lost.seed for lost in cell.failures}
    several = len(seeds) > 1
    columns = [text("metric"), text("unit")]
    outcomes = []
    for run in cell.runs:
        columns.append(Entry(_with_seed(run.label, run.record.seed, several), label=run.label))
        outcomes.append(Entry(ending(run), "" if run.record.ok else "bad", run.record.message))
    for lost in cell.failures:
        columns.append(Entry(_with_seed(lost.label, lost.seed, several), label=lost.label))
        outcomes.append(Entry("failed", "bad", lost.reason))
    rows = [Row(text("outcome"), [text(""), *outcomes])]
    section = ""
    for metric in _known(cell.runs):
        own = metric.function.__module__.rpartition(".")[2]
        if own != section:
            section = own
            rows.append(heading(_SECTIONS.get(own, "Other")))
        rows.append(_metric_row(metric, cell, ranked=own != _NOT_RANKED))
    links = [Entry("h5", link=run.file) for run in cell.runs]
    links += [Entry(UNDEFINED, "faint") for _ in cell.failures]
    rows += [heading("Data"), Row(text("record"), [text(""), *links])]
    if any(run.replay for run in cell.runs):
        replays = [
            Entry("replay", link=run.replay) if run.replay else Entry(UNDEFINED, "faint")
            for run in cell.runs
        ]
        replays += [Entry(UNDEFINED, "faint") for _ in cell.failures]
        rows.append(Row(text("page"), [text(""), *replays]))
    return Table(f"{cell.name}: every metric", columns, rows)


def failures_table(groups: Sequence[Group]) -> Table:
    """Every run that did not go to its end, with when and why."""
    columns = ["robot", "task", "scenario", "controller", "seed", "outcome", "at", "reason"]
    rows = []
    for cell in (cell for group in groups for cell in group.cells):
        for run in cell.runs:
            if run.record.ok:
                continue
            entries = [
                *_place(cell, run.label, run.record.seed),
                text(run.record.status, "bad"),
                Entry(instant(end_time(run))),
                text(run.record.message or "no reason given", link=run.file),
            ]
            rows.append(Row(text(cell.robot), entries))
        for failure in cell.failures:
            entries = [
                *_place(cell, failure.label, failure.seed),
                text("failed", "bad"),
                Entry(UNDEFINED),
                text(failure.reason or "no reason given"),
            ]
            rows.append(Row(text(cell.robot), entries))
    numbers = ("seed", "at")
    heads = [Entry(name, number=name in numbers) for name in columns]
    return Table("When and why each of them ended", heads, rows)


def replays_table(groups: Sequence[Group]) -> Table:
    """How to look at each run: the command, and the page where there is one."""
    paged = any(run.replay for group in groups for cell in group.cells for run in cell.runs)
    columns = ["robot", "task", "scenario", "controller", "seed", "outcome", "command"]
    rows = []
    for cell in (cell for group in groups for cell in group.cells):
        for run in cell.runs:
            if not run.command:
                continue
            entries = [
                *_place(cell, run.label, run.record.seed),
                text(ending(run), "" if run.record.ok else "bad"),
                text(run.command),
            ]
            if paged:
                entries.append(text("replay" if run.replay else UNDEFINED, link=run.replay))
            rows.append(Row(text(cell.robot), entries))
    heads = [Entry(name, number=name == "seed") for name in columns]
    heads += [text("page")] if paged else []
    return Table("How to look at each run", heads, rows)


def timing_table(groups: Sequence[Group]) -> Table:
    """What a control step costs: controller x robot, over all scenarios and seeds."""
    robots = unique([group.robot for group in groups])
    labels = unique([label for group in groups for label in group.labels])
    columns = [text("controller")]
    for robot in robots:
        columns += [Entry(f"{robot}: median"), Entry("99th percentile")]
    rows = []
    for label in labels:
        entries = []
        for robot in robots:
            runs = [
                run
                for group in groups
                if group.robot == robot
                for cell in group.cells
                for run in cell.of(label)
                if run.record.ok  # a few ticks before a divergence say nothing
            ]
            for name in ("compute_time_median", "compute_time_p99"):
                times = [run.record.metrics.get(name, math.nan) for run in runs]
                times = [time for time in times if math.isfinite(time)]
                value = float(np.median(times)) if times else math.nan
                entries.append(Entry(metric_value(name, value)))
        rows.append(Row(text(label, label=label), entries))
    return Table(
        "Time that the controller took for a tick (µs); median over the completed runs",
        columns,
        rows,
    )


def definitions_table() -> Table:
    """What the metrics are."""
    rows = [
        Row(
            text(metric.name),
            [text(metric.unit), text(metric.description), text(metric.better or UNDEFINED)],
        )
        for metric in _in_sections(list_metrics())
    ]
    columns = [text(name) for name in ("metric", "unit", "definition", "better")]
    return Table("Definitions of the metrics", columns, rows)


def _summary_entry(runs: Sequence[ReportedRun], failures: Sequence[FailedRun], best: str) -> Entry:
    if not runs and not failures:
        return Entry("not run", "faint")
    if failures:
        return Entry("failed", "bad", failures[0].reason)
    ended = [run for run in runs if not run.record.ok]
    if ended:
        some = f" ({len(ended)} of {len(runs)} seeds)" if len(runs) > 1 else ""
        return Entry(f"{ending(ended[0])}{some}", "bad", ended[0].record.message)
    error = number(worst_error(runs))
    if all(run.succeeded for run in runs):
        return Entry(error, "best" if error == best else "")
    return Entry(error, "bad", "|e^e| did not settle below 1e-4 m")


def _best_of_summary(cell: Cell, labels: Sequence[str]) -> str:
    errors = [
        worst_error(cell.of(label))
        for label in labels
        if cell.of(label) and not cell.failures_of(label)
    ]
    return number(min(errors, default=math.nan))


def _metric_row(metric: Metric, cell: Cell, *, ranked: bool) -> Row:
    values = [run.record.metrics.get(metric.name, math.nan) for run in cell.runs]
    # cheap motion is no merit of a run that misses its task
    rivals = [
        value
        for run, value in zip(cell.runs, values, strict=True)
        if run.succeeded and math.isfinite(value)
    ]
    best = ""
    if ranked and metric.better and metric.name != "success" and len(rivals) > 1:
        best = metric_value(metric.name, (max if metric.better == "higher" else min)(rivals))
    entries = []
    for run, value in zip(cell.runs, values, strict=True):
        shown = metric_value(metric.name, value)
        if math.isnan(value):
            entries.append(Entry(shown, "faint"))
        elif value == math.inf or metric.name == "success":
            entries.append(Entry(shown, "" if run.succeeded else "bad"))
        else:
            entries.append(Entry(shown, "best" if run.succeeded and shown == best else ""))
    entries += [Entry(UNDEFINED, "faint") for _ in cell.failures]
    unit = text(metric_unit(metric.name, metric.unit), "faint")
    return Row(text(metric.name, detail=metric.description), [unit, *entries])


def _known(runs: Sequence[ReportedRun]) -> list[Metric]:
    """The registered metrics, and what records hold beside them, of another version perhaps."""
    known = _in_sections(list_metrics())
    names = {metric.name for metric in known}
    others = unique([name for run in runs for name in run.record.metrics if name not in names])
    return known + [Metric(name, "", "not known to this version", "", _unknown) for name in others]


def _unknown(run: object) -> float:
    return math.nan


def _in_sections(metrics: Sequence[Metric]) -> list[Metric]:
    order = list(_SECTIONS)

    def place(metric: Metric) -> int:
        section = metric.function.__module__.rpartition(".")[2]
        return order.index(section) if section in order else len(order)

    return sorted(metrics, key=place)  # stable: by name within a section


def _place(cell: Cell, label: str, seed: int) -> list[Entry]:
    return [text(cell.task), text(cell.scenario), text(label, label=label), Entry(str(seed))]


def _with_seed(label: str, seed: int, several: bool) -> str:
    return f"{label}, seed {seed}" if several else label
