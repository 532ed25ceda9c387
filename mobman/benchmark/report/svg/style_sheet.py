"""Colours and style sheets of charts."""

from __future__ import annotations

from collections.abc import Sequence

from mobman.benchmark.report.chart import Look
from mobman.benchmark.report.svg.units import UNIT

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
"""The variables of a light page."""
DARK = {
    "page": "#16181b",
    "ink": "#dfe2e6",
    "soft": "#9aa1aa",
    "grid": "#2e3237",
    "axis": "#777d85",
    "shade": "#1f2226",
}
"""The variables of a dark page."""


def look_style(looks: Sequence[Look], *, dark: bool = False) -> str:
    """The style sheet of some looks."""
    rules = []
    for look in sorted(looks, key=lambda look: look.key):
        colour = look.dark if dark else look.colour
        dashes = ""
        if look.dashes:
            lengths = " ".join(f"{UNIT * length:g}" for length in look.dashes)
            dashes = f";stroke-dasharray:{lengths}"
        rules.append(
            f".chart .{look.key}{{stroke:{colour};stroke-width:{UNIT * look.width:g}{dashes}}}"
            f".chart .{look.key}.f{{fill:{colour}}}"
        )
    return "".join(rules)
