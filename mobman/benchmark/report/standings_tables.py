"""The leaderboard and the comparisons, as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from mobman.benchmark.report.format import UNDEFINED, number
from mobman.benchmark.report.leaderboard import Leaderboard, Standing
from mobman.benchmark.report.overview_charts import Price
from mobman.benchmark.report.table import Entry, Mark, Row, Table, text
from mobman.benchmark.statistics import Interval, PairComparison

SIGNIFICANT = 0.05
"""Adjusted p below which two controllers are called different."""


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


def pairs_table(pairs: Sequence[PairComparison]) -> Table:
    """Every two controllers on the same cells."""
    rows = []
    for pair in pairs:
        found = pair.comparison
        sure = pair.adjusted_p < SIGNIFICANT
        difference = found.median_difference
        rows.append(
            Row(
                text(f"{pair.a} – {pair.b}"),
                [
                    Entry(str(found.n)),
                    Entry(f"{found.wins} / {found.ties} / {found.losses}"),
                    Entry(signed(difference.estimate)),
                    Entry(f"{signed(difference.low)} to {signed(difference.high)}"),
                    Entry(p_value(pair.adjusted_p), "best" if sure else ""),
                    Entry(signed(found.effect_size)),
                    text(_verdict(pair)),
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
        text("says"),
    ]
    return Table("Paired comparisons of the steady error on the same cells", columns, rows)


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


def _verdict(pair: PairComparison) -> str:
    found = pair.comparison
    if found.wins == found.losses == 0:
        return "the same"
    if pair.adjusted_p < SIGNIFICANT:
        return f"{pair.a if found.effect_size < 0 else pair.b} is better"
    if found.smallest_p >= SIGNIFICANT:
        return "too few cells to say"
    return "not told apart"
