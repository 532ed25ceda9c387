"""What is drawn in a panel: curves, points, tiles, ..."""

from __future__ import annotations

import math

from markupsafe import escape

from mobman.benchmark.report.chart import Band, Curve, Item, Label, Point, Rule, Span, Tile
from mobman.benchmark.report.svg.frame import Frame
from mobman.benchmark.report.svg.markers import marker
from mobman.benchmark.report.svg.paths import path
from mobman.benchmark.report.svg.units import whole

# From good to bad: light to dark blue, even in grey and with every kind of colour blindness.
_SHADES = ("#eef4fa", "#cfe1f2", "#a6c8e4", "#6fa8d3", "#3f83bd", "#1d5d9b", "#0b3c6f")


def draw_item(frame: Frame, item: Item) -> str:
    """An item's elements; empty where nothing of it can be drawn."""
    if isinstance(item, Curve):
        return _curve(frame, item)
    if isinstance(item, Band):
        return _band(frame, item)
    if isinstance(item, Point):
        return marker(item.look, whole(frame.x(item.x)), whole(frame.y(item.y)), item.shape)
    if isinstance(item, Rule):
        return _rule(frame, item)
    if isinstance(item, Span):
        return _span(frame, item)
    if isinstance(item, Tile):
        return _tile(frame, item)
    return _label(frame, item)


def _curve(frame: Frame, item: Curve) -> str:
    line = path(frame.x(item.x), frame.y_within(item.y))
    more = " n" if item.thin else ""
    return f'<path class="{item.look.key}{more}" d="{line}"/>' if line else ""


def _band(frame: Frame, item: Band) -> str:
    x = frame.x(item.x)
    there, back = path(x, frame.y(item.low)), path(x[::-1], frame.y(item.high)[::-1])
    return f'<path class="{item.look.key} f b" d="{there}L{back[1:]}z"/>' if there else ""


def _rule(frame: Frame, item: Rule) -> str:
    kind = "d" if item.dotted else "g"
    if item.along == "x":
        line = f"M{whole(frame.x(item.at))} {frame.top}V{frame.bottom}"
    else:
        line = f"M{frame.left} {whole(frame.y(item.at))}H{frame.right}"
    return f'<path class="{kind}" d="{line}"/>'


def _span(frame: Frame, item: Span) -> str:
    low, high = whole(frame.x(item.low)), whole(frame.x(item.high))
    return (
        f'<rect class="z" x="{low}" y="{frame.top}" width="{high - low}" height="{frame.height}"/>'
    )


def _tile(frame: Frame, item: Tile) -> str:
    x0, x1 = whole(frame.x(item.column - 0.5)), whole(frame.x(item.column + 0.5))
    y0 = whole(frame.y(item.row - 0.5, inside=False))
    y1 = whole(frame.y(item.row + 0.5, inside=False))
    y0, y1 = min(y0, y1), max(y0, y1)
    if math.isnan(item.shade):
        fill, ink = "#6b7178", "#fff"
    else:
        step = min(int(item.shade * len(_SHADES)), len(_SHADES) - 1)
        fill, ink = _SHADES[step], "#fff" if step > 3 else "#1f2328"
    text = (
        f'<text class="m" style="fill:{ink}" x="{(x0 + x1) // 2}" y="{(y0 + y1) // 2 + 40}">'
        f"{escape(item.text)}</text>"
        if item.text
        else ""
    )
    return (
        f'<rect x="{x0 + 8}" y="{y0 + 8}" width="{max(x1 - x0 - 16, 1)}" '
        f'height="{max(y1 - y0 - 16, 1)}" fill="{fill}" stroke="var(--grid)" '
        f'stroke-width="6"/>{text}'
    )


def _label(frame: Frame, item: Label) -> str:
    place = f'x="{whole(frame.x(item.x))}" y="{whole(frame.y(item.y))}"'
    return f'<text class="s m" {place}>{escape(item.text)}</text>'
