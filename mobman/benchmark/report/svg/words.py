"""Text in a chart, and the room that it takes."""

from __future__ import annotations

from collections.abc import Iterable

from markupsafe import escape

from mobman.benchmark.report.svg.units import units

_LETTER = 6.6  # px, of an average letter at 12 px; generous, fonts differ


def text_width(texts: Iterable[str]) -> float:
    """Of the longest of some lines (px), about; 0 if there are none."""
    return _LETTER * max(map(len, texts), default=0)


def shortened(text: str, most: int) -> str:
    """A text of so many letters at the most."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def sideways(x: float, y: float, text: str) -> str:
    """A text that is read from below, with its middle at a place (px)."""
    column, row = units(x), units(y)
    return (
        f'<text class="m" x="{column}" y="{row}" transform="rotate(-90 {column} {row})">'
        f"{escape(text)}</text>"
    )
