"""A chart as SVG: its panels in rows, and the legend beside or beneath them."""

from __future__ import annotations

import math

from mobman.benchmark.report.chart import Band, Chart, Curve, Look, Point
from mobman.benchmark.report.svg.drawing import Drawing
from mobman.benchmark.report.svg.frame import Frame
from mobman.benchmark.report.svg.legend import draw_beneath, draw_beside, width_beside
from mobman.benchmark.report.svg.panel import draw_panel
from mobman.benchmark.report.svg.room import foot, head, margin
from mobman.benchmark.report.svg.units import units
from mobman.benchmark.report.svg.words import sideways

_GAP = 12.0  # px on the right of each panel


def draw(key: str, chart: Chart) -> Drawing:
    """A chart as SVG."""
    beside = chart.columns == 1
    right = chart.width - (width_beside(chart.legend) if beside else 0.0)
    body, bottom = _rows(chart, 20.0 * bool(chart.label), right)
    if chart.label:
        body.append(sideways(15.0, bottom / 2.0, chart.label))
    if chart.legend and beside:
        legend, end = draw_beside(chart.legend, right + 4.0)
        body, bottom = body + legend, max(bottom, end)
    elif chart.legend:
        legend, bottom = draw_beneath(chart.legend, bottom, chart.width)
        body += legend
    return Drawing(key, chart.title, "".join(body), (chart.width, bottom), _looks(chart))


def _rows(chart: Chart, left: float, right: float) -> tuple[list[str], float]:
    """The elements of the panels, and where the last row of them ends (px)."""
    wide = (right - left) / chart.columns
    body: list[str] = []
    y = 0.0
    for row in range(math.ceil(len(chart.panels) / chart.columns)):
        panels = chart.panels[row * chart.columns : (row + 1) * chart.columns]
        below = chart.panels[(row + 1) * chart.columns :]
        # a panel names its x axis unless the one beneath it does
        named = [
            column >= len(below) or below[column].x.label != panel.x.label
            for column, panel in enumerate(panels)
        ]
        top = y + (24.0 if any(panel.title for panel in panels) else 10.0)
        top += max(head(panel, wide - _GAP) for panel in panels)
        floor = top + chart.height
        for column, panel in enumerate(panels):
            x0 = left + column * wide + margin(panel.y)
            x1 = left + (column + 1) * wide - _GAP
            frame = Frame(panel, units(x0), units(x1), units(top), units(floor))
            body += draw_panel(frame, named=named[column])
        y = floor + (foot(panels) if any(named) else 12.0)
    return body, y


def _looks(chart: Chart) -> tuple[Look, ...]:
    """The looks of everything in a chart, each once."""
    drawn = [
        item.look
        for panel in chart.panels
        for item in panel.items
        if isinstance(item, (Curve, Band, Point))
    ]
    return tuple(
        {look.key: look for look in (*drawn, *(key.look for key in chart.legend))}.values()
    )
