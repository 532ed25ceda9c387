"""Shared by the sub-commands: types of options, JSON for scripts, tables for people."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mobman.errors import UsageError
from mobman.printable import printable

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)
PORT = click.IntRange(0, 65535)
POSITIVE = click.FloatRange(min=0, min_open=True)
FORCE = click.option("--force", is_flag=True, help="Replace a file that is there.")
_LEVEL = "mobman.cli.level"
_NARROWEST = 16  # characters that are kept of a name


def _set_level(context: click.Context, parameter: click.Parameter, given: bool) -> None:
    if given:
        context.meta[_LEVEL] = -1 if parameter.name == "quiet" else 1


_FLAG: dict[str, Any] = {"is_flag": True, "expose_value": False, "callback": _set_level}
_OPTIONS = (
    click.option("--json", "as_json", is_flag=True, help="Print JSON."),
    click.option("-q", "--quiet", **_FLAG, help="Print errors alone, and what --json asks for."),
    click.option(
        "-v", "--verbose", **_FLAG, help="Print more, and the traceback of an internal error."
    ),
)


def reports(command: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: the options --json, -q and -v, see :func:`level`."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def level(context: click.Context | None = None) -> int:
    """Amount that a command, by default the running one, is to print: -1 errors alone, 0 as usual, 1
    more."""
    context = context or click.get_current_context(silent=True)
    found: int = 0 if context is None else context.meta.get(_LEVEL, 0)
    return found


def check_new(path: Path, *, suffixes: Collection[str], force: bool) -> None:
    """Refuse a file to write before anything is computed.

    Args:
        path: The file.
        suffixes: Those that it may have, in small letters.
        force: True if a file that is there may be replaced.

    Raises:
        UsageError: If its suffix is another, or it is there already.
    """
    if path.suffix.lower() not in suffixes:
        raise UsageError(f"-o {str(path)!r} does not end in {' or '.join(sorted(suffixes))}")
    if path.exists() and not force:
        raise UsageError(f"{path} is there already; choose another -o, or add --force")


def echo(text: str = "", *, err: bool = False) -> None:
    """Print a printable line on stdout, unless there is -q, or on stderr."""
    if err or level() >= 0:
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
    quiet = level() < 0
    return _Console(stderr=stderr, quiet=quiet, highlight=False, markup=False, emoji=False)


def table(
    *headings: str,
    rows: Iterable[Iterable[object]] = (),
    right: Collection[str] = (),
    no_wrap: bool = False,
    names: Collection[str] = (),
    share: int = 3,
) -> Table:
    """A table without lines.

    Args:
        headings: Headings of the columns; without any, rows make the columns.
        rows: What stands in the first rows.
        right: Headings of the columns that are aligned right.
        no_wrap: Whether the cells stay on one line.
        names: Headings of the columns of names: on one line, shortened in the middle if they would
            take more than a share of the terminal.
        share: A name has this part of the terminal's width: a third, or a half for 2.
    """
    made = Table(box=None, pad_edge=False, show_header=bool(headings))
    for heading in headings:
        one_line = no_wrap or heading in names
        side: Any = "right" if heading in right else "left"
        made.add_column(heading, justify=side, no_wrap=one_line)
    most = max(console().width // share, _NARROWEST)
    for row in rows:
        texts = [*map(str, row)]
        heads = headings or ("",) * len(texts)
        cells = zip(heads, texts, strict=True)
        made.add_row(*(shortened(text, most) if head in names else text for head, text in cells))
    return made


def shortened(text: str, most: int) -> str:
    """A text of so many characters at most: what is too long loses its middle."""
    if len(text) <= most:
        return text
    end = (most - 1) // 2
    return f"{text[: most - 1 - end]}…{text[-end:]}"


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
