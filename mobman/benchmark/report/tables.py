"""The tables of a report, before they are HTML, Markdown or LaTeX."""

from __future__ import annotations

import math
import os
import platform
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from mobman.benchmark.report.data import DONE, NOT_RUN, Results
from mobman.benchmark.report.format import (
    UNDEFINED,
    count,
    cut,
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

SIGNIFICANT = 0.05  # adjusted p below which two controllers are called different
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


class Entry(NamedTuple):
    """A place in a table."""

    text: str
    mark: str = ""  # "best" of its row; "bad", as a run that diverged; "faint"; or none
    detail: str = ""  # more about it, shown on demand
    label: str = ""  # the controller whose colour it shows
    link: str = ""  # relative address
    unit: str = ""  # shown small behind the text
    number: bool = True  # True for the heading of a column that is aligned as numbers
    command: bool = False  # True for words that a shell takes


@dataclass
class Table:
    """Columns with headings, and rows; a row of one entry is a heading over those that follow."""

    caption: str
    columns: Sequence[Entry]
    rows: Sequence[Sequence[Entry]]


def table_of(caption: str, columns: str, rows: Iterable[Iterable[Any]], *more: Entry) -> Table:
    """Make a table of rows of entries, or of their texts.

    Headings of columns are separated by ``;``; of numbers where one starts with ``#``. More may follow.
    """
    heads = [Entry(name.lstrip("#"), number=name.startswith("#")) for name in columns.split(";")]
    own = [[item if isinstance(item, Entry) else Entry(item) for item in row] for row in rows]
    return Table(caption, [*heads, *more], own)


Columns = Sequence[tuple[str, Callable[[Any], "Entry | str"]]]
"""Headings as in :func:`table_of`, and what stands below them of an item."""


def table_by(caption: str, items: Iterable[Any], columns: Columns) -> Table:
    """Make a table with a row for each item."""
    rows = ([show(item) for _, show in columns] for item in items)
    return table_of(caption, ";".join(name for name, _ in columns), rows)


def label_entry(label: str) -> Entry:
    """Make the entry of a controller, with its colour."""
    return Entry(label, label=label)


def _marked(text: str, mark: str, marked: object, **more: Any) -> Entry:
    """Make an entry that has a mark only if it is so."""
    return Entry(text, mark if marked else "", **more)


# Comparison ----------------------------------------------------------------------------------------


def leaderboard_table(board: Board) -> Table:
    """Show every controller's place over all cells."""

    def failed(s: Standing) -> Entry:
        words = {"ended early": s.ended, "without result": s.lost}
        lost = ", ".join(f"{n} {how}" for how, n in words.items() if n)
        return Entry(lost or UNDEFINED, "bad" if lost else "faint")

    unit = "cells" if board.unit == "cell" else "platforms"
    caption = (
        f"Leaderboard over {len(board.cells)} cells (intervals of errors: of {board.units} {unit}, of "
        "shares: of cells); a failure is an infinite error, which the geometric mean of the middle half "
        "shows where a quarter of them fail"
    )
    columns: Columns = [
        ("rank", lambda s: rank_range(s.ranks)),
        ("controller", _named),
        ("#steady |e^e| (m)", lambda s: _error(s, board.ranked)),
        ("#95 % interval", lambda s: interval_range(s.error)),
        ("#cells solved", lambda s: f"{s.solved} of {s.cells}"),
        ("#95 % interval", lambda s: percent(s.rate)),
        ("#runs", lambda s: str(s.asked)),
        ("of these, failed", failed),
        (
            "#of these, beyond limits",
            lambda s: Entry(str(s.beyond), "bad" if s.beyond else "faint"),
        ),
    ]
    return table_by(caption, board.standings, columns)


def _named(standing: Standing) -> Entry:
    """Make the entry of a controller, with those that are the same law here."""
    if not standing.twins:
        return label_entry(standing.label)
    why = "their errors differ by 10 % at most in the median, and by a factor of 2 in any cell"
    same = f"the same as {', '.join(standing.twins)}"
    return Entry(standing.label, label=standing.label, detail=why, unit=same)


def _error(standing: Standing, others: Iterable[Standing], digits: int = 3) -> Entry:
    """Make the entry of a mean error: the best if all others are settled to be worse."""
    rivals = [other.ranks for other in others if other.ranks and other is not standing]
    own = standing.ranks
    best = own is not None and bool(rivals) and all(own[1] < ranks[0] for ranks in rivals)
    return _marked(number(standing.error.estimate, digits), "best", best)


def information_table(results: Results, board: Board) -> Table:
    """Show what each controller uses, those that use the same together, the best of each marked."""
    runs = results.runs.drop_duplicates("label").set_index("label")
    groups: dict[tuple[str, ...] | None, list[Standing]] = {}
    for s in board.standings:
        run = runs.loc[s.label]
        groups.setdefault(information_of(str(run.law), run.gains), []).append(s)
    rows: list[list[Entry | str]] = []
    for uses, members in groups.items():
        what = "not said" if uses is None else ", ".join(uses) or "none of these"
        rows.append([f"use {what}" if uses else what])
        marks = [UNDEFINED if uses is None else "yes" * (item in uses) for item in INFORMATION]
        for s in members:
            rows.append([_named(s), *marks, _error(s, members), f"{s.solved} of {s.cells}"])
    columns = ";".join(["controller", *INFORMATION, "#steady |e^e| (m)", "#cells solved"])
    return table_of("What each controller uses", columns, rows)


def families_table(board: Board, results: Results) -> Table:
    """Show places by scenario family: families in rows, controllers in columns."""
    labels = [standing.label for standing in board.ranked]
    counts = results.cells.family.loc[board.cells].value_counts()

    def place(s: Standing, found: Mapping[str, Standing]) -> Entry:
        more = f"{interval_range(s.error)}; {s.solved} of {s.cells} cells solved"
        unit = f"{rank_range(s.ranks)} · {s.solved}/{s.cells}"
        return _error(s, found.values(), 2)._replace(detail=more, unit=unit)

    rows = (
        [family, str(counts[family]), *(place(found[label], found) for label in labels)]
        for family, found in board.families.items()
    )
    caption = "By scenario family: steady |e^e| (m), ranks that the intervals allow · cells solved"
    return table_of(caption, "scenario family;#cells", rows, *map(label_entry, labels))


def pairs_table(pairs: Sequence[Pair]) -> Table:
    """Show every two controllers on the same cells."""

    def spread(pair: Pair) -> str:
        found = pair.error.median_difference
        return f"{signed(found.low)} to {signed(found.high)}"

    def holm(p: float) -> Entry:
        return _marked(p_value(p), "best", p < SIGNIFICANT)

    better = "#a better / equal / b better"
    columns: Columns = [
        ("a – b", lambda p: f"{p.a} – {p.b}"),
        ("#cells", lambda p: str(p.error.n)),
        (better, lambda p: f"{p.error.wins} / {p.error.ties} / {p.error.losses}"),
        ("#median difference (decades)", lambda p: signed(p.error.median_difference.estimate)),
        ("#95 % interval", spread),
        ("#p, Holm", lambda p: holm(p.error_p)),
        ("#effect size", lambda p: signed(p.error.effect_size)),
        ("#cells solved by a / b only", lambda p: f"{p.success.only_a} / {p.success.only_b}"),
        ("#p, Holm", lambda p: holm(p.success_p)),
        ("verdict", lambda p: _verdict(p, len(pairs))),
    ]
    return table_by("Paired comparisons on the same cells", pairs, columns)


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
    elif found.smallest_p * pairs >= SIGNIFICANT:  # nothing could pass Holm's first step
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
    scores = {(p.a, p.b): [p.error.wins, p.error.ties, p.error.losses] for p in board.pairs}
    scores |= {(b, a): wins[::-1] for (a, b), wins in scores.items()}
    rows = []
    for label, item in results.tuned.items():
        before, after = standings.get(item.label), standings.get(label)
        if before is None or after is None or before is after:
            continue
        both = energy[np.isfinite(energy[[label, before.label]]).all(axis=1)]
        rows.append(
            [
                label_entry(before.label),
                number(before.error.estimate),
                number(after.error.estimate),
                " / ".join(map(str, scores.get((label, before.label), [UNDEFINED]))),
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
            row.append(_marked(number(price.effort.estimate), "best", price.front))
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
    members: dict[tuple[int, str], list[Any]] = defaultdict(list)
    for run in runs.itertuples():
        members[run.cell, run.label].append(run)
    best: dict[int, str] = {}
    for cell in cells.index:
        own = [found for label in labels if (found := members[cell, label])]
        whole = [found for found in own if all(run.state == DONE for run in found)]
        least = min((max(run.error for run in found) for found in whole), default=math.nan)
        best[cell] = number(least)
    tried = runs[runs.state != NOT_RUN]
    grid = []
    for label in labels:
        won = tried.succeeded[tried.label == label]
        row = [_outcome(members[cell, label], best[cell]) for cell in cells.index]
        grid.append([*row, _marked(f"{won.sum()} of {len(won)}", "bad", not won.all())])
    heads, caption = [*cells.variant, "succeeded"], f"{group}: largest |e^e| in the steady part (m)"
    names = [label_entry(label) for label in labels]
    if len(cells) > _MOST_COLUMNS:
        return table_of(caption, "scenario", zip(heads, *grid, strict=True), *names)
    rows = ([name, *row] for name, row in zip(names, grid, strict=True))
    return table_of(caption, "controller", rows, *map(Entry, heads))


def _outcome(runs: Sequence[Any], best: str) -> Entry:
    """Say how a controller did in a cell."""
    if not runs:
        return Entry("not requested", "faint")
    lost = sorted((run for run in runs if run.state != DONE), key=lambda run: run.state == NOT_RUN)
    early = [run for run in runs if run.state == DONE and not run.ok]
    if lost and (lost[0].state != NOT_RUN or not early):
        return _ending(lost[0])
    if early:
        some = f" ({len(early)} of {len(runs)} seeds)" if len(runs) > 1 else ""
        return Entry(f"{_ending(early[0]).text}{some}", "bad", early[0].message)
    error = number(max(run.error for run in runs))
    if not all(run.succeeded for run in runs):
        return Entry(error, "bad", "|e^e| did not settle below 1e-4 m")
    if any(run.beyond for run in runs):
        where = "the robot went beyond its own limits: see time_beyond_limits and its like"
        return Entry(error, "bad", where, unit="beyond limits")
    return _marked(error, "best", error == best)


def _ending(run: Any) -> Entry:
    """Say how a run ended, or why it has no result: one that was not run yet is no failure."""
    if run.state != DONE:
        return Entry(run.state, "faint" if run.state == NOT_RUN else "bad", cut(run.message))
    if run.ok:
        return Entry("completed", "", run.message)
    words = run.status if math.isnan(run.end) else f"{run.status} at {instant(run.end)}"
    return Entry(words, "bad", run.message)


def metrics_table(results: Results, cell: int) -> Table:
    """Show every metric of every run of a cell; runs without a result have a column too."""
    runs = results.runs[results.runs.cell == cell].sort_values("state", kind="stable")
    values = results.metrics.loc[runs.index]
    several = runs.seed.nunique() > 1
    heads = [
        Entry(f"{run.label}, seed {run.seed}" if several else run.label, label=run.label)
        for run in runs.itertuples()
    ]
    rows: list[list[Entry]] = [[Entry("outcome"), Entry(""), *map(_ending, runs.itertuples())]]
    told = values.columns[values.notna().any()]
    known = {
        metric.name: metric
        for metric in _by_section()
        if metric.applies is None or metric.name in told
    }
    section = ""
    for name in dict.fromkeys([*known, *told]):
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
    rows.append([Entry("Data")])
    files = runs.file.where(runs.state == DONE, "")
    for title, words, links in (("record", "h5", files), ("page", "replay", runs.replay)):
        if title == "record" or links.any():
            nothing = Entry(UNDEFINED, "faint")
            own_links = (Entry(words, link=link) if link else nothing for link in links)
            rows.append([Entry(title), Entry(""), *own_links])
    caption = f"{results.cells.name[cell]}: every metric"
    return table_of(caption, "metric;unit", rows, *heads)


def _by_section() -> list[Any]:
    order = {section: number for number, section in enumerate(_SECTIONS)}
    return sorted(list_metrics(), key=lambda metric: order.get(metric.section, len(order)))


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
            found.append(_marked(shown, "bad", not won))
        else:
            found.append(_marked(shown, "best", won and shown == best))
    return found


def _of_runs(results: Results, caption: str, runs: pd.DataFrame, *columns: Any) -> Table:
    """Make a table with a row for each run: which it is, and what columns say."""
    place: Columns = [
        ("robot", lambda run: run.robot),
        ("task", lambda run: run.task),
        ("scenario", lambda run: results.cells.variant[run.cell]),
        ("controller", lambda run: label_entry(run.label)),
        ("#seed", lambda run: str(run.seed)),
    ]
    return table_by(caption, runs.itertuples(), [*place, *columns])


def endings_table(results: Results) -> Table:
    """Show every run that did not go to its end, with when and why."""

    def reason(run: Any) -> Entry:
        cuts = f"; torques were cut from {instant(run.saturation)} on"
        words = cut(run.message or "no reason given")
        return Entry(words + cuts * math.isfinite(run.saturation), link=run.file)

    return _of_runs(
        results,
        "When and why each of them ended",
        results.runs[(results.runs.state == DONE) & ~results.runs.ok],
        ("outcome", lambda run: Entry(run.status, "bad")),
        ("#at", lambda run: instant(run.end)),
        ("reason", reason),
    )


def losses_table(results: Results) -> Table:
    """Show every run without a result, and why."""
    return _of_runs(
        results,
        "Why each of them has no result",
        results.lost,
        ("outcome", lambda run: _ending(run)._replace(detail="")),
        ("reason", lambda run: cut(run.message or "no reason")),
    )


def endings_by_reason(results: Results) -> Table:
    """Count how the runs of each controller ended; for where single ones are too many."""
    runs = results.runs[~results.runs.ok]
    kinds = runs.status.where(runs.state == DONE, runs.state)
    counts = pd.crosstab(runs.label, kinds).reindex(columns=kinds.unique())
    own = [label for label in results.labels if label in counts.index]
    rows = ([label_entry(label), *map(str, counts.loc[label])] for label in own)
    return table_of("How many ended how", "controller", rows, *map(Entry, counts.columns))


def saturation_table(results: Results) -> Table | None:
    """Show where limits of the motors cut torques: scenarios by controllers; None if nowhere."""
    runs, labels = results.runs, results.labels
    share = results.metric("saturation_share")

    def entry(own: pd.DataFrame) -> Entry:
        found, starts = share.loc[own.index].dropna(), own.saturation.dropna()
        if not len(found) or not len(starts):
            return Entry("0 %" if len(found) else UNDEFINED, "faint")
        where = f"{len(starts)} of {len(own)} runs, from {instant(starts.min())}"
        most = f"at most {number(100.0 * found.max(), 2)} %"
        return Entry(f"{number(100.0 * found.median(), 2)} %", "", most, unit=where)

    variants = runs.cell.map(results.cells.variant)
    rows = [
        [name, *(entry(runs[(variants == name) & (runs.label == label)]) for label in labels)]
        for name in variants[runs.saturation.notna()].unique()
    ]
    caption = (
        "Share of the ticks at which a limit cut a torque, median over runs; in how many at all"
    )
    return table_of(caption, "scenario", rows, *map(label_entry, labels)) if rows else None


def unused_table(results: Results) -> Table:
    """Show files among the records that could not be used."""
    rows = ((file, cut(reason)) for file, reason in results.unused.items())
    return table_of("What is wrong with each of them", "file;reason", rows)


def replays_table(results: Results, most: int) -> Table:
    """Show how to look at each run: the command, and the page where there is one.

    Where there are more than so many runs: those that ended early, and those with a page.
    """
    runs = results.runs[results.runs.command != ""]
    if len(runs) > most:
        runs = runs[(runs.replay != "") | ~runs.ok][:most]
    columns: Columns = [
        ("outcome", lambda run: _ending(run)._replace(detail="")),
        ("command", lambda run: Entry(run.command, command=True)),
        ("page", lambda run: Entry("replay" if run.replay else UNDEFINED, link=run.replay)),
    ]
    shown = columns if runs.replay.any() else columns[:2]
    return _of_runs(results, "How to look at each run", runs, *shown)


# Computing times, definitions, origin --------------------------------------------------------------


def timing_table(results: Results) -> Table:
    """Show what a control step costs: controller x robot, over all scenarios and seeds."""
    names = ["compute_time_median", "compute_time_p99"]
    times = results.metrics.reindex(columns=names).where(np.isfinite)
    # a few ticks before a divergence say nothing
    runs = results.runs[results.runs.ok]
    robots = results.cells.robot.unique()
    keys = pd.MultiIndex.from_product([results.labels, robots])
    medians = times.loc[runs.index].groupby([runs.label, runs.robot]).median().reindex(keys)
    rows = (
        [label_entry(label)]
        + [Entry(metric_value(n, medians[n][label, r])) for r in robots for n in names]
        for label in results.labels
    )
    heads = [Entry(name) for r in robots for name in (f"{r}: median", "99th percentile")]
    caption = "Time that the controller took for a tick (µs); median over the completed runs"
    return table_of(caption, "controller", rows, *heads)


def definitions_table() -> Table:
    """Show what the metrics are."""
    rows = (
        (metric.name, metric.unit, metric.description, metric.better or UNDEFINED)
        for metric in _by_section()
    )
    return table_of("Definitions of the metrics", "metric;unit;definition;better", rows)


def versions_table(results: Results) -> tuple[Table, str]:
    """Show the versions in the runs' records; and a warning where some are mixed."""
    done = results.runs[results.runs.state == DONE]
    known = {name for versions in done.versions for name in versions}
    rows, mixed = [], []
    for name in sorted(known, key=lambda name: (name not in ("mobman", "python"), name)):
        found = Counter(versions.get(name, "unknown") for versions in done.versions)
        shown = Entry(next(iter(found)))
        if len(found) > 1:
            mixed.append(name)
            shown = Entry(", ".join(f"{v} ({count(n, 'run')})" for v, n in found.items()), "bad")
        rows.append([name, shown])
    warning = (
        f"Runs of different versions are mixed ({', '.join(mixed)}): they are not strictly comparable. "
        "Run the suite again to have one."
    )
    return table_of("Versions", "of;version", rows), warning if mixed else ""


def machines_table(results: Results) -> Table:
    """Show the machines that the runs were computed on, as their records say it."""
    done = results.runs[results.runs.state == DONE]
    names = "processor", "architecture", "system"
    counts = Counter(tuple(m.get(name) or "unknown" for name in names) for m in done.machine)
    rows = ([*facts, str(n)] for facts, n in counts.most_common())
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
    rows = ((name, value or UNDEFINED) for name, value in facts.items())
    return table_of("Machine that wrote this report", "of;value", rows)
