"""Charts as SVG: small, the same on every machine, and fit to stand in a page with others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from mobman.arrays import Array
from mobman.benchmark.report.chart import (
    Axis,
    Band,
    Chart,
    Curve,
    Item,
    Key,
    Look,
    Marker,
    Panel,
    Point,
    Rule,
    Span,
    Tile,
)

# Coordinates are whole tenths of a pixel: a path of them is short, and none is seen to be rounded.
_UNIT = 10.0
_TOLERANCE = 1.5  # units that a curve may be off, so that straight parts need no points
_LETTER = 6.6  # px, of an average letter at 12 px; generous, fonts differ
_LEGEND_LINE = 20.0
_FONTS = "system-ui,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"

STYLE = f"""\
.chart text{{font:120px {_FONTS};fill:var(--ink);stroke:none}}
.chart .t{{fill:var(--ink);font-weight:600}}
.chart .s{{fill:var(--soft)}}
.chart path{{fill:none;stroke-linejoin:round}}
.chart .g{{stroke:var(--grid);stroke-width:7}}
.chart .a{{stroke:var(--axis);stroke-width:9}}
.chart .d{{stroke:var(--axis);stroke-width:9;stroke-dasharray:12 22}}
.chart .z{{fill:var(--shade)}}
.chart .e{{text-anchor:end}}
.chart .m{{text-anchor:middle}}
.chart .n{{stroke-width:12}}
.chart .p{{stroke-width:16;stroke-dasharray:none}}
.chart .h{{fill:var(--page)}}
.chart .b{{stroke:none;opacity:.16}}
"""
"""Of the elements that all charts share; the colours are the page's variables."""
LIGHT = {
    "page": "#fdfdfc",
    "ink": "#1f2328",
    "soft": "#5d646d",
    "grid": "#e4e4e4",
    "axis": "#8a8a8a",
    "shade": "#f3f4f5",
}
DARK = {
    "page": "#16181b",
    "ink": "#dfe2e6",
    "soft": "#9aa1aa",
    "grid": "#2e3237",
    "axis": "#777d85",
    "shade": "#1f2226",
}
# From good to bad: light to dark blue, even in grey and with every kind of colour blindness.
_SHADES = ("#eef4fa", "#cfe1f2", "#a6c8e4", "#6fa8d3", "#3f83bd", "#1d5d9b", "#0b3c6f")


@dataclass(frozen=True)
class Drawing:
    """A figure as SVG."""

    key: str
    """Unique in a report; the file's name without its ending."""
    title: str
    """What it shows, for those who cannot see it."""
    body: str
    """What is in the root element."""
    size: tuple[float, float]
    """Width and height (px)."""
    looks: tuple[Look, ...]
    """That it uses."""

    @property
    def inline(self) -> Markup:
        """For HTML that has the styles: as wide as the place that it has."""
        width, height = (round(_UNIT * length) for length in self.size)
        return Markup(
            f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" '
            f'aria-label="{escape(self.title)}">{self.body}</svg>'
        )

    @property
    def file(self) -> str:
        """Content of a file of its own."""
        width, height = (round(_UNIT * length) for length in self.size)
        variables = ";".join(f"--{name}:{value}" for name, value in LIGHT.items())
        return (
            '<?xml version="1.0" encoding="utf-8"?>\n'
            f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" role="img" '
            f'width="{width / _UNIT:g}" height="{height / _UNIT:g}" '
            f'viewBox="0 0 {width} {height}">'
            f"<title>{escape(self.title)}</title>"
            f"<style>.chart{{{variables}}}{look_style(self.looks)}{STYLE}</style>"
            f'<rect width="{width}" height="{height}" fill="#fff"/>{self.body}</svg>\n'
        )


def look_style(looks: Sequence[Look], *, dark: bool = False) -> str:
    """The style sheet of some looks."""
    rules = []
    for look in sorted(looks, key=lambda look: look.key):
        colour = look.dark if dark else look.colour
        dashes = ""
        if look.dashes:
            lengths = " ".join(f"{_UNIT * length:g}" for length in look.dashes)
            dashes = f";stroke-dasharray:{lengths}"
        rules.append(
            f".chart .{look.key}{{stroke:{colour};stroke-width:{_UNIT * look.width:g}{dashes}}}"
            f".chart .{look.key}.f{{fill:{colour}}}"
        )
    return "".join(rules)


def draw(key: str, chart: Chart) -> Drawing:
    """A chart as SVG."""
    beside = chart.columns == 1
    legend_width = _legend_width(chart) if beside and chart.legend else 0.0
    looks: dict[str, Look] = {}
    body: list[str] = []
    left = 20.0 * bool(chart.label)
    right = chart.width - legend_width
    wide = (right - left) / chart.columns
    rows = math.ceil(len(chart.panels) / chart.columns)
    y = 0.0
    for row in range(rows):
        panels = chart.panels[row * chart.columns : (row + 1) * chart.columns]
        below = chart.panels[(row + 1) * chart.columns :]
        top = y + (24.0 if any(panel.title for panel in panels) else 10.0)
        top += max(_head(panel, wide) for panel in panels)
        floor = top + chart.height
        for column, panel in enumerate(panels):
            # a panel names its x axis unless the one beneath it does
            named = column >= len(below) or below[column].x.label != panel.x.label
            x0 = left + column * wide + _margin(panel.y)
            _draw_panel(
                body, looks, panel, x0, left + (column + 1) * wide - 12.0, top, floor, named
            )
        last = any(
            column >= len(below) or below[column].x.label != panel.x.label
            for column, panel in enumerate(panels)
        )
        y = floor + (_foot(panels) if last else 12.0)
    if chart.label:
        body.append(_sideways(15.0, y / 2.0, chart.label))
    if chart.legend:
        if beside:
            _draw_legend(body, looks, chart.legend, right + 4.0, 8.0, legend_width, 1)
            y = max(y, 14.0 + _LEGEND_LINE * sum(1 + key.text.count("\n") for key in chart.legend))
        else:
            widest = max(len(key.text) for key in chart.legend) * _LETTER + 50.0
            n = max(1, min(len(chart.legend), int(chart.width / widest)))
            _draw_legend(body, looks, chart.legend, 10.0, y + 4.0, chart.width - 10.0, n)
            y += 10.0 + _LEGEND_LINE * math.ceil(len(chart.legend) / n)
    return Drawing(key, chart.title, "".join(body), (chart.width, y), tuple(looks.values()))


def _margin(axis: Axis) -> float:
    """Room for an axis' numbers and name on its left (px)."""
    texts = [text for _, text in axis.ticks(8)]
    longest = max((len(text) for text in texts), default=0)
    return min(260.0, 16.0 + _LETTER * longest) + (24.0 if axis.label else 0.0)


def _head(panel: Panel, wide: float) -> float:
    """Room above a panel of so many px across for the names on its x axis (px)."""
    longest = max((_LETTER * len(name) for name in panel.x.names), default=0.0)
    if not longest:
        return 0.0
    return 12.0 if _fits(longest, wide - _margin(panel.y), panel) else 12.0 + 0.55 * longest


def _fits(longest: float, wide: float, panel: Panel) -> bool:
    """Whether names stand side by side without being slanted."""
    return longest + 8.0 <= wide / len(panel.x.names)


def _foot(panels: Sequence[Panel]) -> float:
    """Room beneath a row (px)."""
    return 10.0 if all(panel.x.names for panel in panels) else 42.0


def _legend_width(chart: Chart) -> float:
    lines = [line for key in chart.legend for line in key.text.split("\n")]
    return min(260.0, 46.0 + _LETTER * max(map(len, lines)))


def _draw_panel(
    body: list[str],
    looks: dict[str, Look],
    panel: Panel,
    x0: float,
    x1: float,
    y0: float,
    y1: float,
    named: bool,
) -> None:
    frame = _Frame(panel, *(round(_UNIT * value) for value in (x0, x1, y0, y1)))
    if panel.title:
        body.append(
            f'<text class="t" x="{frame.left}" y="{frame.top - 80}">{escape(panel.title)}</text>'
        )
    behind = [item for item in panel.items if isinstance(item, (Span, Tile))]
    front = [item for item in panel.items if not isinstance(item, (Span, Tile))]
    front.sort(key=_order)
    body += [frame.item(item, looks) for item in behind]
    frame.axes(body, named)
    body += [frame.item(item, looks) for item in front]


def _order(item: Item) -> float:
    if isinstance(item, Band):
        return 0.0
    if isinstance(item, Curve):
        return item.look.order
    return 1.0 if isinstance(item, Rule) else 9.0


class _Frame:
    """Where a panel is, in units."""

    def __init__(self, panel: Panel, left: int, right: int, top: int, bottom: int) -> None:
        self.panel = panel
        self.left, self.right, self.top, self.bottom = left, right, top, bottom

    def x(self, values: Array | float) -> Array:
        """Across; beyond the frame's ends at most by its width."""
        part = self.panel.x.fractions(np.asarray(values, dtype=float))
        return self.left + (self.right - self.left) * np.clip(part, -1.0, 2.0)

    def y(self, values: Array | float, *, inside: bool = True) -> Array:
        """Down; what is beyond the frame is drawn at its edge, as all curves have to stay in it."""
        part = self.panel.y.fractions(np.asarray(values, dtype=float))
        part = np.clip(part, 0.0, 1.0) if inside else part
        return self.bottom - (self.bottom - self.top) * part

    def _within(self, values: Array) -> Array:
        """As :meth:`y`; where a curve stays outside of the frame, a gap."""
        part = self.panel.y.fractions(np.asarray(values, dtype=float))
        outside = (part < 0.0) | (part > 1.0)
        around = np.concatenate([[True], outside, [True]])
        lost = outside & around[:-2] & around[2:]
        return np.where(lost, np.nan, self.y(values))

    def axes(self, body: list[str], named: bool) -> None:
        """Grid, axes, ticks and names."""
        panel = self.panel
        grid, texts = [], []
        wide, high = self.right - self.left, self.bottom - self.top
        heat = any(isinstance(item, Tile) for item in panel.items)
        longest = max((_LETTER * len(name) for name in panel.x.names), default=0.0)
        flat = bool(longest) and _fits(longest, wide / _UNIT, panel)
        for value, text in panel.x.ticks(max(2, wide // 900)):
            x = _whole(self.x(value))
            if not panel.x.names:
                grid.append(f"M{x} {self.top}v{high}")
                if named:
                    texts.append(
                        f'<text class="m" x="{x}" y="{self.bottom + 170}">{escape(text)}</text>'
                    )
            elif flat:
                texts.append(f'<text class="m" x="{x}" y="{self.top - 60}">{escape(text)}</text>')
            else:  # above, where they are seen first: there may be many rows
                y = self.top - 60
                texts.append(
                    f'<text class="e" x="{x}" y="{y}" transform="rotate(32 {x} {y})">'
                    f"{escape(text)}</text>"
                )
        for value, text in panel.y.ticks(max(2, high // 280)):
            y = _whole(self.y(value))
            if not panel.y.names:
                grid.append(f"M{self.left} {y}h{wide}")
            shown = _shortened(text, 36)
            texts.append(
                f'<text class="e" x="{self.left - 60}" y="{y + 40}">{escape(shown)}</text>'
            )
        if grid:
            body.append(f'<path class="g" d="{"".join(grid)}"/>')
        if not heat:
            body.append(f'<path class="a" d="M{self.left} {self.top}v{high}h{wide}"/>')
        body += texts
        if panel.x.label and named:
            centre = (self.left + self.right) // 2
            body.append(
                f'<text class="m" x="{centre}" y="{self.bottom + 350}">{escape(panel.x.label)}'
                "</text>"
            )
        if panel.y.label:
            offset = _margin(panel.y) - 14.0
            body.append(
                _sideways(
                    self.left / _UNIT - offset,
                    (self.top + self.bottom) / 2.0 / _UNIT,
                    panel.y.label,
                )
            )

    def item(self, item: Item, looks: dict[str, Look]) -> str:
        """What is drawn of an item."""
        if isinstance(item, Curve):
            looks.setdefault(item.look.key, item.look)
            path = _path(self.x(item.x), self._within(item.y))
            more = " n" if item.thin else ""
            return f'<path class="{item.look.key}{more}" d="{path}"/>' if path else ""
        if isinstance(item, Band):
            looks.setdefault(item.look.key, item.look)
            x = self.x(item.x)
            there, back = _path(x, self.y(item.low)), _path(x[::-1], self.y(item.high)[::-1])
            return f'<path class="{item.look.key} f b" d="{there}L{back[1:]}z"/>' if there else ""
        if isinstance(item, Point):
            looks.setdefault(item.look.key, item.look)
            return self._point(item)
        if isinstance(item, Rule):
            kind = "d" if item.dotted else "g"
            if item.along == "x":
                line = f"M{_whole(self.x(item.at))} {self.top}V{self.bottom}"
            else:
                line = f"M{self.left} {_whole(self.y(item.at))}H{self.right}"
            return f'<path class="{kind}" d="{line}"/>'
        if isinstance(item, Span):
            low, high = _whole(self.x(item.low)), _whole(self.x(item.high))
            return (
                f'<rect class="z" x="{low}" y="{self.top}" width="{high - low}" '
                f'height="{self.bottom - self.top}"/>'
            )
        if isinstance(item, Tile):
            return self._tile(item)
        place = f'x="{_whole(self.x(item.x))}" y="{_whole(self.y(item.y))}"'
        return f'<text class="s m" {place}>{escape(item.text)}</text>'

    def _point(self, item: Point) -> str:
        x, y = _whole(self.x(item.x)), _whole(self.y(item.y))
        shape = item.shape or item.look.marker
        filled = shape not in ("cross", "plus", "star")
        more = " f" if filled and not item.look.hollow else " h" if filled else ""
        return f'<path class="{item.look.key} p{more}" d="{_marker(shape, x, y)}"/>'

    def _tile(self, item: Tile) -> str:
        x0, x1 = _whole(self.x(item.column - 0.5)), _whole(self.x(item.column + 0.5))
        y0 = _whole(self.y(item.row - 0.5, inside=False))
        y1 = _whole(self.y(item.row + 0.5, inside=False))
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


def _draw_legend(
    body: list[str],
    looks: dict[str, Look],
    keys: Sequence[Key],
    x: float,
    y: float,
    width: float,
    columns: int,
) -> None:
    place, line = x, y
    for index, key in enumerate(keys):
        looks.setdefault(key.look.key, key.look)
        if columns > 1:
            place = x + (index % columns) * width / columns
            line = y + (index // columns) * _LEGEND_LINE
        left, middle = round(_UNIT * place), round(_UNIT * (line + 8.0))
        if key.kind != "marker":
            body.append(f'<path class="{key.look.key}" d="M{left} {middle}h300"/>')
        if key.kind != "line":
            filled = key.look.marker not in ("cross", "plus", "star")
            more = " f" if filled and not key.look.hollow else " h" if filled else ""
            mark = _marker(key.look.marker, left + 150, middle)
            body.append(f'<path class="{key.look.key} p{more}" d="{mark}"/>')
        for number, words in enumerate(key.text.split("\n")):
            soft = ' class="s"' if number else ""
            body.append(
                f'<text{soft} x="{left + 390}" y="{middle + 42}">'
                f"{escape(_shortened(words, 34))}</text>"
            )
            line += _LEGEND_LINE
            middle += round(_UNIT * _LEGEND_LINE)


def _marker(shape: Marker, x: int, y: int) -> str:
    """A marker's path, about 9 px wide."""
    if shape == "circle":
        return f"M{x - 40} {y}a40 40 0 1 0 80 0a40 40 0 1 0-80 0"
    if shape == "square":
        return f"M{x - 36} {y - 36}h72v72h-72z"
    if shape == "triangle":
        return f"M{x} {y - 46}l44 78h-88z"
    if shape == "wedge":
        return f"M{x} {y + 46}l44-78h-88z"
    if shape == "diamond":
        return f"M{x} {y - 50}l46 50-46 50-46-50z"
    if shape == "plus":
        return f"M{x - 48} {y}h96M{x} {y - 48}v96"
    if shape == "star":
        return f"M{x - 48} {y}h96M{x - 26} {y - 42}l52 84M{x + 26} {y - 42}l-52 84"
    return f"M{x - 40} {y - 40}l80 80m0-80l-80 80"


def _sideways(x: float, y: float, text: str) -> str:
    place = f"{round(_UNIT * x)} {round(_UNIT * y)}"
    column, row = place.split()
    return (
        f'<text class="m" x="{column}" y="{row}" transform="rotate(-90 {place})">'
        f"{escape(text)}</text>"
    )


def _path(x: Array, y: Array) -> str:
    """A line in whole units, without the points that it does not need."""
    parts = []
    finite = np.isfinite(x) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], finite.view(np.int8), [0]])))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        points = np.rint(np.stack([x[start:end], y[start:end]], axis=1)).astype(np.int64)
        parts.append(_words(_simplified(points)))
    return "".join(parts)


def _simplified(points: np.ndarray) -> np.ndarray:
    """Fewer points: without those that lie near the line through their neighbours."""
    if len(points) < 3:
        return points
    same = np.concatenate([[False], np.all(points[1:] == points[:-1], axis=1)])
    points = points[~same]
    for _ in range(8):
        n = len(points)
        if n < 3:
            break
        before, here, after = points[:-2], points[1:-1], points[2:]
        chord, offset = after - before, here - before
        area = np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0])
        length = np.hypot(chord[:, 0], chord[:, 1])
        between = np.sum(offset * (after - here), axis=1) >= 0  # not where a line turns back
        near = (area <= _TOLERANCE * length) & between
        near[1::2] = False  # not two neighbours at once
        if not near.any():
            near = (area <= _TOLERANCE * length) & between
            near[::2] = False
            if not near.any():
                break
        points = points[np.concatenate([[True], ~near, [True]])]
    return points


def _words(points: np.ndarray) -> str:
    """A path's commands: relative, since small numbers are short."""
    first = f"M{points[0, 0]} {points[0, 1]}"
    if len(points) == 1:
        return f"{first}h1"
    steps = np.diff(points, axis=0).tolist()
    return f"{first}l" + " ".join(f"{dx}{dy}" if dy < 0 else f"{dx} {dy}" for dx, dy in steps)


def _whole(value: Array) -> int:
    found = float(value)
    return round(found) if math.isfinite(found) else 0


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
