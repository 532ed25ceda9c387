"""The legend, beside a chart or beneath it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import escape

from mobman.benchmark.report.chart import Key
from mobman.benchmark.report.svg.markers import marker
from mobman.benchmark.report.svg.units import units
from mobman.benchmark.report.svg.words import shortened, text_width

_LINE = 20.0  # px


def width_beside(keys: Sequence[Key]) -> float:
    """Room that a legend takes beside a chart (px)."""
    if not keys:
        return 0.0
    return min(260.0, 46.0 + text_width(line for key in keys for line in key.text.split("\n")))


def draw_beside(keys: Sequence[Key], x: float) -> tuple[list[str], float]:
    """The elements of a legend on the right of a chart, from x on; and where it ends (px)."""
    return _stacked(keys, x, 8.0), 14.0 + sum(map(_height, keys))


def draw_beneath(keys: Sequence[Key], y: float, width: float) -> tuple[list[str], float]:
    """The elements of a legend beneath a chart of a width, from y on; and where it ends (px)."""
    widest = text_width(key.text for key in keys) + 50.0
    columns = max(1, min(len(keys), int(width / widest)))
    bottom = y + (10.0 + _LINE * math.ceil(len(keys) / columns))
    x, y, width = 10.0, y + 4.0, width - 10.0
    if columns == 1:
        return _stacked(keys, x, y), bottom
    body = []
    for index, key in enumerate(keys):
        row, column = divmod(index, columns)
        body += _entry(key, x + column * width / columns, y + row * _LINE)
    return body, bottom


def _stacked(keys: Sequence[Key], x: float, y: float) -> list[str]:
    body = []
    for key in keys:
        body += _entry(key, x, y)
        y += _height(key)
    return body


def _height(key: Key) -> float:
    return _LINE * (1 + key.text.count("\n"))


def _entry(key: Key, x: float, y: float) -> list[str]:
    """A line of the legend; of a text of several lines, those after the first are fainter."""
    body = []
    left, middle = units(x), units(y + 8.0)
    if key.kind != "marker":
        body.append(f'<path class="{key.look.key}" d="M{left} {middle}h300"/>')
    if key.kind != "line":
        body.append(marker(key.look, left + 150, middle))
    for number, words in enumerate(key.text.split("\n")):
        soft = ' class="s"' if number else ""
        height = middle + number * units(_LINE) + 42
        body.append(
            f'<text{soft} x="{left + 390}" y="{height}">{escape(shortened(words, 34))}</text>'
        )
    return body
