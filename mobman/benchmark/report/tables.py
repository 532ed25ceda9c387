"""The tables of a report, before they are HTML, Markdown or LaTeX."""

from __future__ import annotations

import math
import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from mobman.benchmark.report.data import DONE, NOT_RUN, Results
from mobman.benchmark.report.format import (
    UNDEFINED,
    cut,
    ended,
    instant,
    interval_range,
    metric_unit,
    metric_value,
    number,
    p_value,
    percent,
    rank_range,
    signed,
)
from mobman.benchmark.report.standings import EFFORTS, Board, Pair, Price, Standing
from mobman.controllers.protocol import INFORMATION, information_of
from mobman.provenance import machine
from mobman.simulation.limits import ALLOWED
from mobman.simulation.metrics import list_metrics

SIGNIFICANT = 0.05
"""Adjusted p below which two controllers are called different."""
ALIKE = 0.05
"""Decades: two errors whose median difference is surely below it are called alike, whatever p is."""
_SECTIONS = {
    "tracking": "Tracking",
    "redundancy": "Redundancy",
    "effort": "Effort",
    "limits": "Limits of the robot",
    "ground": "Wheels on the ground",
    "theorems": "What the theorems suppose",
    "consistency": "Consistency of the simulation",
    "timing": "Computing time",
}
_NOT_RANKED = "consistency"  # says something of the integrator, not of the controller
_MOST_COLUMNS = 8  # scenarios that stand side by side
_MACHINE = ("processor", "architecture", "system")


class Entry(NamedTuple):
    """A place in a table."""

    text: str
    mark: str = ""
    """``"best"`` of its row; ``"bad"``, as a run that diverged; ``"faint"``; or none."""
    detail: str = ""
    """More about it, shown on demand."""
    label: str = ""
    """The controller whose colour it shows."""
    link: str = ""
    """Relative address."""
    unit: str = ""
    """Shown small behind the text."""
    number: bool = True
    """True for the heading of a column that is aligned as numbers."""
    command: bool = False
    """True for words that a shell takes."""


@dataclass
class Table:
    """Columns with headings, and rows; a row of one entry is a heading over those that follow."""

    caption: str
    columns: Sequence[Entry]
    rows: Sequence[Sequence[Entry]]


def table_of(caption: str, columns: str, rows: Sequence[Sequence[Any]], *more: Entry) -> Table:
    """Make a table.

    Args:
        caption: Its caption.
        columns: Their headings, separated by ``;``; of numbers where one starts with ``#``.
        rows: Entries, or their texts.
        more: Headings of more columns.
    """
    heads = [Entry(name.lstrip("#"), number=name.startswith("#")) for name in columns.split(";")]
    own = [[item if isinstance(item, Entry) else Entry(item) for item in row] for row in rows]
    return Table(caption, [*heads, *more], own)


def label_entry(label: str) -> Entry:
    """Make the entry of a controller, with its colour."""
    return Entry(label, label=label)


def _best(text: str, best: bool) -> Entry:
    return Entry(text, "best" if best else "")


# Comparison ----------------------------------------------------------------------------------------


def leaderboard_table(board: Board) -> Table:
    """Show every controller's place over all cells."""
    rows = []
    for s in board.standings:
        lost = [f"{s.ended} ended early"] if s.ended else []
        lost += [f"{s.lost} without result"] if s.lost else []
        rows.append(
            [
                rank_range(s.ranks),
                _named(s),
                _best(number(s.error.estimate), _leads(s, board.ranked)),
                interval_range(s.error),
                f"{s.solved} of {s.cells}",
                percent(s.rate),
                str(s.asked),
                Entry(", ".join(lost) or UNDEFINED, "bad" if lost else "faint"),
                Entry(str(s.beyond), "bad" if s.beyond else "faint"),
            ]
        )
    columns = (
        "rank;controller;#steady |e^e| (m);#95 % interval;#cells solved;#95 % interval;#runs;"
        "of these, failed;#of these, beyond limits"
    )
    unit = f"{board.units} cells" if board.unit == "cell" else f"{board.units} platforms"
    caption = (
        f"Leaderboard over {len(board.cells)} cells (intervals: of {unit}); a failure is an infinite "
        "error, which the geometric mean of the middle half shows where a quarter of them fail"
    )
    return table_of(caption, columns, rows)


def _named(standing: Standing) -> Entry:
    """Make the entry of a controller, with those that are the same law here."""
    same = f"the same as {', '.join(standing.twins)}" if standing.twins else ""
    why = "one law inside the unit ball: their errors are the same in every cell" if same else ""
    return Entry(standing.label, label=standing.label, detail=why, unit=same)


def information_table(results: Results, board: Board) -> Table:
    """Show what each controller uses, those that use the same together, the best of each marked."""
    laws = results.runs.drop_duplicates("label").set_index("label").law
    groups: dict[tuple[str, ...] | None, list[Standing]] = {}
    for s in board.standings:
        groups.setdefault(information_of(str(laws[s.label])), []).append(s)
    rows: list[list[Entry]] = []
    for uses, members in groups.items():
        what = "not said" if uses is None else ", ".join(uses) or "none of these"
        rows.append([Entry(f"use {what}" if uses else what)])
        for s in members:
            marks = [UNDEFINED if uses is None else "yes" * (item in uses) for item in INFORMATION]
            ranked = [other for other in members if other.ranks is not None]
            rows.append(
                [
                    _named(s),
                    *map(Entry, marks),
                    _best(number(s.error.estimate), _leads(s, ranked)),
                    Entry(f"{s.solved} of {s.cells}"),
                ]
            )
    columns = ";".join(["controller", *INFORMATION, "#steady |e^e| (m)", "#cells solved"])
    return table_of("What each controller uses", columns, rows)


def _leads(standing: Standing, others: Sequence[Standing]) -> bool:
    """True for one that all others are settled to be worse than."""
    firsts = [other for other in others if other.ranks is not None and other.ranks[0] == 1]
    return len(others) > 1 and firsts == [standing]


def families_table(board: Board, results: Results) -> Table:
    """Show places by scenario family: families in rows, controllers in columns."""
    labels = [standing.label for standing in board.ranked]
    counts = results.cells.family.loc[board.cells].value_counts()
    rows = []
    for family, found in board.families.items():
        row: list[Entry | str] = [family, str(counts[family])]
        for s in (found[label] for label in labels):
            solved = f"{s.solved} of {s.cells} cells solved"
            row.append(
                Entry(
                    number(s.error.estimate, 2),
                    "best" if _leads(s, list(found.values())) else "",
                    f"{interval_range(s.error)}; {solved}",
                    unit=f"{rank_range(s.ranks)} · {s.solved}/{s.cells}",
                )
            )
        rows.append(row)
    caption = "By scenario family: steady |e^e| (m), ranks that the intervals allow · cells solved"
    return table_of(caption, "scenario family;#cells", rows, *map(label_entry, labels))


def pairs_table(pairs: Sequence[Pair]) -> Table:
    """Show every two controllers on the same cells."""
    rows = []
    for pair in pairs:
        found, success = pair.error, pair.success
        difference = found.median_difference
        rows.append(
            [
                f"{pair.a} – {pair.b}",
                str(found.n),
                f"{found.wins} / {found.ties} / {found.losses}",
                signed(difference.estimate),
                f"{signed(difference.low)} to {signed(difference.high)}",
                _best(p_value(pair.error_p), pair.error_p < SIGNIFICANT),
                signed(found.effect_size),
                f"{success.only_a} / {success.only_b}",
                _best(p_value(pair.success_p), pair.success_p < SIGNIFICANT),
                _verdict(pair, len(pairs)),
            ]
        )
    columns = (
        "a – b;#cells;#a better / equal / b better;#median difference (decades);#95 % interval;"
        "#p, Holm;#effect size;#cells solved by a / b only;#p, Holm;verdict"
    )
    return table_of("Paired comparisons on the same cells", columns, rows)


def _verdict(pair: Pair, pairs: int) -> str:
    """Say what one of so many pairs shows of the errors, and of the solved cells if that is settled."""
    found, success = pair.error, pair.success
    interval = found.median_difference
    if found.wins == found.losses == 0:
        words = "the same"
    elif max(abs(interval.low), abs(interval.high)) < ALIKE:
        words = "errors alike"
    elif pair.error_p < SIGNIFICANT:
        words = f"{pair.a if found.effect_size < 0 else pair.b} has the smaller error"
    elif (
        found.smallest_p * pairs >= SIGNIFICANT
    ):  # nothing could pass the first step of Holm's method
        words = "too few cells to say"
    else:
        words = "not distinguished"
    if pair.success_p < SIGNIFICANT:
        more = pair.a if success.only_a > success.only_b else pair.b
        same = words.startswith(f"{more} has")
        words += " and solves more" if same else f"; {more} solves more"
    return words


def tuned_table(results: Results, board: Board) -> Table | None:
    """Show what tuning brought on the reported cells, and what it cost; None if nothing was tuned."""
    standings = {s.label: s for s in board.ranked}
    energy = results.effort("torque_energy").loc[board.cells]
    scores = {frozenset((p.a, p.b)): p for p in board.pairs}
    rows = []
    for label, item in results.tuned.items():
        before, after = standings.get(str(item.get("label"))), standings.get(label)
        if before is None or after is None or before is after:
            continue
        pair = scores.get(frozenset((label, before.label)))
        wins = [] if pair is None else [pair.error.wins, pair.error.ties, pair.error.losses]
        wins = wins[::-1] if pair is not None and pair.a != label else wins
        both = energy[np.isfinite(energy[[label, before.label]]).all(axis=1)]
        rows.append(
            [
                label_entry(before.label),
                number(before.error.estimate),
                number(after.error.estimate),
                " / ".join(map(str, wins)) or UNDEFINED,
                f"{before.solved} → {after.solved} of {after.cells}",
                f"{before.ended} → {after.ended} of {after.asked}",
                number(float((both[label] / both[before.label]).median()), 2),
            ]
        )
    columns = (
        "controller;#steady |e^e|, gains as given (m);#tuned (m);#tuned better / equal / worse;"
        "#cells solved;#runs that ended early;#integral of |v|², times"
    )
    return table_of("Gains as given and tuned, on the same cells", columns, rows) if rows else None


def prices_table(prices: Mapping[str, Sequence[Price]]) -> Table:
    """Show precision against effort."""
    rows = []
    for own in zip(*prices.values(), strict=True):
        row = [label_entry(own[0].label), Entry(number(own[0].error.estimate))]
        for price in own:
            row.append(_best(number(price.effort.estimate), price.front))
            row.append(Entry(interval_range(price.effort, 3)))
        rows.append(row)
    heads = [Entry(name) for metric in prices for name in (EFFORTS[metric], "95 % interval")]
    caption = "Precision and effort; bold: on the front"
    return table_of(caption, "controller;#steady |e^e| (m)", rows, *heads)


# Results -------------------------------------------------------------------------------------------


def summary_table(results: Results, group: str) -> Table:
    """Show controllers and scenarios of a group: the largest steady error, the worst of the seeds.

    Scenarios are in columns, or in rows where there are many.
    """
    cells = results.cells[results.cells.group == group]
    runs = results.runs[results.runs.cell.isin(cells.index)]
    labels = [label for label in results.labels if (runs.label == label).any()]
    # frames of single entries would take minutes: a large suite has tens of thousands
    members: dict[tuple[int, str], list[Any]] = {}
    for run in runs.itertuples():
        members.setdefault((run.cell, run.label), []).append(run)
    entries: dict[tuple[int, str], Entry] = {}
    for cell in cells.index:
        own = {label: members[cell, label] for label in labels if (cell, label) in members}
        whole = [found for found in own.values() if all(run.state == DONE for run in found)]
        best = number(min((max(run.error for run in found) for found in whole), default=math.nan))
        for label in labels:
            entries[cell, label] = _outcome(own.get(label, []), best)
    tried = runs[runs.state != NOT_RUN].groupby("label").succeeded.agg(["sum", "size"])
    totals = []
    for won, n in (tuple(tried.reindex(labels, fill_value=0).loc[label]) for label in labels):
        totals.append(Entry(f"{won} of {n}", "" if won == n else "bad"))
    caption = f"{group}: largest |e^e| in the steady part (m)"
    rows: list[list[Entry]]
    if len(cells) <= _MOST_COLUMNS:
        rows = [
            [label_entry(label), *(entries[cell, label] for cell in cells.index), total]
            for label, total in zip(labels, totals, strict=True)
        ]
        heads = [*map(Entry, cells.variant), Entry("succeeded")]
        return table_of(caption, "controller", rows, *heads)
    rows = [
        [Entry(cell.variant), *(entries[cell.Index, label] for label in labels)]
        for cell in cells.itertuples()
    ]
    rows.append([Entry("succeeded"), *totals])
    return table_of(caption, "scenario", rows, *map(label_entry, labels))


def _outcome(runs: Sequence[Any], best: str) -> Entry:
    """Say how a controller did in a cell."""
    if not runs:
        return Entry("not requested", "faint")
    lost = sorted((run for run in runs if run.state != DONE), key=lambda run: run.state == NOT_RUN)
    early = [run for run in runs if run.state == DONE and not run.ok]
    if lost and (lost[0].state != NOT_RUN or not early):
        return lost_entry(lost[0])
    if early:
        some = f" ({len(early)} of {len(runs)} seeds)" if len(runs) > 1 else ""
        return Entry(f"{ending(early[0])}{some}", "bad", early[0].message)
    error = number(max(run.error for run in runs))
    if all(run.succeeded for run in runs) and any(run.beyond for run in runs):
        where = "the robot went beyond its own limits: see time_beyond_limits and its like"
        return Entry(error, "bad", where, unit="beyond limits")
    if all(run.succeeded for run in runs):
        return _best(error, error == best)
    return Entry(error, "bad", "|e^e| did not settle below 1e-4 m")


def ending(run: Any) -> str:
    """Say how a run with a result ended, in a few words."""
    return "completed" if run.ok else ended(run.status, run.end)


def lost_entry(run: Any) -> Entry:
    """Say why a run has no result: one that was not run yet is no failure."""
    pending = run.state == NOT_RUN
    return Entry(run.state, "faint" if pending else "bad", cut(run.message))


def metrics_table(results: Results, cell: int) -> Table:
    """Show every metric of every run of a cell; runs without a result have a column too."""
    runs = results.runs[results.runs.cell == cell].sort_values("state", kind="stable")
    values = results.metrics.loc[runs.index]
    several = runs.seed.nunique() > 1
    heads = [
        Entry(f"{run.label}, seed {run.seed}" if several else run.label, label=run.label)
        for run in runs.itertuples()
    ]
    outcomes = [
        Entry(ending(run), "" if run.ok else "bad", run.message) if done else lost_entry(run)
        for run, done in zip(runs.itertuples(), runs.state == DONE, strict=True)
    ]
    rows: list[list[Entry]] = [[Entry("outcome"), Entry(""), *outcomes]]
    known = {
        metric.name: metric
        for metric in sorted(list_metrics(), key=_section)
        if metric.applies is None or (metric.name in values and values[metric.name].notna().any())
    }
    other = [name for name in values if name not in known and values[name].notna().any()]
    section = ""
    for name in [*known, *other]:
        metric = known.get(name)
        title = _SECTIONS.get(metric.section, "Other") if metric else "Other"
        if title != section:
            section = title
            rows.append([Entry(title)])
        own = values[name] if name in values else pd.Series(math.nan, runs.index)
        better = metric.better if metric and metric.section != _NOT_RANKED else ""
        unit, about = (metric.unit, metric.description) if metric else ("", "not known here")
        faint = Entry(metric_unit(name, unit), "faint")
        rows.append([Entry(name, detail=about), faint, *_values(name, own, runs, better)])
    done = runs.state == DONE
    nothing = Entry(UNDEFINED, "faint")
    links = {"record": ("h5", runs.file.where(done, "")), "page": ("replay", runs.replay)}
    rows.append([Entry("Data")])
    for title, (words, files) in links.items():
        if title == "record" or files.any():
            own_links = (Entry(words, link=file) if file else nothing for file in files)
            rows.append([Entry(title), Entry(""), *own_links])
    caption = f"{results.cells.name[cell]}: every metric"
    return table_of(caption, "metric;unit", rows, *heads)


def _section(metric: Any) -> int:
    order = list(_SECTIONS)
    return order.index(metric.section) if metric.section in order else len(order)


def _values(name: str, values: pd.Series, runs: pd.DataFrame, better: str) -> list[Entry]:
    """Show a metric of runs; the best of those that succeeded: cheap misses have no merit."""
    rivals = values[runs.succeeded & np.isfinite(values)]
    best = ""
    if better and name != "success" and len(rivals) > 1:
        best = metric_value(name, rivals.max() if better == "higher" else rivals.min())
    found = []
    for value, won in zip(values, runs.succeeded, strict=True):
        shown = metric_value(name, value)
        if math.isnan(value):
            found.append(Entry(shown, "faint"))
        elif value > ALLOWED.get(name, math.inf):
            found.append(Entry(shown, "bad"))
        elif value == math.inf or name == "success":
            found.append(Entry(shown, "" if won else "bad"))
        else:
            found.append(_best(shown, won and shown == best))
    return found


def endings_table(results: Results) -> Table:
    """Show every run that did not go to its end, with when and why."""
    rows = []
    for run in results.runs[(results.runs.state == DONE) & ~results.runs.ok].itertuples():
        reason = cut(run.message or "no reason given")
        if math.isfinite(run.saturation):
            reason += f"; torques were cut from {instant(run.saturation)} on"
        status, at = Entry(run.status, "bad"), Entry(instant(run.end))
        rows.append([*_place(results, run), status, at, Entry(reason, link=run.file)])
    columns = "robot;task;scenario;controller;#seed;outcome;#at;reason"
    return table_of("When and why each of them ended", columns, rows)


def losses_table(results: Results) -> Table:
    """Show every run without a result, and why."""
    rows = [
        [
            *_place(results, run),
            lost_entry(run)._replace(detail=""),
            cut(run.message or "no reason"),
        ]
        for run in results.lost.itertuples()
    ]
    columns = "robot;task;scenario;controller;#seed;outcome;reason"
    return table_of("Why each of them has no result", columns, rows)


def _place(results: Results, run: Any) -> list[Entry]:
    variant = results.cells.variant[run.cell]
    return [
        Entry(run.robot),
        Entry(run.task),
        Entry(variant),
        label_entry(run.label),
        Entry(str(run.seed)),
    ]


def endings_by_reason(results: Results) -> Table:
    """Count how the runs of each controller ended; for where single ones are too many."""
    runs = results.runs[~results.runs.ok]
    kinds = runs.status.where(runs.state == DONE, runs.state)
    counts = pd.crosstab(runs.label, kinds).reindex(columns=kinds.unique())
    rows = [
        [label_entry(label), *map(str, counts.loc[label])]
        for label in results.labels
        if label in counts.index
    ]
    return table_of("How many ended how", "controller", rows, *map(Entry, counts.columns))


def saturation_table(results: Results) -> Table | None:
    """Show where limits of the motors cut torques: scenarios by controllers; None if nowhere."""
    variants = results.runs.cell.map(results.cells.variant)
    share = results.metrics.get("saturation_share")
    rows: list[list[Entry]] = []
    for name in variants[results.runs.saturation.notna()].unique():
        row = [Entry(name)]
        for label in results.labels:
            own = results.runs[(variants == name) & (results.runs.label == label)]
            assert share is not None
            found = share.loc[own.index].dropna()
            starts = own.saturation.dropna()
            if not len(found):
                row.append(Entry(UNDEFINED, "faint"))
            elif not len(starts):
                row.append(Entry("0 %", "faint"))
            else:
                where = f"{len(starts)} of {len(own)} runs, from {instant(starts.min())}"
                most = f"at most {number(100.0 * found.max(), 2)} %"
                row.append(Entry(f"{number(100.0 * found.median(), 2)} %", "", most, unit=where))
        rows.append(row)
    caption = (
        "Share of the ticks at which a limit cut a torque, median over runs; in how many at all"
    )
    return table_of(caption, "scenario", rows, *map(label_entry, results.labels)) if rows else None


def unused_table(results: Results) -> Table:
    """Show files among the records that could not be used."""
    rows = [[file, cut(reason)] for file, reason in results.unused.items()]
    return table_of("What is wrong with each of them", "file;reason", rows)


def replays_table(results: Results, most: int) -> Table:
    """Show how to look at each run: the command, and the page where there is one.

    Where there are more than so many runs: those that ended early, and those with a page.
    """
    runs = results.runs[results.runs.command != ""]
    if len(runs) > most:
        runs = runs[(runs.replay != "") | ~runs.ok][:most]
    paged = runs.replay.any()
    rows = []
    for run in runs.itertuples():
        row = [*_place(results, run), Entry(ending(run), "" if run.ok else "bad")]
        row.append(Entry(run.command, command=True))
        row += [Entry("replay" if run.replay else UNDEFINED, link=run.replay)] if paged else []
        rows.append(row)
    columns = "robot;task;scenario;controller;#seed;outcome;command" + (";page" if paged else "")
    return table_of("How to look at each run", columns, rows)


# Computing times, definitions, origin --------------------------------------------------------------


def timing_table(results: Results) -> Table:
    """Show what a control step costs: controller x robot, over all scenarios and seeds."""
    names = ["compute_time_median", "compute_time_p99"]
    times = results.metrics.reindex(columns=names).where(np.isfinite)
    # a few ticks before a divergence say nothing
    runs = results.runs[results.runs.ok]
    medians = times.loc[runs.index].groupby([runs.label, runs.robot]).median()
    robots = list(results.cells.robot.unique())
    rows = []
    for label in results.labels:
        row = [label_entry(label)]
        for robot in robots:
            known = (label, robot) in medians.index
            for name in names:
                value = medians[name][label, robot] if known else math.nan
                row.append(Entry(metric_value(name, value)))
        rows.append(row)
    heads = [Entry(name) for r in robots for name in (f"{r}: median", "99th percentile")]
    caption = "Time that the controller took for a tick (µs); median over the completed runs"
    return table_of(caption, "controller", rows, *heads)


def definitions_table() -> Table:
    """Show what the metrics are."""
    rows = [
        [metric.name, metric.unit, metric.description, metric.better or UNDEFINED]
        for metric in sorted(list_metrics(), key=_section)
    ]
    return table_of("Definitions of the metrics", "metric;unit;definition;better", rows)


def versions_table(results: Results) -> tuple[Table, str]:
    """Show the versions in the runs' records; and a warning where some are mixed."""
    done = results.runs[results.runs.state == DONE]
    known = {name for versions in done.versions for name in versions}
    rows, mixed = [], []
    for name in sorted(known, key=lambda name: (name not in ("mobman", "python"), name)):
        found = Counter(versions.get(name, "unknown") for versions in done.versions)
        shown, several = next(iter(found)), len(found) > 1
        if several:
            mixed.append(name)
            shown = ", ".join(f"{v} ({n} run{'s' * (n != 1)})" for v, n in found.items())
        rows.append([name, Entry(shown, "bad" if several else "")])
    warning = (
        f"Runs of different versions are mixed ({', '.join(mixed)}): they are not strictly comparable. "
        "Run the suite again to have one."
        if mixed
        else ""
    )
    return table_of("Versions", "of;version", rows), warning


def machines_table(results: Results) -> Table:
    """Show the machines that the runs were computed on, as their records say it."""
    done = results.runs[results.runs.state == DONE]
    counts = Counter(tuple(m.get(name) or "unknown" for name in _MACHINE) for m in done.machine)
    rows = [[*facts, str(n)] for facts, n in counts.most_common()]
    columns = "processor;architecture;system;#runs"
    return table_of("Machines that the runs were computed on", columns, rows)


def machine_table() -> Table:
    """Show the machine that writes the report."""
    facts = {
        "processor": machine()["processor"],
        "architecture": platform.machine(),
        "logical cores": str(os.cpu_count() or ""),
        "system": f"{platform.system()} {platform.release()}".strip(),
    }
    rows = [[name, value or UNDEFINED] for name, value in facts.items()]
    return table_of("Machine that wrote this report", "of;value", rows)
