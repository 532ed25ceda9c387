"""Shared by the sub-commands: JSON for scripts, lines and tables for people; progress of runs on stderr,
bars on a terminal, lines elsewhere, and Ctrl-C while they last."""

from __future__ import annotations

import json
import math
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

import click
from rich import progress as bars
from rich.console import Console
from rich.progress import TextColumn
from rich.table import Table
from rich.text import Text

from mobman.cli.options import level, wants_json
from mobman.display import printable

if TYPE_CHECKING:
    from mobman.benchmark.runner import Event
    from mobman.benchmark.tuning.search import Step
    from mobman.benchmark.tuning.tune import Plan

_NARROWEST = 16  # characters that are kept of a name


def echo(text: str = "", *, err: bool = False) -> None:
    """Print a printable line on stdout, unless there is -q or --json, or on stderr."""
    if err or (level() >= 0 and not wants_json()):
        click.echo(printable(text), err=err)


def note(message: object) -> None:
    """Print a message of mobman's on stderr, in one line."""
    echo(f"mobman: {' '.join(str(message).split())}", err=True)


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
    quiet = level() < 0 or (wants_json() and not stderr)
    return _Console(stderr=stderr, quiet=quiet, highlight=False, markup=False, emoji=False)


def table(
    *headings: str,
    rows: Iterable[Iterable[object]] = (),
    right: Collection[str] = (),
    no_wrap: bool = False,
    names: Collection[str] = (),
    share: int = 3,
) -> Table:
    """A table without lines; without headings, rows make the columns.

    Args:
        rows: What stands in the first rows.
        right: Headings of the columns that are aligned right.
        no_wrap: Whether the cells stay on one line.
        names: Headings of the columns of names: on one line, shortened in the middle if they would
            take more than the terminal's width over ``share``.
    """
    made = Table(box=None, pad_edge=False, show_header=bool(headings))
    for heading in headings:
        side: Any = "right" if heading in right else "left"
        made.add_column(heading, justify=side, no_wrap=no_wrap or heading in names)
    most = max(console().width // share, _NARROWEST)
    for row in rows:
        texts = [*map(str, row)]
        cells = zip(headings or ("",) * len(texts), texts, strict=True)
        made.add_row(*(shortened(text, most) if head in names else text for head, text in cells))
    return made


def shortened(text: str, most: int) -> str:
    """A text of so many characters at most: what is too long loses its middle."""
    if len(text) <= most:
        return text
    end = (most - 1) // 2
    return f"{text[: most - 1 - end]}…{text[-end:]}"


def in_lines(items: list[str], width: int) -> str:
    """The items in lines that break between them alone."""
    text, last = items[0], len(items[0])
    for item in items[1:]:
        fits = last + len(item) + 3 <= width  # with a semicolon behind it
        text, last = f"{text};{' ' if fits else chr(10)}{item}", fits * (last + 2) + len(item)
    return text


def report(value: Any) -> None:
    """Print JSON, with --json alone; numbers that JSON has no word for (inf, NaN) are null."""
    if not wants_json():
        return

    def finite(item: Any) -> Any:
        if isinstance(item, dict):
            return {key: finite(part) for key, part in item.items()}
        if isinstance(item, (list, tuple)):
            return [*map(finite, item)]
        return None if isinstance(item, float) and not math.isfinite(item) else item

    text = json.dumps(finite(value), indent=2)  # ASCII
    click.echo(text.replace("\x7f", "\\u007f"))


def number(value: float, unit: str = "") -> str:
    """A metric for people: three significant digits; ``never`` for a time that was not reached."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "never" if unit == "s" else "∞"
    return f"{value:.3g}"


# Progress ----------------------------------------------------------------------------------------------

_ELAPSED = (TextColumn("elapsed"), bars.TimeElapsedColumn())
_TIMES = (*_ELAPSED, TextColumn("left"), bars.TimeRemainingColumn())


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """A bar on stderr, where that is a terminal; gives what moves it, by the fraction done."""
    screen = console(stderr=True)
    what, off = TextColumn("{task.description}", markup=False), not screen.is_terminal
    columns = (what, bars.BarColumn(), bars.TaskProgressColumn(), *_TIMES)
    options: dict[str, Any] = {"transient": True, "disable": off or screen.quiet}
    with bars.Progress(*columns, console=screen, **options) as progress:
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


class Display(ExitStack):
    """Progress of several runs, interrupted once: a bar on a terminal, lines elsewhere."""

    def __init__(self, **options: Any) -> None:
        super().__init__()
        self._console = console(stderr=True)
        self.live = self._console.is_terminal
        counts, note = (
            TextColumn(f"{{task.fields[{name}]}}", markup=False) for name in ("counts", "note")
        )
        columns = (counts, bars.BarColumn(), *_TIMES, note)
        options |= {"console": self._console, "disable": not self.live}
        self._progress = bars.Progress(*columns, **options)
        self._bar = self._progress.add_task("runs", total=None, counts="", note="")

    def __enter__(self) -> Self:
        self.enter_context(interrupted_once())
        self.enter_context(self._progress)
        return self

    def say(self, text: str, *, of_many: bool = False) -> None:
        """Print a line, above the bar if there is one; one of many does not go with a bar, unless more
        is to be printed."""
        if self.live and (level() > 0 or not of_many):
            self._console.print(text)
        elif not self.live and level() >= 0:
            echo(text, err=True)

    def show(self, counts: str, note: str, **changes: Any) -> None:
        """Change what the bar shows."""
        self._progress.update(self._bar, counts=counts, note=printable(note), **changes)


class SuiteDisplay(Display):
    """Shows a suite's events; the bar and the time left go by ticks, since runs differ in length."""

    def __init__(self) -> None:
        super().__init__(speed_estimate_period=float("inf"))  # a run may be longer than any period
        self._ended = self._failed = self._running = 0
        self._note = ""
        self.asked = 0
        """Runs of the suite; 0 before it has started."""
        self.there = 0
        """Those of them that are there, or have failed."""

    def tell(self, event: Event) -> None:
        """Show an event."""
        from mobman.benchmark import runner

        change: dict[str, float] = {}
        match event:
            case runner.Started(asked, skipped, todo):
                self.asked, self.there = asked, skipped
                change = {"total": sum(run.duration / run.dt for run in todo)}
            case runner.Running(count):
                self._running = count
            case runner.Ended(outcome):
                self.there += 1
                self._failed += outcome.status == "failed"
                self._ended += outcome.status in ("diverged", "singular")
                change = {"advance": outcome.run.duration / outcome.run.dt}
                result = f"{outcome.status}, |e_e| {number(outcome.task_error)} m"
                self.say(f"[{self.there}/{self.asked}] {outcome.run}: {result}", of_many=True)
            case runner.Again(run, reason):
                self.say(f"once more: {run}: {reason}")
            case runner.Waiting(reason):
                self._note = f"waiting: {reason}" if reason else ""
                if reason:
                    self.say(self._note)
        counts = (
            f"{self.there}/{self.asked} runs, {self._running} running, {self._ended} diverged, "
            f"{self._failed} failed"
        )
        self.show(counts, self._note, **change)


class TuningDisplay(Display):
    """Shows the trials of a tuning."""

    def __init__(self, workers: int) -> None:
        super().__init__()
        self._workers = workers
        self._scores: dict[str, float] = {}
        self._tried: set[str] = set()
        self._seconds: list[float] = []

    def start(self, plan: Plan) -> None:
        """Show what will be done."""
        self._plan, self._trials, self._runs = plan, plan.done, plan.done * plan.runs
        self._scores = dict(plan.scores)
        gains = ", ".join(f"{label} ({count})" for label, count in plan.gains.items())
        simulated = len(plan.gains) * plan.trials * plan.seconds
        self._show(total=plan.total)
        self.say(
            f"{len(plan.gains)} controllers (gains to tune): {gains}; {plan.trials} trials each, "
            f"{plan.runs} runs a trial: {plan.total} runs, {simulated:.0f} s of simulated time"
            + (f"; {plan.done} trials were there" if plan.done else "")
        )

    def step(self, step: Step) -> None:
        """Show that a run is done."""
        self._runs += 1
        self._seconds.append(step.run.seconds)
        if step.trial is None:
            self._show()
            return
        label, score, controllers = step.label, step.trial.score, len(self._plan.gains)
        self._trials += 1
        new = label not in self._tried
        self._tried.add(label)
        best = self._scores[label] = min(self._scores.get(label, score), score)
        self._show()
        done = f"[{self._trials}/{controllers * self._plan.trials}] {label} · trial {step.number}"
        self.say(f"{done}: {score:.3f}, best {best:.3f}", of_many=True)
        # how long the rest takes, once there is a trial of each controller
        if new and len(self._tried) == controllers:
            each = sum(self._seconds) / len(self._seconds)
            left = (self._plan.total - self._runs) * each / self._workers
            self.say(f"about {left / 60:.1f} min to go with {self._workers} workers")

    def _show(self, **changes: Any) -> None:
        note = ", ".join(f"{label} {lowest:.2f}" for label, lowest in self._scores.items())
        self.show(f"{self._runs}/{self._plan.total} runs", note, completed=self._runs, **changes)
