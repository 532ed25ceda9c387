"""A panel's grid, axes, ticks and their names."""

from __future__ import annotations

from markupsafe import escape

from mobman.benchmark.report.chart import Tile
from mobman.benchmark.report.svg.frame import Frame
from mobman.benchmark.report.svg.room import margin, names_are_level
from mobman.benchmark.report.svg.units import UNIT, whole
from mobman.benchmark.report.svg.words import shortened, sideways


def draw_axes(frame: Frame, *, named: bool) -> list[str]:
    """The elements of a panel's axes.

    Args:
        frame: The panel's.
        named: Whether the x axis has its numbers and name beneath it.
    """
    panel = frame.panel
    grid, texts = _x_ticks(frame, named=named)
    more_grid, more_texts = _y_ticks(frame)
    grid += more_grid
    body = []
    if grid:
        body.append(f'<path class="g" d="{"".join(grid)}"/>')
    if not any(isinstance(item, Tile) for item in panel.items):
        body.append(f'<path class="a" d="M{frame.left} {frame.top}v{frame.height}h{frame.width}"/>')
    body += texts + more_texts
    if panel.x.label and named:
        centre = (frame.left + frame.right) // 2
        body.append(
            f'<text class="m" x="{centre}" y="{frame.bottom + 350}">{escape(panel.x.label)}</text>'
        )
    if panel.y.label:
        x = frame.left / UNIT - (margin(panel.y) - 14.0)
        body.append(sideways(x, (frame.top + frame.bottom) / 2.0 / UNIT, panel.y.label))
    return body


def _x_ticks(frame: Frame, *, named: bool) -> tuple[list[str], list[str]]:
    """Parts of the grid's path, and texts."""
    axis = frame.panel.x
    level = bool(axis.names) and names_are_level(frame.panel, frame.width / UNIT)
    grid, texts = [], []
    for value, text in axis.ticks(max(2, frame.width // 900)):
        x, y = whole(frame.x(value)), frame.top - 60
        if not axis.names:
            grid.append(f"M{x} {frame.top}v{frame.height}")
            if named:
                texts.append(
                    f'<text class="m" x="{x}" y="{frame.bottom + 170}">{escape(text)}</text>'
                )
        elif level:
            texts.append(f'<text class="m" x="{x}" y="{y}">{escape(text)}</text>')
        else:  # above, where they are seen first: there may be many rows
            texts.append(
                f'<text class="e" x="{x}" y="{y}" transform="rotate(32 {x} {y})">'
                f"{escape(text)}</text>"
            )
    return grid, texts


def _y_ticks(frame: Frame) -> tuple[list[str], list[str]]:
    """Parts of the grid's path, and texts."""
    axis = frame.panel.y
    grid, texts = [], []
    for value, text in axis.ticks(max(2, frame.height // 280)):
        y = whole(frame.y(value))
        if not axis.names:
            grid.append(f"M{frame.left} {y}h{frame.width}")
        shown = escape(shortened(text, 36))
        texts.append(f'<text class="e" x="{frame.left - 60}" y="{y + 40}">{shown}</text>')
    return grid, texts
