"""The figures: the paper's Figs. 2 to 4, and an overview of the errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator

from mobman.arrays import Array
from mobman.benchmark.report.cells import Cell, Group
from mobman.benchmark.report.content import ReportedRun, ReportedSuite
from mobman.benchmark.report.format import ending
from mobman.benchmark.report.style import Style
from mobman.benchmark.report.tables import worst_error
from mobman.benchmark.report.thinning import thin
from mobman.simulation.metrics.metric import STEADY

FLOOR = 1e-12
"""Errors below it are drawn at it."""
SUCCESS = 1e-4
"""The accuracy (m) that the paper asks for, and the metric ``success``."""

_WIDTH = 8.8  # inch
_INK = "#333333"
_FAINT = "#8a8a8a"
_GRID = "#e4e4e4"
# Nine colours for motors: they never meet the controllers' in one figure.
_MOTORS = (
    "#332288", "#88ccee", "#117733", "#ddaa33", "#cc6677",
    "#aa4499", "#44aa99", "#882255", "#777777",
)  # fmt: skip
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def task_error_figure(cell: Cell, suite: ReportedSuite, styles: Mapping[str, Style]) -> Figure:
    """Fig. 2: |e^e| against time, all controllers."""
    figure, axes = _error_figure(
        cell, suite, styles, "|eᵉ|  (m)", lambda run: run.record.task_error
    )
    low, high = axes.get_ylim()
    if low < SUCCESS < high:
        axes.axhline(SUCCESS, color=_FAINT, linewidth=0.8, linestyle=(0.0, (1.0, 2.0)), zorder=1.2)
    return figure


def auxiliary_error_figure(cell: Cell, suite: ReportedSuite, styles: Mapping[str, Style]) -> Figure:
    """Fig. 3: |e^a| against time, all controllers."""
    return _error_figure(cell, suite, styles, "|eᵃ|", lambda run: run.record.auxiliary_error)[0]


def torque_figure(run: ReportedRun, suite: ReportedSuite) -> Figure:
    """Fig. 4: the torques of a run, motors of like size together."""
    parts = motors_by_size(run.record.torque)
    height = 2.6 if len(parts) == 1 else 1.9 * len(parts)
    figure = Figure(figsize=(_WIDTH, height + 0.5))
    _place(figure, height + 0.5)
    rows = figure.subplots(len(parts), 1, squeeze=False, sharex=True)[:, 0]
    for row, motors in zip(rows, parts, strict=True):
        _draw_torques(row, run, motors, suite)
        _legend(row)
    figure.supylabel("v  (N m or N)", fontsize=9.5, color=_INK, x=0.012)
    rows[-1].set_xlabel("t  (s)")
    return figure


def other_torques_figure(runs: Sequence[ReportedRun], suite: ReportedSuite) -> Figure:
    """The torques of several runs, one panel each, on axes of their own."""
    n = math.ceil(len(runs) / 2)
    height = 1.9 * n + 0.9
    figure = Figure(figsize=(_WIDTH, height))
    panels = figure.subplots(n, 2, squeeze=False, sharex=True).ravel()
    figure.subplots_adjust(
        left=0.085,
        right=0.99,
        top=1.0 - 0.3 / height,
        bottom=0.95 / height,
        hspace=0.38,
        wspace=0.16,
    )
    names: dict[str, Line2D] = {}
    for panel, run in zip(panels, runs, strict=False):
        motors = list(range(run.record.torque.shape[1]))
        lines = _draw_torques(panel, run, motors, suite)
        names |= dict(zip((str(line.get_label()) for line in lines), lines, strict=True))
        if len(run.record.t) < 2:
            panel.text(
                *(0.5, 0.5, "too short to be drawn"),
                transform=panel.transAxes,
                ha="center",
                va="center",
                fontsize=8.5,
                color=_FAINT,
            )
        title = run.label if run.record.ok else f"{run.label}: {ending(run)}"
        panel.set_title(title, fontsize=9, color=_INK, loc="left", pad=4)
    for panel in panels[len(runs) :]:
        panel.set_visible(False)
    # the panel above an empty place is the last of its column, and needs the axis' numbers
    for panel in panels[max(0, len(runs) - 2) : len(runs)]:
        panel.set_xlabel("t  (s)")
        panel.tick_params(labelbottom=True)
    figure.legend(
        list(names.values()),
        list(names),
        loc="lower center",
        ncols=min(len(names), 10) or 1,
        frameon=False,
        fontsize=8.5,
        handlelength=1.2,
        columnspacing=1.1,
    )
    figure.supylabel("v  (N m or N)", fontsize=9.5, color=_INK, x=0.012)
    return figure


def overview_figure(group: Group, styles: Mapping[str, Style]) -> Figure:
    """The largest steady error of each controller in each scenario; worst over the seeds."""
    labels = group.labels
    height = 0.30 + len(group.cells) * (0.24 + 0.085 * len(labels)) + 0.55
    figure = Figure(figsize=(_WIDTH, max(height, 1.9)))
    _place(figure, max(height, 1.9))
    axes = figure.subplots()
    points = {
        (row, label): worst_error(found)
        for row, cell in enumerate(group.cells)
        for label in labels
        if (found := cell.of(label))
    }
    points |= {
        (row, failure.label): math.inf
        for row, cell in enumerate(group.cells)
        for failure in cell.failures
    }
    finite = [max(value, FLOOR) for value in points.values() if math.isfinite(value)]
    low, high = _decades(finite)
    end = 10 * high  # where runs without an error are put
    for (row, label), value in points.items():
        style = styles[label]
        ended = not math.isfinite(value)
        offset = 0.74 * ((labels.index(label) + 0.5) / len(labels) - 0.5)
        axes.plot(
            end if ended else max(value, FLOOR),
            row + offset,
            marker="x" if ended else "o",
            markersize=5.5,
            markeredgewidth=1.4,
            color=style.colour,
            markerfacecolor="white" if style.explicit else style.colour,
            linestyle="none",
            zorder=3,
        )
    axes.set_xscale("log")
    axes.set_xlim(low / 1.6, end * 2.5)
    axes.axvspan(10**0.5 * high, end * 2.5, color="#f4f4f4", zorder=0)
    axes.axvline(SUCCESS, color=_FAINT, linewidth=0.8, linestyle=(0.0, (1.0, 2.0)), zorder=1.2)
    _log_ticks(axes.xaxis, 14)
    ticks = [tick for tick in axes.get_xticks() if low <= tick <= high]
    axes.set_xticks([*ticks, end], [*(_power(tick) for tick in ticks), "∞"])
    axes.set_yticks(range(len(group.cells)), [cell.scenario for cell in group.cells])
    axes.set_ylim(len(group.cells) - 0.5, -0.5)
    for row in range(1, len(group.cells)):
        axes.axhline(row - 0.5, color=_GRID, linewidth=0.8)
    _dress(axes)
    axes.grid(False, axis="y")
    axes.set_xlabel("largest |eᵉ| in the steady part  (m)")
    handles = [
        Line2D(
            [],
            [],
            marker="o",
            markersize=5.5,
            linestyle="none",
            color=styles[label].colour,
            markerfacecolor="white" if styles[label].explicit else styles[label].colour,
            markeredgewidth=1.4,
        )
        for label in labels
    ]
    _legend(axes, handles, labels)
    return figure


def motors_by_size(torque: Array) -> list[list[int]]:
    """Columns of torque that can share an axis, the largest first, in three parts at most.

    The largest of a part is no more than eight times its smallest, but for the last part; idle
    motors join the last, and the order within a part is that of the columns.
    """
    if len(torque) == 0:
        return [list(range(torque.shape[1]))]
    sizes = np.abs(np.where(np.isfinite(torque), torque, 0.0)).max(axis=0)
    parts: list[list[int]] = []
    largest = math.inf
    for motor in np.argsort(-sizes, kind="stable"):
        new = sizes[motor] < largest / 8.0 and sizes[motor] > 0.0 and len(parts) < 3
        if not parts or new:
            parts.append([])
            largest = sizes[motor]
        parts[-1].append(int(motor))
    return [sorted(part) for part in parts]


def _error_figure(
    cell: Cell,
    suite: ReportedSuite,
    styles: Mapping[str, Style],
    label: str,
    errors: Callable[[ReportedRun], Array],
) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(_WIDTH, 3.3))
    _place(figure, 3.3)
    axes = figure.subplots()
    curves = []
    for run in cell.first_seed:
        with np.errstate(over="ignore", invalid="ignore"):
            curves.append((run, np.asarray(np.linalg.norm(errors(run), axis=1))))
    # a run that diverges must not take the scale away from those that do not
    good = [size for run, size in curves if run.record.ok] or [size for _, size in curves]
    low, high = _decades([v for size in good for v in (size[np.isfinite(size)])])
    for run, size in curves:
        style = styles[run.label]
        t, thinned = thin(run.record.t, size, 400)
        drawn = np.where(np.isfinite(thinned), np.maximum(thinned, FLOOR), np.nan)
        axes.plot(
            t,
            drawn,
            color=style.colour,
            linestyle=style.dashes,
            linewidth=style.width,
            zorder=style.order,
            label=run.label if run.record.ok else f"{run.label}\n{ending(run)}",
            solid_joinstyle="round",
        )
        if not run.record.ok and len(t):
            last = drawn[np.isfinite(drawn)]
            where = float(np.clip(last[-1], low, high)) if len(last) else high
            axes.plot(
                t[-1],
                where,
                marker="x",
                markersize=7,
                markeredgewidth=1.8,
                color=style.colour,
                zorder=4,
                clip_on=False,
            )
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    axes.set_xlim(0.0, suite.duration)
    _log_ticks(axes.yaxis, 8)
    axes.axvspan(STEADY * suite.duration, suite.duration, color="#f6f6f6", zorder=0)
    axes.set_xlabel("t  (s)")
    axes.set_ylabel(label)
    _dress(axes)
    _legend(axes)
    return figure, axes


def _draw_torques(
    axes: Axes, run: ReportedRun, motors: Sequence[int], suite: ReportedSuite
) -> list[Line2D]:
    record = run.record
    lines = []
    for motor in motors:
        t, v = thin(record.t, record.torque[:, motor], 250)
        lines += axes.plot(
            t,
            np.where(np.isfinite(v), v, np.nan),
            color=_MOTORS[motor % len(_MOTORS)],
            linestyle="solid" if motor < len(_MOTORS) else "dashed",
            linewidth=1.2,
            label=record.velocity_names[motor],
        )
    if not record.ok:
        _cut(axes, record.torque[:, list(motors)])
        axes.axvline(record.t[-1] if len(record.t) else 0.0, color=_FAINT, linewidth=0.9)
    axes.set_xlim(0.0, suite.duration)
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value)))
    _dress(axes)
    return lines


def _cut(axes: Axes, torque: Array) -> None:
    """Leave the blow-up of a diverging run out of the scale, so that what led to it can be seen."""
    finite = np.abs(torque[np.isfinite(torque)])
    if finite.size < 20:
        return
    bound = 1.2 * float(np.quantile(finite, 0.97))
    if bound > 0.0 and finite.max() > 3.0 * bound:
        axes.set_ylim(-bound, bound)


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """Powers of ten around some values, not below the floor; one decade at least."""
    finite = np.array([v for v in values if v > 0.0 and math.isfinite(v)])
    if not len(finite):
        return FLOOR, 1.0
    low = max(math.floor(math.log10(finite.min()) + 1e-9), round(math.log10(FLOOR)))
    high = min(max(math.ceil(math.log10(finite.max()) - 1e-9), low + 1), 300)
    return 10.0**low, 10.0**high


def _tick(value: float) -> str:
    # ten digits: the sums that ticks are made of end in 0.30000000000000004
    mantissa, _, exponent = f"{value:.10g}".partition("e")
    text = f"{mantissa}e{int(exponent)}" if exponent else mantissa
    return text.replace("-", "−")


def _power(value: float) -> str:
    exponent = round(math.log10(value))
    return "1" if exponent == 0 else f"10{str(exponent).translate(_SUPERSCRIPT)}"


def _log_ticks(axis: Axis, n: int) -> None:
    axis.set_major_locator(LogLocator(numticks=n))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _power(value)))
    axis.minorticks_off()


def _place(figure: Figure, height: float) -> None:
    """Room for the labels below and for the legend on the right."""
    figure.subplots_adjust(
        left=0.085, right=0.755, top=1.0 - 0.14 / height, bottom=0.5 / height, hspace=0.16
    )


def _dress(axes: Axes) -> None:
    axes.grid(True, color=_GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(_FAINT)
    axes.tick_params(colors=_INK, labelsize=8.5, length=3, color=_FAINT)
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_color(_INK)
        label.set_fontsize(9.5)


def _legend(
    axes: Axes, handles: Sequence[Line2D] | None = None, labels: Sequence[str] | None = None
) -> None:
    given = axes.get_legend_handles_labels() if handles is None else (handles, labels)
    axes.legend(
        *given,
        loc="upper left",
        bbox_to_anchor=(1.015, 1.02),
        frameon=False,
        fontsize=8.5,
        handlelength=2.0 if handles is None else 1.0,
        labelspacing=0.55,
        borderaxespad=0.0,
        labelcolor=_INK,
    )
