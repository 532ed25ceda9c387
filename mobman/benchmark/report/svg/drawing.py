"""A figure as SVG, for a page or as a file of its own."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup, escape

from mobman.benchmark.report.chart import Look
from mobman.benchmark.report.svg.style_sheet import LIGHT, STYLE, look_style
from mobman.benchmark.report.svg.units import UNIT, units
from mobman.printable import printable


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
        width, height = map(units, self.size)
        return Markup(
            f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" '
            f'aria-label="{escape(self.title)}">{self.body}</svg>'
        )

    @property
    def file(self) -> str:
        """Content of a file of its own."""
        width, height = map(units, self.size)
        variables = ";".join(f"--{name}:{value}" for name, value in LIGHT.items())
        # XML has no control characters, not even escaped ones
        return printable(
            '<?xml version="1.0" encoding="utf-8"?>\n'
            f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" role="img" '
            f'width="{width / UNIT:g}" height="{height / UNIT:g}" '
            f'viewBox="0 0 {width} {height}">'
            f"<title>{escape(self.title)}</title>"
            f"<style>.chart{{{variables}}}{look_style(self.looks)}{STYLE}</style>"
            f'<rect width="{width}" height="{height}" fill="#fff"/>{self.body}</svg>\n'
        )
