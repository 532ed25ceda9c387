"""Tables as HTML; not by a template, since a report of a large suite has a hundred thousand entries."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from markupsafe import Markup, escape

from mobman.benchmark.report.chart import Look
from mobman.benchmark.report.format import html_text
from mobman.benchmark.report.table import Entry, Row, Table


def html_table(table: Table, styles: Mapping[str, Look], *, swatches: bool = True) -> Markup:
    """A table that scrolls by itself.

    Args:
        table: The table.
        styles: The looks of controllers.
        swatches: Whether entries that name a controller show its look.
    """
    shown = styles if swatches else {}
    caption = html_text(table.caption)
    heads = "".join(_place("th", item, shown, ' scope="col"') for item in table.columns)
    rows = "\n".join(_row(row, len(table.columns), shown) for row in table.rows)
    return Markup(
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(table.caption)}">\n'
        f"<table>\n<caption>{caption}</caption>\n<thead><tr>{heads}</tr></thead>\n"
        f"<tbody>\n{rows}\n</tbody>\n</table>\n</div>\n"
    )


def swatch(look: Look) -> Markup:
    """A controller's line, in small."""
    return Markup(
        '<svg class="swatch chart" viewBox="0 0 220 80" aria-hidden="true">'
        f'<path class="{look.key}" d="M10 40H210"/></svg>'
    )


def _row(row: Row, columns: int, styles: Mapping[str, Look]) -> str:
    if row.title:
        return (
            f'<tr class="title"><th scope="rowgroup" colspan="{columns}">'
            f"<span>{escape(row.head.text)}</span></th></tr>"
        )
    entries = "".join(_place("td", item, styles) for item in row.entries)
    head = _place("th", row.head, styles, ' scope="row"')
    return f"<tr>{head}{entries}</tr>"


def _place(tag: str, item: Entry, styles: Mapping[str, Look], more: str = "") -> str:
    names = " ".join(name for name in ("number" if item.number else "", item.mark) if name)
    classes = f' class="{names}"' if names else ""
    detail = f' title="{escape(item.detail)}"' if item.detail else ""
    content = str(html_text(item.text))
    if item.link:
        content = f'<a href="{quote(item.link)}">{content}</a>'
    if item.label and item.label in styles:
        content = swatch(styles[item.label]) + Markup(content)
    if item.unit:
        content += f" <small>{escape(item.unit)}</small>"
    return f"<{tag}{more}{classes}{detail}>{content}</{tag}>"
