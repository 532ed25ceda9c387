"""Progress of runs on stderr: bars on a terminal, lines elsewhere; and Ctrl-C while they last."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from mobman.cli.output import console, echo, level, number
from mobman.printable import printable

if TYPE_CHECKING:
    from mobman.benchmark.runner import Event
    from mobman.benchmark.tuning.search import Step
    from mobman.benchmark.tuning.tune import Plan


_TIMES = (
    TextColumn("elapsed"),
    TimeElapsedColumn(),
    TextColumn("left"),
    TimeRemainingColumn(),
)


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """A bar on stderr, where that is a terminal; gives what moves it, by the fraction done."""
    screen = console(stderr=True)
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        *_TIMES,
        console=screen,
        transient=True,
        disable=not screen.is_terminal or screen.quiet,
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


class Display:
    """Progress of several runs, as a context: a bar on a terminal, lines elsewhere."""

    def __init__(self, **options: Any) -> None:
        self._console = console(stderr=True)
        self.live = self._console.is_terminal
        counts, note = (
            TextColumn(f"{{task.fields[{name}]}}", markup=False) for name in ("counts", "note")
        )
        columns = (counts, BarColumn(), *_TIMES, note)
        self._progress = Progress(*columns, console=self._console, disable=not self.live, **options)
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
        elif level() >= 0:
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
                if not self.live or level() > 0:
                    self.say(
                        f"[{self.there}/{self.asked}] {outcome.run}: {outcome.status}, "
                        f"|e_e| {number(outcome.task_error)} m"
                    )
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
        score, controllers = step.trial.score, len(self._plan.gains)
        self._trials += 1
        new = step.label not in self._tried
        self._tried.add(step.label)
        best = self._scores[step.label] = min(self._scores.get(step.label, score), score)
        self._show()
        if not self.live or level() > 0:
            self.say(
                f"[{self._trials}/{controllers * self._plan.trials}] {step.label} · trial "
                f"{step.number}: {score:.3f}, best {best:.3f}"
            )
        # how long the rest takes, once there is a trial of each controller
        if new and len(self._tried) == controllers:
            each = sum(self._seconds) / len(self._seconds)
            left = (self._plan.total - self._runs) * each / self._workers
            self.say(f"about {left / 60:.1f} min to go with {self._workers} workers")

    def _show(self, **changes: Any) -> None:
        note = ", ".join(f"{label} {lowest:.2f}" for label, lowest in self._scores.items())
        self.show(f"{self._runs}/{self._plan.total} runs", note, completed=self._runs, **changes)
