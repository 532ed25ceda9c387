"""Shared by the sub-commands: types of options, JSON for scripts, tables and progress for people."""

from __future__ import annotations

import json
import math
import signal
import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, Self

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
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


def table(*headings: str, right: Collection[str] = (), no_wrap: bool = False) -> Table:
    """A table without lines.

    Args:
        headings: Headings of the columns; without any, rows make the columns.
        right: Headings of the columns that are aligned right.
        no_wrap: Whether the cells stay on one line.
    """
    made = Table(box=None, pad_edge=False, show_header=bool(headings))
    for heading in headings:
        made.add_column(heading, justify="right" if heading in right else "left", no_wrap=no_wrap)
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


class Display:
    """Progress of several runs, as a context: a bar on a terminal, lines elsewhere.

    Args:
        columns: Columns of the bar, beside its note.
        options: Those of rich's ``Progress``.
    """

    def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
        self._console = console(stderr=True)
        self.live = self._console.is_terminal
        """True if there is a bar."""
        note = TextColumn("{task.fields[note]}", markup=False)
        self._progress = Progress(
            *columns, note, console=self._console, disable=not self.live, **options
        )
        self._bar = self._progress.add_task("runs", total=None, counts="", note="")

    def __enter__(self) -> Self:
        self._progress.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.__exit__(None, None, None)

    def say(self, text: str) -> None:
        """Print a line, above the bar if there is one."""
        if self.live:
            self._console.print(text)
        else:
            echo(text, err=True)


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """A bar on stderr, where that is a terminal; gives what moves it, by the fraction done."""
    screen = console(stderr=True)
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        console=screen,
        transient=True,
        disable=not screen.is_terminal,
    ) as progress:
        bar = progress.add_task(printable(text), total=1.0)
        yield lambda fraction: progress.update(bar, completed=fraction)


@contextmanager
def interrupted_once() -> Iterator[None]:
    """The first SIGINT or SIGTERM in the block interrupts it; later ones are ignored, while the block
    clears up and while the process then ends."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    interrupted = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        for other in signals:
            signal.signal(other, signal.SIG_IGN)
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in signals}
    try:
        yield
    finally:
        if not interrupted:
            for number, handler in before.items():
                signal.signal(number, handler)
