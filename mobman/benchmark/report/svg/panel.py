"""A panel: its title, its axes, and its items one above the other."""

from __future__ import annotations

from markupsafe import escape

from mobman.benchmark.report.chart import Band, Curve, Item, Rule, Span, Tile
from mobman.benchmark.report.svg.axes import draw_axes
from mobman.benchmark.report.svg.frame import Frame
from mobman.benchmark.report.svg.items import draw_item


def draw_panel(frame: Frame, *, named: bool) -> list[str]:
    """The elements of a panel, the lowest first.

    Args:
        frame: The panel's.
        named: Whether the x axis has its numbers and name beneath it.
    """
    panel = frame.panel
    body = []
    if panel.title:
        body.append(
            f'<text class="t" x="{frame.left}" y="{frame.top - 80}">{escape(panel.title)}</text>'
        )
    behind = [item for item in panel.items if isinstance(item, (Span, Tile))]
    front = [item for item in panel.items if not isinstance(item, (Span, Tile))]
    body += [draw_item(frame, item) for item in behind]
    body += draw_axes(frame, named=named)
    body += [draw_item(frame, item) for item in sorted(front, key=_order)]
    return body


def _order(item: Item) -> float:
    if isinstance(item, Band):
        return 0.0
    if isinstance(item, Curve):
        return item.look.order
    return 1.0 if isinstance(item, Rule) else 9.0
