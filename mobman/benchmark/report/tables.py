"""The tables of results."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mobman.benchmark.report.cells import CellRuns, Group, unique
from mobman.benchmark.report.content import FailedRun, ReportedRun, UnusedFile
from mobman.benchmark.report.format import (
    UNDEFINED,
    cut,
    ending,
    instant,
    metric_unit,
    metric_value,
    number,
)
from mobman.benchmark.report.scores import worst_error
from mobman.benchmark.report.table import Entry, Row, Table, heading, text
from mobman.simulation.metrics import Metric, list_metrics

_SECTIONS = {
    "tracking": "Tracking",
    "redundancy": "Redundancy",
    "effort": "Effort",
    "consistency": "Consistency of the simulation",
    "timing": "Computing time",
}
_MOST_COLUMNS = 8  # scenarios that stand side by side
_LONGEST = 400  # characters of a reason
_NOT_RANKED = "consistency"  # says something of the integrator, not of the controller


def summary_table(group: Group) -> Table:
    """Controllers and scenarios of a group: the largest steady task error, the worst of the seeds.

    Scenarios are in columns, or in rows where there are many.
    """
    cells = group.cells
    best = {cell.cell: _best_of_summary(cell) for cell in cells}
    entries = {
        (cell.cell, label): _summary_entry(cell.of(label), cell.failures_of(label), best[cell.cell])
        for cell in cells
        for label in group.labels
    }
    score = {label: successes(cells, label) for label in group.labels}
    totals = [
        Entry(f"{won} of {asked}", "" if won == asked else "bad") for won, asked in score.values()
    ]
    caption = "Largest |e^e| in the steady part (m)"
    if len(cells) <= _MOST_COLUMNS:
        columns = [text("controller"), *(Entry(cell.variant) for cell in cells), Entry("succeeded")]
        rows = [
            Row(text(label, label=label), [*(entries[cell.cell, label] for cell in cells), total])
            for label, total in zip(group.labels, totals, strict=True)
        ]
        return Table(caption, columns, rows)
    columns = [text("scenario"), *(Entry(label, label=label) for label in group.labels)]
    rows = [
        Row(text(cell.variant), [entries[cell.cell, label] for label in group.labels])
        for cell in cells
    ]
    return Table(caption, columns, [*rows, Row(text("succeeded"), totals)])


def successes(cells: Sequence[CellRuns], label: str) -> tuple[int, int]:
    """How many runs of a label succeeded, and how many were tried."""
    runs = [run for cell in cells for run in cell.of(label)]
    lost = sum(not lost.pending for cell in cells for lost in cell.failures_of(label))
    return sum(run.succeeded for run in runs), len(runs) + lost


def metrics_table(cell: CellRuns) -> Table:
    """Every metric of every run of a cell; failures have a column too."""
    seeds = {run.seed for run in cell.runs} | {lost.seed for lost in cell.failures}
    several = len(seeds) > 1
    columns = [text("metric"), text("unit")]
    outcomes = []
    for run in cell.runs:
        columns.append(Entry(_with_seed(run.label, run.seed, several), label=run.label))
        outcomes.append(Entry(ending(run), "" if run.ok else "bad", run.message))
    for lost in cell.failures:
        columns.append(Entry(_with_seed(lost.label, lost.seed, several), label=lost.label))
        outcomes.append(_lost(lost))
    rows = [Row(text("outcome"), [text(""), *outcomes])]
    section = ""
    for metric in _known(cell.runs):
        own = metric.section
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


def endings_table(groups: Sequence[Group]) -> Table:
    """Every run that did not go to its end, with when and why."""
    columns = ["robot", "task", "scenario", "controller", "seed", "outcome", "at", "reason"]
    rows = []
    for cell in (cell for group in groups for cell in group.cells):
        for run in cell.runs:
            if run.ok:
                continue
            reason = cut(run.message or "no reason given", _LONGEST)
            if run.saturation is not None:
                reason += f"; torques were cut from {instant(run.saturation)} on"
            entries = [
                *_place(cell, run.label, run.seed),
                text(run.status, "bad"),
                Entry(instant(run.end)),
                text(reason, link=run.file),
            ]
            rows.append(Row(text(cell.robot), entries))
    numbers = ("seed", "at")
    heads = [Entry(name, number=name in numbers) for name in columns]
    return Table("When and why each of them ended", heads, rows)


def losses_table(groups: Sequence[Group]) -> Table:
    """Every run without a result, and why."""
    rows = []
    for cell in (cell for group in groups for cell in group.cells):
        for failure in cell.failures:
            state = _lost(failure)
            reason = cut(failure.reason or "no reason given", _LONGEST)
            entries = [
                *_place(cell, failure.label, failure.seed),
                text(state.text, state.mark),
                text(reason),
            ]
            rows.append(Row(text(cell.robot), entries))
    names = ["robot", "task", "scenario", "controller", "seed", "outcome", "reason"]
    heads = [Entry(name, number=name == "seed") for name in names]
    return Table("Why each of them has no result", heads, rows)


def saturation_table(groups: Sequence[Group]) -> Table | None:
    """Where limits of the motors cut torques: scenarios by controllers; None where they never did."""
    rows: dict[str, list[CellRuns]] = {}
    for cell in (cell for group in groups for cell in group.cells):
        if any(run.saturation is not None for run in cell.runs):
            rows.setdefault(cell.variant, []).append(cell)
    if not rows:
        return None
    labels = unique([label for group in groups for label in group.labels])
    content = [
        Row(text(name), [_saturation(cells, label) for label in labels])
        for name, cells in rows.items()
    ]
    columns = [text("scenario"), *(Entry(label, label=label) for label in labels)]
    caption = (
        "Share of the ticks at which a limit cut a torque, median over runs; in how many at all"
    )
    return Table(caption, columns, content)


def _saturation(cells: Sequence[CellRuns], label: str) -> Entry:
    runs = [run for cell in cells for run in cell.of(label)]
    shares = [run.metric("saturation_share") for run in runs]
    shares = [share for share in shares if math.isfinite(share)]
    if not shares:
        return Entry(UNDEFINED, "faint")
    starts = [run.saturation for run in runs if run.saturation is not None]
    if not starts:
        return Entry("0 %", "faint")
    share = 100.0 * float(np.median(shares))
    detail = f"at most {number(100.0 * max(shares), 2)} %"
    where = f"{len(starts)} of {len(runs)} runs, from {instant(min(starts))}"
    return Entry(f"{number(share, 2)} %", "", detail, unit=where)


def unused_table(files: Sequence[UnusedFile]) -> Table:
    """Files among the records that could not be used."""
    rows = [Row(text(item.file), [text(cut(item.reason, _LONGEST))]) for item in files]
    return Table("What is wrong with each of them", [text("file"), text("reason")], rows)


def endings_by_reason(groups: Sequence[Group]) -> Table:
    """How many runs of each controller ended how; for where single ones are too many."""
    counts: dict[tuple[str, str], list[int]] = {}
    labels = unique([label for group in groups for label in group.labels])
    for group in groups:
        for cell in group.cells:
            for label in cell.labels:
                for run in cell.of(label):
                    if not run.ok:
                        counts.setdefault((label, run.status), [0])[0] += 1
                lost = cell.failures_of(label)
                for pending in (False, True):
                    n = sum(item.pending == pending for item in lost)
                    if n:
                        kind = "not run" if pending else "failed"
                        counts.setdefault((label, kind), [0])[0] += n
    kinds = unique([kind for _, kind in counts])
    rows = [
        Row(
            text(label, label=label),
            [Entry(str(counts.get((label, kind), [0])[0])) for kind in kinds],
        )
        for label in labels
        if any(other == label for other, _ in counts)
    ]
    return Table("How many ended how", [text("controller"), *map(Entry, kinds)], rows)


def replays_table(groups: Sequence[Group], most: int) -> Table:
    """How to look at each run: the command, and the page where there is one.

    Where there are more than so many runs: those that ended early, and those with a page.
    """
    cells = [cell for group in groups for cell in group.cells]
    runs = [(cell, run) for cell in cells for run in cell.runs if run.command]
    if len(runs) > most:
        runs = [(cell, run) for cell, run in runs if run.replay or not run.ok][:most]
    paged = any(run.replay for _, run in runs)
    columns = ["robot", "task", "scenario", "controller", "seed", "outcome", "command"]
    rows = []
    for cell, run in runs:
        entries = [
            *_place(cell, run.label, run.seed),
            text(ending(run), "" if run.ok else "bad"),
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
                if run.ok  # a few ticks before a divergence say nothing
            ]
            for name in ("compute_time_median", "compute_time_p99"):
                times = [run.metrics.get(name, math.nan) for run in runs]
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
        return Entry("not asked", "faint")
    failed = [failure for failure in failures if not failure.pending]
    ended = [run for run in runs if not run.ok]
    if failed or (failures and not ended):
        return _lost((failed or failures)[0])
    if ended:
        some = f" ({len(ended)} of {len(runs)} seeds)" if len(runs) > 1 else ""
        return Entry(f"{ending(ended[0])}{some}", "bad", ended[0].message)
    error = number(worst_error(runs))
    if all(run.succeeded for run in runs):
        return Entry(error, "best" if error == best else "")
    return Entry(error, "bad", "|e^e| did not settle below 1e-4 m")


def _lost(failure: FailedRun) -> Entry:
    """What stands where a run has no result: not being done yet is no fault."""
    reason = cut(failure.reason, _LONGEST)
    return Entry("not run", "faint", reason) if failure.pending else Entry("failed", "bad", reason)


def _best_of_summary(cell: CellRuns) -> str:
    errors = [
        worst_error(cell.of(label))
        for label in cell.labels
        if cell.of(label) and not cell.failures_of(label)
    ]
    return number(min(errors, default=math.nan))


def _metric_row(metric: Metric, cell: CellRuns, *, ranked: bool) -> Row:
    values = [run.metrics.get(metric.name, math.nan) for run in cell.runs]
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
    others = unique([name for run in runs for name in run.metrics if name not in names])
    return known + [Metric(name, "", "not known to this version", "", _unknown) for name in others]


def _unknown(run: object) -> float:
    return math.nan


def _in_sections(metrics: Sequence[Metric]) -> list[Metric]:
    order = list(_SECTIONS)

    def place(metric: Metric) -> int:
        return order.index(metric.section) if metric.section in order else len(order)

    return sorted(metrics, key=place)  # stable: by name within a section


def _place(cell: CellRuns, label: str, seed: int) -> list[Entry]:
    return [text(cell.task), text(cell.variant), text(label, label=label), Entry(str(seed))]


def _with_seed(label: str, seed: int, several: bool) -> str:
    return f"{label}, seed {seed}" if several else label
