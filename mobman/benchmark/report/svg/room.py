"""Room that a panel takes for what is written around it."""

from __future__ import annotations

from collections.abc import Sequence

from mobman.benchmark.report.chart import Axis, Panel
from mobman.benchmark.report.svg.words import text_width


def margin(axis: Axis) -> float:
    """Room for an axis' numbers and name on its left (px)."""
    texts = (text for _, text in axis.ticks(8))
    return min(260.0, 16.0 + text_width(texts)) + (24.0 if axis.label else 0.0)


def head(panel: Panel, wide: float) -> float:
    """Room above a panel of so many px across for the names on its x axis (px)."""
    longest = text_width(panel.x.names)
    if not longest:
        return 0.0
    return 12.0 if names_are_level(panel, wide - margin(panel.y)) else 12.0 + 0.55 * longest


def foot(panels: Sequence[Panel]) -> float:
    """Room beneath a row (px)."""
    return 10.0 if all(panel.x.names for panel in panels) else 42.0


def names_are_level(panel: Panel, wide: float) -> bool:
    """Whether the names on an x axis of so many px stand side by side without being slanted."""
    return text_width(panel.x.names) + 8.0 <= wide / len(panel.x.names)
