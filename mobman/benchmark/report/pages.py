"""The report as HTML and as Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jinja2

from mobman.benchmark.report.format import html_text, markdown_text, one_line, slug
from mobman.benchmark.report.html_table import html_table, swatch
from mobman.benchmark.report.table import first_rows


def render(content: Mapping[str, Any], figures: str) -> tuple[str, str]:
    """The report as HTML and as Markdown.

    Args:
        content: What the templates show, by name.
        figures: The folder of the figures that the Markdown links, relative to it.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mobman.benchmark.report", "templates"),
        autoescape=jinja2.select_autoescape(enabled_extensions=("html.j2",)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(symbols=html_text, md=markdown_text, slug=slug, head=first_rows)
    environment.filters.update(table=html_table, swatch=swatch, line=one_line)
    return (
        environment.get_template("report.html.j2").render(content),
        environment.get_template("report.md.j2").render(content, figures=figures),
    )
