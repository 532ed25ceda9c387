"""Charts against time: the paper's Figs. 2 to 4, and all of a cell on a few square inches."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mobman.benchmark.report.chart import (
    Axis,
    Chart,
    Curve,
    Item,
    Key,
    Label,
    Look,
    Panel,
    Point,
    Rule,
    Span,
    decades,
)
from mobman.benchmark.report.curves import CellCurves, MotorPart, RunCurves, Trace, largest
from mobman.benchmark.report.format import ended
from mobman.benchmark.report.style import motor_looks
from mobman.benchmark.statistics import FLOOR
from mobman.simulation.metrics import STEADY

SUCCESS = 1e-4
"""The accuracy (m) that the paper asks for, and the metric ``success``."""


def task_error_chart(curves: CellCurves, styles: Mapping[str, Look]) -> Chart:
    """Fig. 2: |e^e| against time, all controllers."""
    return Chart(
        f"Norm of the task error against time, log axis: {curves.cell.name}",
        [_error_panel(curves, styles, "|eᵉ|  (m)", _task_error, rule=SUCCESS)],
        legend=_legend(curves, styles),
        height=260.0,
    )


def auxiliary_error_chart(curves: CellCurves, styles: Mapping[str, Look]) -> Chart:
    """Fig. 3: |e^a| against time, all controllers."""
    return Chart(
        f"Norm of the auxiliary error against time, log axis: {curves.cell.name}",
        [_error_panel(curves, styles, "|eᵃ|", _auxiliary_error)],
        legend=_legend(curves, styles),
        height=260.0,
    )


def torque_chart(curves: RunCurves) -> Chart:
    """Fig. 4: the torques of a run, motors of like size together."""
    looks = motor_looks(len(curves.names))
    panels = [_torque_panel(curves, part, looks) for part in curves.parts]
    order = [motor for part in curves.parts for motor in part.motors]
    return Chart(
        f"Torques of {curves.run.label} against time: {_place(curves)}",
        panels,
        legend=[Key(curves.names[motor], looks[motor]) for motor in order],
        height=220.0 if len(panels) == 1 else 150.0,
        label="v  (N m or N)",
    )


def other_torques_chart(curves: Sequence[RunCurves]) -> Chart:
    """The torques of several runs, one panel each, on axes of their own."""
    names = list(dict.fromkeys(name for run in curves for name in run.names))
    looks = dict(zip(names, motor_looks(len(names)), strict=True))
    panels = []
    for run in curves:
        own = [looks[name] for name in run.names]
        title = run.run.label
        if not run.run.ok:
            title += f": {ended(run.run.status, run.end)}"
        panels.append(_torque_panel(run, run.whole, own, title))
    return Chart(
        f"Torques of the other controllers against time: {_place(curves[0])}",
        panels,
        columns=2,
        legend=[Key(name, look) for name, look in looks.items()],
        height=130.0,
        label="v  (N m or N)",
    )


def compact_chart(curves: CellCurves, styles: Mapping[str, Look]) -> Chart:
    """Task error, auxiliary error and torque of all controllers, side by side."""
    panels = [
        _error_panel(curves, styles, "", _task_error, rule=SUCCESS, title="|eᵉ| (m)"),
        _error_panel(curves, styles, "", _auxiliary_error, title="|eᵃ|"),
        _error_panel(curves, styles, "", _torque, title="|v| (N m or N)"),
    ]
    return Chart(
        f"Norms of task error, auxiliary error and torques against time: {curves.cell.name}",
        panels,
        columns=3,
        height=170.0,
        legend=[
            Key(key.text.replace("\n", ", "), key.look, key.kind) for key in _legend(curves, styles)
        ],
    )


def _task_error(run: RunCurves) -> Trace:
    return run.task_error


def _auxiliary_error(run: RunCurves) -> Trace:
    return run.auxiliary_error


def _torque(run: RunCurves) -> Trace:
    return run.torque


def _error_panel(
    curves: CellCurves,
    styles: Mapping[str, Look],
    label: str,
    of: Callable[[RunCurves], Trace],
    *,
    rule: float | None = None,
    title: str = "",
) -> Panel:
    # a run that diverges must not take the scale away from those that do not
    good = [of(run).values for run in curves.runs if run.run.ok]
    values = good or [of(run).values for run in curves.runs] or [np.zeros(0)]
    low, high = decades(np.concatenate(values), FLOOR)
    items: list[Item] = [_steady(curves.cell.duration)]
    if rule is not None and low < rule < high:
        items.append(Rule(rule, "y"))
    for run in curves.runs:
        look, trace = styles[run.run.label], of(run)
        items.append(Curve(trace.t, trace.values, look))
        if not run.run.ok and len(trace.t):
            last = trace.values[np.isfinite(trace.values)]
            where = float(np.clip(last[-1], low, high)) if len(last) else high
            items.append(Point(float(trace.t[-1]), where, look, "cross"))
    x = Axis("t  (s)", 0.0, curves.cell.duration)
    return Panel(x, Axis(label, low, high, log=True), items, title)


def _torque_panel(
    curves: RunCurves, part: MotorPart, looks: Sequence[Look], title: str = ""
) -> Panel:
    duration = curves.run.cell.duration
    traces = [curves.motors[motor] for motor in part.motors]
    size = min(largest(traces), part.bound)
    items: list[Item] = [
        Curve(trace.t, trace.values, looks[motor])
        for motor, trace in zip(part.motors, traces, strict=True)
    ]
    if not curves.run.ok and math.isfinite(curves.end):
        items.append(Rule(min(curves.end, duration), "x", dotted=False))
    low, high = -size, size
    if math.isinf(part.bound) and traces:
        finite = np.concatenate([trace.values[np.isfinite(trace.values)] for trace in traces])
        if len(finite):
            low, high = min(float(finite.min()), 0.0), max(float(finite.max()), 0.0)
    margin = 0.05 * (high - low) or 1.0
    if max((len(trace.t) for trace in traces), default=0) < 2:
        items.append(Label(duration / 2.0, (low + high) / 2.0, "too short to be drawn"))
    return Panel(Axis("t  (s)", 0.0, duration), Axis("", low - margin, high + margin), items, title)


def _steady(duration: float) -> Span:
    return Span(STEADY * duration, duration)


def _legend(curves: CellCurves, styles: Mapping[str, Look]) -> list[Key]:
    keys = []
    for run in curves.runs:
        text = run.run.label
        if not run.run.ok:
            text += f"\n{ended(run.run.status, run.end)}"
        keys.append(Key(text, styles[run.run.label]))
    return keys


def _place(curves: RunCurves) -> str:
    cell = curves.run.cell
    return f"{cell.robot}, {cell.task}, {cell.scenario}, dt {1e3 * cell.dt:g} ms"
