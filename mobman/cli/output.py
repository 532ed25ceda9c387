"""Shared by the sub-commands: types of options, JSON for scripts, tables for people."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mobman.printable import printable

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)
PORT = click.IntRange(0, 65535)
POSITIVE = click.FloatRange(min=0, min_open=True)
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


def echo(text: str = "", *, err: bool = False) -> None:
    """Print a printable line on stdout, or on stderr."""
    click.echo(printable(text), err=err)


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to the entry point, which knows what a reader that has enough means."""
        raise BrokenPipeError

    def render_str(self, text: str, **options: Any) -> Text:
        """Make a printable text of a string, also of a table's cell."""
        return super().render_str(printable(text), **options)


def console(*, stderr: bool = False) -> Console:
    """A terminal for tables and progress bars; plain text where there is no terminal.

    What is printed is taken as it is: names and files may have brackets or colons.
    """
    return _Console(stderr=stderr, highlight=False, markup=False, emoji=False)


def table(
    *headings: str,
    rows: Iterable[Iterable[object]] = (),
    right: Collection[str] = (),
    no_wrap: bool = False,
) -> Table:
    """A table without lines.

    Args:
        headings: Headings of the columns; without any, rows make the columns.
        rows: What stands in the first rows.
        right: Headings of the columns that are aligned right.
        no_wrap: Whether the cells stay on one line.
    """
    made = Table(box=None, pad_edge=False, show_header=bool(headings))
    for heading in headings:
        made.add_column(heading, justify="right" if heading in right else "left", no_wrap=no_wrap)
    for row in rows:
        made.add_row(*map(str, row))
    return made


def print_json(value: Any) -> None:
    """Print JSON; numbers that JSON has no word for (inf, NaN) are null."""
    text = json.dumps(_finite(value), indent=2)  # ASCII
    click.echo(text.replace("\x7f", "\\u007f"))


def number(value: float, unit: str = "") -> str:
    """A metric for people: three significant digits; ``never`` for a time that was not reached."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "never" if unit == "s" else "∞"
    return f"{value:.3g}"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value
