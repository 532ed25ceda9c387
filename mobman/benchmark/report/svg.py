"""Figures as SVG: small, the same on every machine, and fit to stand in a page with others."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import matplotlib
import matplotlib.style
from markupsafe import Markup, escape
from matplotlib.figure import Figure

_SETTINGS: dict[str, Any] = {
    "svg.fonttype": "none",  # text stays text: small, sharp, found by a search
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "path.simplify_threshold": 0.2,
    "axes.unicode_minus": True,
}
# The layout is made for DejaVu Sans, which is wide: any of these fits.
_FONTS = "system-ui,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"


@dataclass(frozen=True)
class Drawing:
    """A figure as SVG."""

    key: str
    """Unique in a report; the file's name without its ending."""
    title: str
    """What it shows, for those who cannot see it."""
    svg: str
    """The root element."""

    @property
    def file(self) -> str:
        """Content of a file of its own."""
        return f'<?xml version="1.0" encoding="utf-8"?>\n{self.svg}\n'

    @property
    def inline(self) -> Markup:
        """For HTML: as wide as the place that it has."""
        return Markup(
            re.sub(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"', r"\1", self.svg, count=1)
        )


def draw(key: str, title: str, make: Callable[[], Figure]) -> Drawing:
    """Make a figure, and turn it into SVG."""
    buffer = io.StringIO()
    # whatever the user's matplotlibrc says, and without changing what he has set
    with matplotlib.style.context(["default", {**_SETTINGS, "svg.hashsalt": key}]):
        figure = make()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return Drawing(key, title, _tidy(buffer.getvalue(), key, title))


def _tidy(svg: str, key: str, title: str) -> str:
    svg = svg[svg.index("<svg") :].strip()
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    # several figures stand in one page: their names must differ
    svg = re.sub(r'\bid="', f'id="{key}-', svg)
    svg = re.sub(r"url\(#", f"url(#{key}-", svg)
    svg = re.sub(r'href="#', f'href="#{key}-', svg)
    svg = re.sub(r' d="([^"]*)"', lambda found: f' d="{_shorter(found[1])}"', svg)
    svg = re.sub(r"'DejaVu Sans'(?:, [^;\"]*)?", _FONTS, svg)
    head = f'<svg role="img" aria-labelledby="{key}-title"'
    svg = svg.replace("<svg", head, 1)
    return svg.replace(">", f'><title id="{key}-title">{escape(title)}</title>', 1)


def _shorter(path: str) -> str:
    """A path with a hundredth of a point's precision, and no more white space than it needs."""
    path = re.sub(
        r"-?\d+\.\d+", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), path
    )
    return re.sub(r"\s+", " ", path).strip()
