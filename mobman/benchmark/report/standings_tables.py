"""The leaderboard and the comparisons, as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mobman.benchmark.report.format import UNDEFINED, number
from mobman.benchmark.report.leaderboard import Leaderboard, Pair, Standing
from mobman.benchmark.report.overview_charts import Price
from mobman.benchmark.report.scores import Field
from mobman.benchmark.report.table import Entry, Mark, Row, Table, text
from mobman.benchmark.statistics import Interval

SIGNIFICANT = 0.05
"""Adjusted p below which two controllers are called different."""
ALIKE = 0.05
"""Decades: two errors whose median difference is surely below it are called alike, whatever p is."""


def leaderboard_table(board: Leaderboard) -> Table:
    """Every controller's place over all cells."""
    rows = []
    for standing in board.standings:
        lost = [f"{standing.ended} ended early"] if standing.ended else []
        lost += [f"{standing.lost} without result"] if standing.lost else []
        rows.append(
            Row(
                text(rank_range(standing)),
                [
                    text(standing.label, label=standing.label),
                    Entry(number(standing.error.estimate), _leads(standing, board.compared)),
                    Entry(interval_range(standing.error)),
                    Entry(f"{standing.solved} of {standing.cells}"),
                    Entry(percent(standing.rate)),
                    Entry(str(standing.asked)),
                    text(", ".join(lost) or UNDEFINED, "bad" if lost else "faint"),
                ],
            )
        )
    columns = [
        text("rank"),
        text("controller"),
        Entry("steady |e^e| (m)"),
        Entry("95 % interval"),
        Entry("cells solved"),
        Entry("95 % interval"),
        Entry("runs"),
        text("of these, failed"),
    ]
    return Table("Leaderboard over all compared cells", columns, rows)


def families_table(board: Leaderboard) -> Table:
    """Places by scenario family: families in rows, controllers in columns."""
    labels = [standing.label for standing in board.compared]
    rows = []
    for family in board.families:
        entries = []
        for label in labels:
            standing = family.standings[label]
            entries.append(
                Entry(
                    number(standing.error.estimate, 2),
                    _leads(standing, list(family.standings.values())),
                    f"{interval_range(standing.error)}; {standing.solved} of {standing.cells} cells "
                    "solved",
                    unit=f"{rank_range(standing)} · {standing.solved}/{standing.cells}",
                )
            )
        rows.append(Row(text(family.family), [Entry(str(len(family.cells))), *entries]))
    columns = [text("scenario family"), Entry("cells"), *(Entry(x, label=x) for x in labels)]
    caption = "By scenario family: steady |e^e| (m), ranks that the intervals allow · cells solved"
    return Table(caption, columns, rows)


def pairs_table(pairs: Sequence[Pair]) -> Table:
    """Every two controllers on the same cells."""
    rows = []
    for pair in pairs:
        found, success = pair.error, pair.success
        difference = found.median_difference
        rows.append(
            Row(
                text(f"{pair.a} – {pair.b}"),
                [
                    Entry(str(found.n)),
                    Entry(f"{found.wins} / {found.ties} / {found.losses}"),
                    Entry(signed(difference.estimate)),
                    Entry(f"{signed(difference.low)} to {signed(difference.high)}"),
                    _p_entry(pair.error_p),
                    Entry(signed(found.effect_size)),
                    Entry(f"{success.only_a} / {success.only_b}"),
                    _p_entry(pair.success_p),
                    text(_verdict(pair, len(pairs))),
                ],
            )
        )
    columns = [
        text("a – b"),
        Entry("cells"),
        Entry("a better / equal / b better"),
        Entry("median difference (decades)"),
        Entry("95 % interval"),
        Entry("p, Holm"),
        Entry("effect size"),
        Entry("cells solved by a / b only"),
        Entry("p, Holm"),
        text("says"),
    ]
    return Table("Paired comparisons on the same cells", columns, rows)


def tuned_table(
    field: Field, board: Leaderboard, tuned: Mapping[str, Mapping[str, Any]]
) -> Table | None:
    """What tuning brought on the reported cells, and what it cost; None if there is nothing to say.

    Args:
        field: What is compared.
        board: The standings.
        tuned: By label, how its gains were tuned.
    """
    standings = {standing.label: standing for standing in board.compared}
    energy = dict(zip(field.labels, field.efforts("torque_energy"), strict=True))
    rows = []
    for label, item in tuned.items():
        before, after = standings.get(str(item.get("label"))), standings.get(label)
        if before is None or after is None or before is after:
            continue
        found = _between(board.pairs, label, before.label)
        both = np.isfinite(energy[label]) & np.isfinite(energy[before.label])
        ratio = energy[label][both] / energy[before.label][both]
        rows.append(
            Row(
                text(before.label, label=before.label),
                [
                    Entry(number(before.error.estimate)),
                    Entry(number(after.error.estimate)),
                    Entry(found),
                    Entry(f"{before.solved} → {after.solved} of {after.cells}"),
                    Entry(f"{before.ended} → {after.ended} of {after.asked}"),
                    Entry(number(float(np.median(ratio)) if ratio.size else math.nan, 2)),
                ],
            )
        )
    if not rows:
        return None
    columns = [
        text("controller"),
        Entry("steady |e^e|, gains as given (m)"),
        Entry("tuned (m)"),
        Entry("tuned better / equal / worse"),
        Entry("cells solved"),
        Entry("runs that ended early"),
        Entry("integral of |v|², times"),
    ]
    return Table("Gains as given and tuned, on the same cells", columns, rows)


def _between(pairs: Sequence[Pair], a: str, b: str) -> str:
    """In how many cells a is better than b, equal, and worse."""
    for pair in pairs:
        found = pair.error
        if (pair.a, pair.b) == (a, b):
            return f"{found.wins} / {found.ties} / {found.losses}"
        if (pair.a, pair.b) == (b, a):
            return f"{found.losses} / {found.ties} / {found.wins}"
    return UNDEFINED


def prices_table(prices: Mapping[str, Sequence[Price]], units: Mapping[str, str]) -> Table:
    """Precision against effort."""
    first = next(iter(prices.values()), [])
    rows = []
    for index, price in enumerate(first):
        entries = [Entry(number(price.error.estimate))]
        for found in prices.values():
            own = found[index]
            entries.append(Entry(number(own.effort.estimate), "best" if own.front else ""))
            entries.append(Entry(interval_range(own.effort, 3)))
        rows.append(Row(text(price.label, label=price.label), entries))
    columns = [text("controller"), Entry("steady |e^e| (m)")]
    for metric in prices:
        columns += [Entry(units[metric]), Entry("95 % interval")]
    return Table("Precision and effort; bold: on the front", columns, rows)


def rank_range(standing: Standing) -> str:
    """ "1", "1–3", or a dash where there is no rank."""
    if standing.ranks is None:
        return UNDEFINED
    first, last = standing.ranks
    return str(first) if first == last else f"{first}–{last}"


def interval_range(interval: Interval, digits: int = 2) -> str:
    """An interval's ends."""
    return f"{number(interval.low, digits)} to {number(interval.high, digits)}"


def percent(interval: Interval) -> str:
    """An interval of shares."""
    return f"{100 * interval.low:.0f} to {100 * interval.high:.0f} %"


def p_value(value: float) -> str:
    """A p-value: no more zeros than anyone reads."""
    return "< 0.001" if value < 1e-3 else f"{value:.3f}"


def signed(value: float) -> str:
    """A difference."""
    if math.isinf(value):
        return "+∞" if value > 0 else "−∞"
    return f"{value:+.2f}".replace("-", "−")


def _leads(standing: Standing, others: Sequence[Standing]) -> Mark:
    """Marks who may be first, unless all may be."""
    firsts = [other for other in others if other.ranks is not None and other.ranks[0] == 1]
    return "best" if standing in firsts and len(firsts) < len(others) else ""


def _p_entry(value: float) -> Entry:
    return Entry(p_value(value), "best" if value < SIGNIFICANT else "")


def _verdict(pair: Pair, pairs: int) -> str:
    """What one of so many pairs says of the errors, and of the solved cells if that is settled too."""
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
    ):  # no outcome passes the first step of Holm's method
        words = "too few cells to say"
    else:
        words = "not distinguished"
    if pair.success_p < SIGNIFICANT:
        more = pair.a if success.only_a > success.only_b else pair.b
        same = words.startswith(f"{more} has")
        words += " and solves more" if same else f"; {more} solves more"
    return words
