"""Charts as PDF, for papers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from mobman.benchmark.report.chart import (
    Band,
    Chart,
    Curve,
    Item,
    Key,
    Label,
    Look,
    Marker,
    Panel,
    Point,
    Rule,
    Span,
    Tile,
)

_INCH = 96.0  # px, as the charts' sizes are meant
_SCALE = 0.75  # on paper they are smaller: 7 inches across a page, letters of 8 pt
_MARKERS: dict[Marker, str] = {
    "circle": "o",
    "square": "s",
    "triangle": "^",
    "diamond": "D",
    "wedge": "v",
    "plus": "+",
    "star": (6, 2, 0),  # type: ignore[dict-item]
    "cross": "x",
}
_SETTINGS: dict[str, Any] = {
    "pdf.fonttype": 42,  # text stays text, as journals ask for
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.unicode_minus": True,
    "text.parse_math": False,  # names may have dollar signs
}
_ABREAST = 5  # entries of a legend beneath
_FAINT, _GRID = "#8a8a8a", "#e4e4e4"


def write_pdf(path: Path, chart: Chart) -> None:
    """A chart as a PDF file of its own.

    Raises:
        OSError: If it cannot be written.
    """
    # whatever the user's matplotlibrc says, and without changing what he has set
    with matplotlib.style.context(["default", _SETTINGS]):
        figure_of(chart).savefig(
            path,
            format="pdf",
            metadata={"CreationDate": None, "Title": chart.title},
        )


def figure_of(chart: Chart) -> Figure:
    """A chart as matplotlib's figure."""
    rows = math.ceil(len(chart.panels) / chart.columns)
    beside = chart.columns == 1 and bool(chart.legend)
    width = chart.width / _INCH * _SCALE
    below = 0.0 if beside else 22.0 * math.ceil(len(chart.legend) / _ABREAST)
    height = (rows * (chart.height + _foot(chart)) + below) / _INCH * _SCALE
    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(rows, chart.columns, squeeze=False)
    for axes, panel in zip(grid.flat, chart.panels, strict=False):
        _draw(axes, panel)
    for axes in grid.flat[len(chart.panels) :]:
        axes.set_visible(False)
    if chart.label:
        figure.supylabel(chart.label, fontsize=8.0)
    if chart.legend:
        figure.legend(
            [_handle(key) for key in chart.legend],
            [key.text for key in chart.legend],
            loc="outside right upper" if beside else "outside lower center",
            ncols=1 if beside else min(len(chart.legend), _ABREAST),
            frameon=False,
            fontsize=7.0,
        )
    return figure


def _foot(chart: Chart) -> float:
    """Room for what is beneath and above a panel (px); names are slanted."""
    longest = max((len(name) for panel in chart.panels for name in panel.x.names), default=0)
    return 55.0 + 5.0 * longest


def _draw(axes: Axes, panel: Panel) -> None:
    heat = any(isinstance(item, Tile) for item in panel.items)
    for axis, own, limits in (
        (axes.xaxis, panel.x, axes.set_xlim),
        (axes.yaxis, panel.y, axes.set_ylim),
    ):
        if own.log:
            (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
        limits(own.low, own.high)
        ticks = own.ticks(8)
        axis.set_ticks([value for value, _ in ticks], labels=[text for _, text in ticks])
        axis.set_minor_locator(NullLocator())
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label)
    if panel.x.names:
        axes.tick_params(axis="x", rotation=32)
    if panel.title:
        axes.set_title(panel.title, loc="left", fontsize=8.0)
    if not heat:
        axes.grid(True, color=_GRID, linewidth=0.5)
        axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for item in panel.items:
        _item(axes, item)


def _item(axes: Axes, item: Item) -> None:
    if isinstance(item, Curve):
        axes.plot(item.x, item.y, **_line(item.look, thin=item.thin))
    elif isinstance(item, Band):
        axes.fill_between(
            item.x, item.low, item.high, color=item.look.colour, alpha=0.16, linewidth=0.0
        )
    elif isinstance(item, Point):
        axes.plot([item.x], [item.y], clip_on=False, zorder=9.0, **_marker(item.look, item.shape))
    elif isinstance(item, Rule):
        draw = axes.axvline if item.along == "x" else axes.axhline
        style: Any = (0.0, (1.0, 2.0)) if item.dotted else "solid"
        draw(item.at, color=_FAINT, linewidth=0.6, linestyle=style, zorder=1.2)
    elif isinstance(item, Span):
        axes.axvspan(item.low, item.high, color="#f3f4f5", zorder=0.0)
    elif isinstance(item, Tile):
        _tile(axes, item)
    elif isinstance(item, Label):
        axes.text(item.x, item.y, item.text, ha="center", va="center", color=_FAINT)


def _tile(axes: Axes, item: Tile) -> None:
    failed = math.isnan(item.shade)
    colour = "#6b7178" if failed else matplotlib.colormaps["Blues"](0.08 + 0.85 * item.shade)
    x = np.array([item.column - 0.5, item.column + 0.5])
    axes.fill_between(x, item.row - 0.5, item.row + 0.5, color=colour, linewidth=0.0)
    ink = "white" if failed or item.shade > 0.55 else "#1f2328"
    axes.text(item.column, item.row, item.text, ha="center", va="center", fontsize=6.5, color=ink)


def _line(look: Look, *, thin: bool = False) -> dict[str, Any]:
    return {
        "color": look.colour,
        "linewidth": 0.9 if thin else _SCALE * look.width,
        "linestyle": (0.0, look.dashes) if look.dashes and not thin else "solid",
        "zorder": look.order,
    }


def _marker(look: Look, shape: Marker | None) -> dict[str, Any]:
    return {
        "marker": _MARKERS[shape or look.marker],
        "markersize": 5.0,
        "markeredgewidth": 1.1,
        "color": look.colour,
        "markerfacecolor": "white" if look.hollow else look.colour,
        "linestyle": "none",
    }


def _handle(key: Key) -> Line2D:
    style = _line(key.look) if key.kind != "marker" else {}
    if key.kind != "line":
        mark = _marker(key.look, None)
        if key.kind == "both":
            del mark["linestyle"]
        style |= mark
    return Line2D([], [], **style)
