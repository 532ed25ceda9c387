"""The figures of a report: over all cells, and of single cells against time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import altair as alt
import numpy as np
import pandas as pd

from mobman.arrays import Array
from mobman.benchmark.report.data import DONE, NOMINAL, Results
from mobman.benchmark.report.format import instant, interval_range, number
from mobman.benchmark.report.standings import EFFORTS, Board, Price, clusters, upper_median
from mobman.benchmark.statistics import Interval, performance_profile, score_profile
from mobman.display import printable
from mobman.figures import charts as parts
from mobman.figures.charts import FLOOR, GREY, Spec, decades, layer, log_axis
from mobman.figures.looks import Look, looks_of
from mobman.simulation.metrics import STEADY
from mobman.simulation.monitors import STAGES

Looks = Mapping[str, Look]
SUCCESS = 1e-4
"""The accuracy (m) of the metric ``success``."""
PAPERS_LAW, PAPERS_TASK = "tsm", "paper"
_POINTS = 81  # of a profile
_MOST_SCENARIOS = 80  # rows of a heat map
_ERROR = "steady |eᵉ|  (m)"


class Figure(NamedTuple):
    """Charts that belong together, with a name for files and what stands beneath them."""

    name: str
    charts: list[Spec]
    caption: str
    across: bool = False  # True if they stand side by side where there is room
    folded: str = ""  # words behind which they are shown on demand


def looks_for(results: Results) -> dict[str, Look]:
    """Give every controller its look."""
    runs = results.runs
    done = runs[runs.state == DONE].drop_duplicates("label").set_index("label").law
    laws = {label: done.get(label, label) for label in results.labels}
    tuned = {label: item.label for label, item in results.tuned.items()}
    return looks_of(laws, set(runs.label[runs.explicit]), tuned)


# Kinds of charts over cells ------------------------------------------------------------------------


def _errors(
    rows: Sequence[dict[str, Any]],
    looks: Looks,
    title: str,
    against: dict[str, Any],
    *,
    upright: bool = True,
    joined: bool = False,
    front: Sequence[tuple[float, float]] = (),
    heading: str = "",
    height: float = 260.0,
) -> Spec:
    """Draw errors on a log axis, upright or not, against something else; failures are beyond its end.

    Rows have ``label``, ``at``, ``error``, and ``value`` in words; with intervals, ``low`` and ``high``
    of the error, ``from`` and ``to`` of the other, whose encodings are given by channel. The points of
    a label may be joined; a front has the corners of a staircase.
    """
    keys, vertical = ("error", "low", "high"), "y" if upright else "x"
    rows = [{"low": row["error"], "high": row["error"], **row} for row in rows]
    found = [max(row[key], FLOOR) for row in rows for key in keys if math.isfinite(row[key])]
    low, high = decades(found)
    low, end = low / 1.6, 10.0 * high
    drawn = []
    for row in sorted(rows, key=lambda row: looks[row["label"]].depth):
        limited = {key: float(np.clip(row[key], low, end)) for key in keys}
        drawn.append({**row, **limited, "failed": float(row["error"] > end)})
    alone = all(row["label"] == row["at"] for row in rows)  # the names are their legend
    look = parts.looked(looks, line=joined, marker=True, legend=not alone)
    lines = {channel: how for channel, how in look.items() if channel != "shape"}
    colours = {channel: how for channel, how in look.items() if channel in ("color", "opacity")}
    channel: Any = alt.Y if upright else alt.X
    error = {vertical: channel("error:Q", **log_axis(low, high, _ERROR, end))}
    good = layer().transform_filter("!datum.failed")  # of failures there is no height
    bars = layer().mark_rule(strokeWidth=3)
    if joined:
        layers = [good.mark_line().encode(**error, **against, **lines)]
    else:
        spread = {vertical: channel("low:Q"), f"{vertical}2": "high:Q"}
        layers = [bars.encode(**spread, **against, **colours)]
    if rows and "from" in rows[0]:
        layers.append(bars.encode(x=alt.X("from:Q"), x2="to:Q", **error, **colours))
    zoned: dict[str, Any] = {vertical: channel("from:Q"), f"{vertical}2": "to:Q"}
    stairs = layer("front").mark_line(interpolate="step-after", color=GREY, strokeWidth=1)
    tips = [alt.Tooltip("label:N", title="controller"), alt.Tooltip("value:N")]
    points: dict[str, Any] = {**error, **against, **colours, "tooltip": tips}
    cross: dict[str, Any] = {"shape": "cross", "angle": 45, "filled": True, "size": 80}
    layers += [
        layer("zone").mark_rect(color=GREY, opacity=0.12).encode(**zoned),
        *([stairs.encode(x="x:Q", y="y:Q", order="x:Q")] if front else ()),
        parts.line_at("marks", vertical),
        good.mark_point(filled=True, size=80).encode(**points, shape=look["shape"]),
        layer().transform_filter("datum.failed").mark_point(**cross).encode(**points),
    ]
    zoom = "x" if upright else ""
    spec = parts.figure(
        parts.layered(*layers, data="rows", height=height, zoom=zoom, legend=not alone),
        title,
        rows=drawn,
        front=[{"x": x, "y": y} for x, y in front],
        marks=[{"at": SUCCESS}] if low < SUCCESS < high else [],
        zone=[{"from": 10**0.5 * high, "to": 2.5 * end}],
    )
    return {**spec, "title": printable(heading)} if heading else spec


def _names(kind: Any, field: str, names: Iterable[str]) -> Any:
    """Make an axis of names, in their order."""
    return kind(f"{field}:N", sort=list(map(printable, names)), title=None)


# Figures over all cells ----------------------------------------------------------------------------


def leaderboard_figure(board: Board, looks: Looks) -> Figure:
    """Draw the geometric interquartile mean of each controller, with its interval."""
    rows = []
    for s in board.ranked:
        words = f"{number(s.error.estimate)} m ({interval_range(s.error)})"
        rows.append({"label": s.label, "at": s.label, **_spread(s.error), "value": words})
    title = (
        "Geometric interquartile mean of the steady task error of each controller, with intervals"
    )
    shown = {s.label: looks[s.label] for s in board.ranked}
    axis, height = {"y": _names(alt.Y, "at", shown)}, 27.0 * len(rows) + 8.0
    return Figure(
        "leaderboard",
        [_errors(rows, shown, title, axis, upright=False, height=height)],
        "Geometric interquartile mean over cells with 95 % intervals; dotted: 1e-4 m, below which a run "
        "can succeed; ×: failures are in the middle half.",
    )


def _spread(error: Interval) -> dict[str, float]:
    return {"error": error.estimate, "low": error.low, "high": error.high}


def overview_figure(results: Results, group: str, looks: Looks) -> Figure:
    """Draw the largest steady error of each controller in each scenario of a group."""
    cells = results.cells[results.cells.group == group]
    errors = results.errors.mask(results.pending).loc[cells.index]
    rows = [
        {"label": label, "at": cells.variant[cell], "error": error, "value": f"{number(error)} m"}
        for cell, found in errors.iterrows()
        for label, error in found.dropna().items()
    ]
    shown = {label: looks[label] for label in results.labels if errors[label].notna().any()}
    height = len(cells) * (12.0 + 9.0 * len(shown))
    axes = {"y": _names(alt.Y, "at", cells.variant)}
    axes["yOffset"] = alt.YOffset("label:N", sort=list(map(printable, shown)))
    title = f"Largest steady task error of each controller: {group}"
    return Figure(
        f"{group} overview",
        [_errors(rows, shown, title, axes, upright=False, height=height)],
        "The same, on a log axis; dotted: 1e-4 m, below which a run can succeed; ×: ended early.",
    )


_MIDDLE = "of an even number the worse of the two in the middle"
_HALF = "×: half of them or more fail."


def heat_map(results: Results, board: Board, column: str, name: str) -> tuple[Figure, int]:
    """Draw the median error of each controller by ``"case"``, the scenario, or by ``"group"``, robot and
    task; also return how many rows the figure has no room for."""
    cells = results.cells.loc[board.cells]
    errors = results.errors.loc[board.cells, board.labels]
    table = errors.groupby(cells[column], sort=False).agg(upper_median)
    kind, over = "robots and tasks", "scenarios and placements"
    if column == "case":
        kind, over = "scenarios", "robots, tasks and placements"
        family = cells.drop_duplicates(column).set_index(column).family
        order = {f: i for i, f in enumerate(cells.family.unique())}
        table = table.sort_index(key=lambda names: family[names].map(order), kind="stable")
    shown = table[:_MOST_SCENARIOS]
    low, high = decades(np.maximum(shown.to_numpy().ravel(), FLOOR))
    rows = [
        {
            "row": row,
            "label": label,
            "text": number(error, 1) if error < math.inf else "×",
            "shade": math.log10(min(max(error, low), high)) if error < math.inf else math.nan,
        }
        for row, found in shown.iterrows()
        for label, error in found.items()
    ]
    x = _names(alt.X, "label", shown.columns).axis(orient="top", labelAngle=-30)
    y = _names(alt.Y, "row", shown.index)
    scale = alt.Scale(scheme="blues", domain=[math.log10(low), math.log10(high)])
    shade: Any = alt.Color("shade:Q", scale=scale, legend=None)
    base = layer().encode(x=x, y=y, tooltip=["row:N", "label:N", "text:N"])
    dark = f"datum.shade > {0.5 * math.log10(low * high):.6g}"
    ink: Any = alt.condition(dark, alt.value("white"), alt.value("#16202c"))
    crossed: Any = alt.condition("isValid(datum.shade)", shade, alt.value("#c9ccd1"))
    chart = parts.layered(
        base.mark_rect(stroke="white", strokeWidth=1, invalid=None).encode(color=crossed),
        base.mark_text(fontSize=11).encode(text="text:N", color=ink),
        data="rows",
        height=22.0 * len(shown),
        legend=False,
    )
    spec = parts.figure(
        chart, f"Heat map of the steady task error: {kind} by controllers", rows=rows
    )
    caption = f"Steady |e^e| (m), the median over {over}, {_MIDDLE}; darker is worse; {_HALF}"
    return Figure(name, [spec], caption), len(table) - len(shown)


def periods_figure(results: Results, looks: Looks) -> Figure | None:
    """Draw error against the sampling period, where a suite varies it; None where it does not.

    A chart for each robot and task: the median over scenarios of the worst of the seeds. The scenarios
    are those that have every period, so that points differ by the period alone.
    """
    charts = []
    for group, cells in results.cells.groupby("group", sort=False):
        periods = cells.groupby("scenario", sort=False).dt.agg(frozenset)
        most = max(periods, key=len)  # of equal ones, the first scenario's
        if len(most) > 1:
            swept = cells[cells.scenario.map(periods) == most]
            charts += _sweep(results, looks, swept, 1e3 * swept.dt, str(group), "dt  (ms)")
    caption = (
        "Steady |e^e| against the sampling period, the median over the scenarios that have every one of "
        f"these periods, {_MIDDLE}; {_HALF}"
    )
    return Figure("sampling periods", charts, caption, across=True) if charts else None


def sensitivity_figure(results: Results, looks: Looks) -> Figure | None:
    """Draw error against the number that a grid of scenarios sweeps, a chart a family."""
    charts = []
    for family, cells in results.cells.groupby("family", sort=False):
        own = cells.scenario.where(cells.scenario.str.startswith(f"{family}-"))
        swept = pd.to_numeric(own.str.removeprefix(f"{family}-"), errors="coerce")
        if swept.notna().all() and swept.nunique() > 2:
            charts += _sweep(results, looks, cells, swept, str(family), f"value of {family}")
    caption = (
        "Steady |e^e| against the number that the scenarios of a family vary, the median over robots, "
        f"tasks and periods, {_MIDDLE}; {_HALF}"
    )
    return Figure("sensitivity", charts, caption, across=True) if charts else None


def _sweep(
    results: Results, looks: Looks, cells: pd.DataFrame, values: pd.Series, name: str, axis: str
) -> list[Spec]:
    """Draw the median error of the cells that have each value; nothing if nothing of it is done yet."""
    errors, pending = (x.loc[cells.index] for x in (results.errors, results.pending))
    rows = []
    for label in results.labels:
        for value, own_cells in sorted(cells.groupby(values).groups.items()):
            found = errors[label].loc[own_cells]
            if found.notna().all() and not pending[label].loc[own_cells].any():
                y = upper_median(found)
                words = f"{value:g}: {number(y)} m"
                rows.append({"label": label, "at": value, "error": y, "value": words})
    if not rows:
        return []
    known = {row["label"] for row in rows}
    low, high = values.min(), values.max()
    log = low > 0.0 and high > 2.0 * low
    margin = 1.15 if log else 0.05 * (high - low)
    limits = [low / margin, high * margin] if log else [low - margin, high + margin]
    ticks = sorted(set(values)) if values.nunique() <= 8 else alt.Undefined
    how: dict[str, Any] = {
        "title": printable(axis),
        "scale": alt.Scale(type="log" if log else "linear", domain=limits, nice=False),
        "axis": alt.Axis(values=ticks, format="~g"),
    }
    shown = {label: look for label, look in looks.items() if label in known}
    title = f"Steady task error against {axis}: {name}"
    return [_errors(rows, shown, title, {"x": alt.X("at:Q", **how)}, joined=True, heading=name)]


def profiles_figure(results: Results, board: Board, looks: Looks) -> Figure:
    """Draw performance profile and score profile."""
    errors = results.errors.loc[board.cells, board.labels].to_numpy().T
    low, high = decades(np.maximum(errors[np.isfinite(errors)], FLOOR))
    factor = max(10.0, high / low)
    taus = np.logspace(0.0, math.log10(factor), _POINTS)
    thresholds = np.logspace(math.log10(low), math.log10(high), _POINTS)
    shares = performance_profile(errors, taus, floor=FLOOR)
    kinds = clusters(results, board.cells)
    scores = [score_profile(np.maximum(own, FLOOR), thresholds, clusters=kinds) for own in errors]
    left = [{"label": k, "x": taus, "y": y} for k, y in zip(board.labels, shares, strict=True)]
    right = [
        {"label": label, "x": thresholds, "y": s.share, "low": s.low, "high": s.high}
        for label, s in zip(board.labels, scores, strict=True)
    ]
    shown = {label: looks[label] for label in board.labels}
    within = log_axis(1.0, factor, "within this factor of the cell's best")
    at_most = log_axis(low, high, "steady |eᵉ| at most  (m)")
    caption = (
        "Performance profile: the share of cells in which a controller’s error is within a factor of "
        "the least of all controllers there; at 1, where it is the best. Score profile: the share of "
        "cells with an error of at most so much, with 95 % bands. A failure is within no factor and "
        "below no error. Higher is better."
    )
    charts = [
        {**_profile(left, shown, within), "title": "Performance profile"},
        {**_profile(right, shown, at_most), "title": "Score profile"},
    ]
    return Figure("profiles", charts, caption, across=True)


def _profile(rows: list[dict[str, Any]], looks: Looks, axis: dict[str, Any]) -> Spec:
    fields: list[Any] = list(rows[0])[1:]
    rows = sorted(rows, key=lambda row: looks[row["label"]].depth)
    base = layer().transform_flatten(fields)
    x = alt.X("x:Q", **axis)
    y = alt.Y("y:Q", title="share of cells", scale=alt.Scale(domain=[0, 1.02], nice=False))
    look = parts.looked(looks, line=True)
    lines = base.mark_line(interpolate="step-after", clip=True).encode(x=x, y=y, **look)
    layers = [lines, parts.hovered(base, "x", "y")]
    if "low" in fields:
        band = base.mark_area(interpolate="step-after", opacity=0.1, clip=True)
        layers.insert(1, band.encode(x="x:Q", y="low:Q", y2="high:Q", color=look["color"]))
    chart = parts.layered(*layers, data="rows", height=250.0, zoom="x")
    title = "Performance profile and score profile of the steady task error"
    return parts.figure(chart, title, rows=rows)


def pareto_figure(prices: Mapping[str, Sequence[Price]], looks: Looks) -> Figure:
    """Draw precision against each effort, with the front."""
    charts = []
    for metric, found in prices.items():
        shown = [p for p in found if math.isfinite(p.error.estimate + p.effort.estimate)]
        ends = [v for p in shown for v in (p.effort.low, p.effort.estimate, p.effort.high)]
        efforts = np.minimum([v for v in ends if not math.isnan(v)] or [1.0, 10.0], 1e12)
        margin = max((efforts.max() / efforts.min()) ** 0.08, 1.05)
        left, right = efforts.min() / margin, efforts.max() * margin
        rows = [
            {
                "label": p.label,
                "at": p.effort.estimate,
                **_spread(p.error),
                "from": max(p.effort.low, left),
                "to": min(p.effort.high, right),
                "value": f"{number(p.error.estimate)} m at {number(p.effort.estimate)}",
            }
            for p in shown
        ]
        corners = sorted((p.effort.estimate, p.error.estimate) for p in shown if p.front)
        corners += [(right, corners[-1][1])] if corners else []
        own_looks = {p.label: looks[p.label] for p in shown}
        title = "Precision against effort of each controller, with the Pareto front"
        axis = alt.X("at:Q", **log_axis(left, right, EFFORTS[metric]))
        charts.append(_errors(rows, own_looks, title, {"x": axis}, front=corners))
    caption = (
        "Lower left is better; bars: 95 % intervals; grey: the front. Controllers that fail in half of "
        "the cells or more are not drawn."
    )
    return Figure("pareto", charts, caption, across=True)


# Single cells --------------------------------------------------------------------------------------


def papers_cell(results: Results) -> int | None:
    """Find the cell whose figures are the paper's: its task where nothing is changed."""
    cells, done = results.cells, set(results.runs.cell[results.runs.state == DONE])
    return next((int(cell) for cell in cells.index[_papers(cells)] if cell in done), None)


def _papers(cells: Any) -> Any:
    """True for the cells, or the cell, of the paper's task where nothing is changed."""
    return (cells.task == PAPERS_TASK) & (cells.scenario == NOMINAL)


class _Curves(NamedTuple):
    """Norms that are drawn against time."""

    axis: str
    caption: str
    values: Callable[[Any], Array | None]  # of a record, in columns; None if it has none
    mark: float | None = None  # value of a dotted line


def _margin(stage: str, record: Any) -> Array | None:
    margin: Array | None = record.signals.get(f"monitors/margin_{stage}")
    return None if margin is None else margin[:, None]


_CURVES = {
    "task error": _Curves(
        _ERROR[7:],
        "Euclidean norm of the task errors e^e. Dotted: 1e-4 m.",
        lambda record: record.task_error[:, :3],
        SUCCESS,
    ),
    "auxiliary error": _Curves(
        "|eᵃ|",
        "Euclidean norm of the auxiliary errors e^a: how far from (locally) optimal for the criterion.",
        lambda record: record.auxiliary_error,
    ),
    "orientation error": _Curves(
        "|eₒ|  (rad)",
        "Euclidean norm of the orientation errors e_o. Dotted: 1e-4 rad.",
        lambda record: record.task_error[:, 3:],
        SUCCESS,
    ),
}
_TORQUE = _Curves(
    "|v|  (N m or N)", "Euclidean norm of the torques v.", lambda record: record.torque
)
_MARGINS = {
    f"margin of the {stage} stage": _Curves(
        "gain over what is needed",
        f"Gain of the {stage} stage over what the theorems ask for along the run. Dotted: 1.",
        partial(_margin, stage),
        1.0,
    )
    for stage in STAGES
}
"""Of monitored runs."""


def cell_figures(
    results: Results, cell: int, looks: Looks, columns: int, motor_columns: int
) -> list[Figure]:
    """Draw the errors of a cell's first seed against time, and the torques.

    Errors are thinned to so many columns, and each motor's torque; of 0 motor columns, the norms of the
    torques are drawn.
    """
    name, duration = results.cells.name[cell], float(results.cells.duration[cell])
    own_runs = results.runs[(results.runs.cell == cell) & (results.runs.state == DONE)]
    records: dict[str, tuple[Any, Any]] = {}
    for run in own_runs[own_runs.seed == own_runs.seed.iloc[0]].itertuples():
        if (record := results.samples(run)) is not None:
            records[run.label] = run, record
    if not records:
        return []
    wanted = {**_CURVES, **(_MARGINS if motor_columns else {"torque": _TORQUE})}
    if all(record.tip_orientation is None for _, record in records.values()):
        del wanted["orientation error"]
    figures = []
    for what, kind in wanted.items():
        curves, good = [], []
        for label, (run, record) in records.items():
            if (values := kind.values(record)) is None:
                continue
            end = math.nan if run.ok or not len(record.t) else float(record.t[-1])
            curves.append(parts.norm_curve(label, record.t, values, end, columns))
            good += [curves[-1].values] if run.ok else []
        if not curves:
            continue
        spec = parts.time_chart(
            curves,
            looks,
            title=f"Norm of the {what} against time, log axis: {name}",
            axis=kind.axis,
            duration=duration,
            # a run that diverges must not take the scale away from those that do not
            limits=decades(np.concatenate(good or [c.values for c in curves])),
            steady=STEADY * duration,
            mark=kind.mark,
            height=240.0 if motor_columns else 170.0,
        )
        figures.append(Figure(f"{name} {what}", [spec], kind.caption))
    if not motor_columns:
        charts = [figure.charts[0] for figure in figures]
        return [Figure(name, charts, "", across=True)]
    shown, *others = _torques(records, name, duration, motor_columns)
    figures.append(shown)
    if _papers(results.cells.loc[cell]):
        figures = [f._replace(caption=f"Fig. {i}. {f.caption}") for i, f in enumerate(figures, 2)]
    return [*figures, *others]


def _torques(
    records: Mapping[str, tuple[Any, Any]], name: str, duration: float, columns: int
) -> list[Figure]:
    """Draw the torques of the paper's law, or else of the first, and of the others on demand."""
    law = (k for k, (run, _) in records.items() if run.law == PAPERS_LAW and not run.explicit)
    shown, found = next(law, next(iter(records))), {}
    for label, (run, record) in records.items():
        # its last sample where its message does not say when it ended
        last = math.isfinite(run.end) or not len(record.t)
        end = run.end if last else float(record.t[-1])
        heading = label if run.ok else f"{label}: {run.status} at {instant(end)}"
        found[label] = parts.torque_charts(
            record.t,
            record.torque,
            list(record.velocity_names),
            title=f"Torques of {label} against time: {name}",
            duration=duration,
            end=math.nan if run.ok else end,
            columns=columns,
            together=label != shown,
            heading="" if label == shown else heading,
        )
    caption = f"Torques v of {shown}; alpha_i: motors of the platform, in its quasi-velocities."
    figures = [Figure(f"{name} torque", found.pop(shown), caption)]
    others = [chart for charts in found.values() for chart in charts]
    caption = (
        "Torques v of the other controllers, each panel on its own scale; a run that diverged is cut "
        "off where it leaves the scale of what came before."
    )
    folded = "Torques of the other controllers"
    if others:
        figures.append(Figure(f"{name} other torques", others, caption, True, folded))
    return figures
