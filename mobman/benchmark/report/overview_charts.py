"""Charts of all runs: the leaderboard, profiles, what precision costs, scenarios, sampling periods."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mobman.arrays import Array
from mobman.benchmark.report.cells import CellRuns, Group, unique
from mobman.benchmark.report.chart import (
    Axis,
    Band,
    Chart,
    Curve,
    Item,
    Key,
    Look,
    Panel,
    Point,
    Rule,
    Span,
    Tile,
    decades,
)
from mobman.benchmark.report.format import number
from mobman.benchmark.report.leaderboard import Leaderboard
from mobman.benchmark.report.scores import Field, cell_error
from mobman.benchmark.report.time_charts import SUCCESS
from mobman.benchmark.statistics import (
    FLOOR,
    Interval,
    median,
    performance_profile,
    score_profile,
)

_POINTS = 121  # of a profile
EFFORTS = {
    "torque_energy": "integral of |v|² over the cell's least",
    "torque_variation": "total variation of v over the cell's least",
}
"""What precision is paid for with: metrics, and their axes."""
_FRONT = Look("kf", "#8a8a8a", "#8a8a8a", order=1.2)
_MOST_PERIODS = 8  # that are ticks of their own
_MOST_SCENARIOS = 80  # rows of a heat map


def leaderboard_chart(board: Leaderboard, styles: Mapping[str, Look]) -> Chart:
    """The geometric interquartile mean of each controller, with its interval."""
    standings = board.compared
    values = [v for s in standings for v in (s.error.estimate, s.error.low, s.error.high)]
    low, high, end = _with_failures(values)
    items: list[Item] = [*_failures(high, end), Rule(SUCCESS, "x")]
    for row, standing in enumerate(standings):
        look = styles[standing.label]
        items += _interval(standing.error, row, look, low, end)
    names = [standing.label for standing in standings]
    return Chart(
        "Geometric interquartile mean of the steady task error of each controller, with intervals",
        [
            Panel(
                _error_axis("steady |eᵉ|, geometric interquartile mean  (m)", low, high, end),
                Axis("", len(names) - 0.5, -0.5, names=names),
                items,
            )
        ],
        height=30.0 * len(names) + 14.0,
    )


def overview_chart(group: Group, styles: Mapping[str, Look]) -> Chart:
    """The largest steady error of each controller in each scenario; worst over the seeds."""
    labels = group.labels
    points = {
        (row, label): cell_error(cell, label)
        for row, cell in enumerate(group.cells)
        for label in cell.labels
        if not cell.pending(label)
    }
    low, high, end = _with_failures(list(points.values()))
    items: list[Item] = [*_failures(high, end), Rule(SUCCESS, "x")]
    items += [Rule(row - 0.5, "y", dotted=False) for row in range(1, len(group.cells))]
    for (row, label), value in points.items():
        offset = 0.74 * ((labels.index(label) + 0.5) / len(labels) - 0.5)
        failed = not math.isfinite(value)
        items.append(
            Point(
                end if failed else value, row + offset, styles[label], "cross" if failed else None
            )
        )
    names = [cell.variant for cell in group.cells]
    return Chart(
        f"Largest steady task error of each controller: {group.name}",
        [
            Panel(
                _error_axis("largest |eᵉ| in the steady part  (m)", low, high, end),
                Axis("", len(names) - 0.5, -0.5, names=names),
                items,
            )
        ],
        height=len(names) * (20.0 + 8.0 * len(labels)),
        legend=[Key(label, styles[label], "marker") for label in labels],
    )


def profiles_chart(field: Field, styles: Mapping[str, Look]) -> Chart:
    """Performance profile and score profile, side by side."""
    errors = field.errors()
    finite = errors[np.isfinite(errors)]
    low, high = decades(np.maximum(finite, FLOOR), FLOOR)
    factor = max(10.0, high / low)
    taus = np.logspace(0.0, math.log10(factor), _POINTS)
    thresholds = np.logspace(math.log10(low), math.log10(high), _POINTS)
    shares = performance_profile(errors, taus, floor=FLOOR)
    left: list[Item] = []
    right: list[Item] = [Rule(SUCCESS, "x")] if low < SUCCESS < high else []
    for label, share, own in zip(field.labels, shares, errors, strict=True):
        look = styles[label]
        left.append(Curve(*_steps(taus, share), look))
        profile = score_profile(np.maximum(own, FLOOR), thresholds, strata=field.strata())
        x, upper = _steps(thresholds, profile.high)
        right.append(Band(x, _steps(thresholds, profile.low)[1], upper, look))
        right.append(Curve(*_steps(thresholds, profile.share), look))
    share_axis = Axis("share of cells", 0.0, 1.02)
    return Chart(
        "Performance profile and score profile of the steady task error",
        [
            Panel(
                Axis("within this factor of the cell's best", 1.0, factor, log=True),
                share_axis,
                left,
                "Performance profile",
            ),
            Panel(
                Axis("steady |eᵉ| at most  (m)", low, high, log=True),
                replace(share_axis, label=""),
                right,
                "Score profile",
            ),
        ],
        columns=2,
        height=250.0,
        legend=[Key(label, styles[label]) for label in field.labels],
    )


@dataclass(frozen=True)
class Price:
    """What a controller's precision costs."""

    label: str
    error: Interval
    """Geometric interquartile mean (m)."""
    effort: Interval
    """Median over cells of the effort over the cell's least."""
    front: bool
    """Whether no other is as good in both and better in one."""


def prices_of(field: Field, board: Leaderboard, metric: str) -> list[Price]:
    """Precision against an effort; failures cost, and miss, without end."""
    errors = {standing.label: standing.error for standing in board.compared}
    efforts = {
        label: median(row, scale="log10", strata=field.strata())
        for label, row in zip(field.labels, field.efforts(metric), strict=True)
    }
    points = {label: (errors[label].estimate, efforts[label].estimate) for label in errors}
    return [
        Price(label, errors[label], efforts[label], _undominated(label, points)) for label in errors
    ]


def pareto_chart(prices: Mapping[str, Sequence[Price]], styles: Mapping[str, Look]) -> Chart:
    """Precision against each effort, with the front."""
    panels: list[Panel] = []
    errors = [v for own in prices.values() for p in own for v in _limits(p.error)]
    low, high, _ = _with_failures(errors)
    for metric, found in prices.items():
        shown = _drawn(found)
        efforts = [min(v, 1e12) for p in shown for v in _limits(p.effort) if math.isfinite(v)]
        left, right = _padded(efforts)
        items: list[Item] = [Rule(SUCCESS, "y")] if low < SUCCESS < high else []
        front = sorted((p for p in shown if p.front), key=lambda p: p.effort.estimate)
        if front:
            x = [p.effort.estimate for p in front]
            y = [p.error.estimate for p in front]
            stairs_x = [*np.repeat(x, 2)[1:].tolist(), right]
            stairs_y = np.repeat(y, 2).tolist()
            items.append(Curve(np.array(stairs_x), np.array(stairs_y), _FRONT, thin=True))
        for price in shown:
            look = styles[price.label]
            x0, y0 = price.effort.estimate, max(price.error.estimate, low)
            across = np.clip([price.effort.low, price.effort.high], left, right)
            down = np.clip([price.error.low, price.error.high], low, high)
            items.append(Curve(across, np.full(2, y0), look, thin=True))
            items.append(Curve(np.full(2, x0), down, look, thin=True))
            items.append(Point(x0, y0, look))
        y_axis = Axis("steady |eᵉ|  (m)" if not panels else "", low, high, log=True)
        panels.append(Panel(Axis(EFFORTS[metric], left, right, log=True), y_axis, items))
    labels = unique([price.label for found in prices.values() for price in _drawn(found)])
    return Chart(
        "Precision against effort of each controller, with the Pareto front",
        panels,
        columns=2,
        height=260.0,
        legend=[Key(label, styles[label], "marker") for label in labels]
        + [Key("front", _FRONT, "line")],
    )


def scenarios_chart(field: Field) -> Chart:
    """A heat map: the median error of each controller in each scenario, over robots and tasks."""
    rows: dict[str, list[CellRuns]] = {}
    for cell in field.cells:
        rows.setdefault(cell.variant, []).append(cell)
    order = sorted(rows, key=lambda name: _family_order(rows[name][0], field))[:_MOST_SCENARIOS]
    errors = np.array(
        [
            [_middle([cell_error(c, label) for c in rows[n]]) for label in field.labels]
            for n in order
        ]
    )
    low, high = decades(np.maximum(errors[np.isfinite(errors)], FLOOR), FLOOR)
    items: list[Item] = []
    for row in range(len(order)):
        for column in range(len(field.labels)):
            error = errors[row, column]
            if math.isfinite(error):
                shade = math.log10(max(error, low) / low) / math.log10(high / low)
                items.append(Tile(column, row, min(shade, 1.0), number(error, 1)))
            else:
                items.append(Tile(column, row, math.nan, "×"))
    return Chart(
        "Heat map of the steady task error: scenarios by controllers",
        [
            Panel(
                Axis("", -0.5, len(field.labels) - 0.5, names=field.labels),
                Axis("", len(order) - 0.5, -0.5, names=order),
                items,
            )
        ],
        height=24.0 * len(order),
    )


def scenarios_left_out(field: Field) -> int:
    """How many scenarios have no row in the heat map."""
    return max(0, len({cell.variant for cell in field.cells}) - _MOST_SCENARIOS)


def periods_chart(groups: Sequence[Group], styles: Mapping[str, Look]) -> Chart | None:
    """Error against the sampling period, where a suite varies it; None where it does not.

    A panel for each robot and task: the median over scenarios of the worst of the seeds. The
    scenarios are those that are at every period, so that points differ by the period alone.
    """
    varied = {group.name: swept for group in groups if (swept := _swept(group))}
    if not varied:
        return None
    panels = []
    for name, swept in varied.items():
        points: dict[str, dict[float, float]] = {}
        for label in unique([label for cell in swept for label in cell.labels]):
            for dt in sorted({cell.dt for cell in swept}):
                cells = [cell for cell in swept if cell.dt == dt]
                if all(label in cell.labels and not cell.pending(label) for cell in cells):
                    errors = [cell_error(cell, label) for cell in cells]
                    points.setdefault(label, {})[dt] = _middle(errors)
        if not points:  # nothing of it is done yet
            continue
        low, high, end = _with_failures([v for own in points.values() for v in own.values()])
        periods = sorted({dt for own in points.values() for dt in own})
        items: list[Item] = [Rule(SUCCESS, "y")] if low < SUCCESS < high else []
        items.append(Rule(10**0.5 * high, "y", dotted=False))
        for label, own in points.items():
            look = styles[label]
            x = 1e3 * np.array(list(own))
            y = np.array([v if math.isfinite(v) else math.nan for v in own.values()])
            items.append(Curve(x, y, look))
            for dt, error in own.items():
                failed = not math.isfinite(error)
                place = end if failed else error
                items.append(Point(1e3 * dt, place, look, "cross" if failed else None))
        left, right = 1e3 * periods[0] / 1.15, 1e3 * periods[-1] * 1.15
        y_axis = _Cut("", low, end * 2.5, log=True, extra=[(end, "∞")])
        ticks = [1e3 * dt for dt in periods] if len(periods) <= _MOST_PERIODS else ()
        x_axis = Axis("dt  (ms)", left, right, log=True, at=ticks)
        panels.append(Panel(x_axis, y_axis, items, name))
    if not panels:
        return None
    labels = unique([label for swept in varied.values() for c in swept for label in c.labels])
    return Chart(
        "Steady task error against the sampling period, both axes log",
        panels,
        columns=1 if len(panels) == 1 else 2,
        height=260.0,
        legend=[Key(label, styles[label], "both") for label in labels],
        label="steady |eᵉ|  (m)",
    )


_FRONT = Look("kf", "#8a8a8a", "#8a8a8a", order=1.2)
EXTRA_LOOKS = (_FRONT,)
"""Beside those of controllers and motors."""


def _swept(group: Group) -> list[CellRuns]:
    """The cells of the scenarios that are at the most periods, the same for all of them."""
    periods: dict[str, set[float]] = {}
    for cell in group.cells:
        periods.setdefault(cell.scenario, set()).add(cell.dt)
    most = max(periods.values(), key=len)  # of equal ones, the first scenario's
    if len(most) < 2:
        return []
    return [cell for cell in group.cells if periods[cell.scenario] == most]


def _middle(errors: Sequence[float]) -> float:
    """The upper median: where half of an even number failed, this failed."""
    return sorted(errors)[len(errors) // 2]


def _family_order(cell: CellRuns, field: Field) -> int:
    return list(field.families).index(cell.family)


def _steps(x: Array, y: Array) -> tuple[Array, Array]:
    """A staircase, of a function that is constant from each x to the next."""
    return np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]


def _limits(interval: Interval) -> tuple[float, float, float]:
    return interval.low, interval.estimate, interval.high


def _drawn(prices: Sequence[Price]) -> list[Price]:
    return [p for p in prices if math.isfinite(p.error.estimate + p.effort.estimate)]


def _undominated(label: str, points: Mapping[str, tuple[float, float]]) -> bool:
    own = points[label]
    if not all(map(math.isfinite, own)):
        return False
    return not any(
        other != own and other[0] <= own[0] and other[1] <= own[1] for other in points.values()
    )


def _padded(values: Sequence[float]) -> tuple[float, float]:
    if not values:
        return 1.0, 10.0
    low, high = min(values), max(values)
    margin = max((high / low) ** 0.08, 1.05)
    return low / margin, high * margin


def _with_failures(values: Sequence[float]) -> tuple[float, float, float]:
    """Limits of an error axis, and where what failed is put beyond them."""
    found = np.maximum(np.asarray(list(values), dtype=float), FLOOR)
    low, high = decades(found[np.isfinite(found)], FLOOR)
    return low, high, 10.0 * high


def _error_axis(label: str, low: float, high: float, end: float) -> Axis:
    return _Cut(label, low / 1.6, end * 2.5, log=True, extra=[(end, "∞")])


class _Cut(Axis):
    """An error axis that has no ticks in the part where failures are put."""

    def ticks(self, most: int) -> list[tuple[float, str]]:
        (end, text), *_ = self.extra
        inner = replace(Axis(self.label, self.low, 0.2 * end, log=True), extra=())
        return [*inner.ticks(most), (end, text)]


def _failures(high: float, end: float) -> list[Item]:
    return [Span(10**0.5 * high, 2.5 * end)]


def _interval(interval: Interval, row: float, look: Look, low: float, end: float) -> list[Item]:
    ends = [end if not math.isfinite(v) else max(v, low) for v in (interval.low, interval.high)]
    failed = not math.isfinite(interval.estimate)
    at = end if failed else max(interval.estimate, low)
    return [
        Curve(np.array(ends), np.full(2, row), look),
        Point(at, row, look, "cross" if failed else None),
    ]
