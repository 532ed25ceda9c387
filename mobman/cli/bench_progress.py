"""How a suite goes: live on a terminal, elsewhere one plain line a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from mobman.cli.output import console, echo, number
from mobman.printable import printable

if TYPE_CHECKING:
    from mobman.benchmark.run_spec import RunSpec
    from mobman.benchmark.runner import Event, Outcome, Started


class SuiteProgress:
    """A display of a suite's events, as a context.

    The bar and the time left go by ticks: runs may differ in length.
    """

    def __init__(self) -> None:
        self._console = console(stderr=True)
        self._ended = self._failed = self._running = 0
        self._progress = Progress(
            TextColumn("{task.fields[counts]}", markup=False),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}", markup=False),
            console=self._console,
            disable=not self._console.is_terminal,
            speed_estimate_period=float("inf"),  # a run may be longer than any period
        )
        self._bar = self._progress.add_task("runs", total=None, counts="", note="")
        self._note = ""
        self.asked = 0
        """Runs of the suite; 0 before it has started."""
        self.there = 0
        """Those of them that are there, or have failed."""

    def __enter__(self) -> SuiteProgress:
        self._progress.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.__exit__(None, None, None)

    def tell(self, event: Event) -> None:
        """Show an event."""
        from mobman.benchmark import runner

        match event:
            case runner.Started():
                self._start(event)
            case runner.Running(count):
                self._running = count
            case runner.Ended(outcome):
                self._end(outcome)
            case runner.Again(run, reason):
                self._line(f"once more: {run}: {reason}")
            case runner.Waiting(reason):
                self._note = f"waiting: {reason}" if reason else ""
                if reason:
                    self._line(self._note)
        self._show()

    def _start(self, event: Started) -> None:
        self.asked, self.there = event.asked, event.skipped
        self._progress.update(self._bar, total=sum(_ticks(run) for run in event.todo))

    def _end(self, outcome: Outcome) -> None:
        self.there += 1
        self._failed += outcome.status == "failed"
        self._ended += outcome.status in ("diverged", "singular")
        self._progress.update(self._bar, advance=_ticks(outcome.run))
        if not self._console.is_terminal:
            self._line(
                f"[{self.there}/{self.asked}] {outcome.run}: {outcome.status}, "
                f"|e_e| {number(outcome.task_error)} m"
            )

    def _line(self, text: str) -> None:
        if self._console.is_terminal:
            self._console.print(text)
        else:
            echo(text, err=True)

    def _show(self) -> None:
        counts = (
            f"{self.there}/{self.asked} runs, {self._running} running, {self._ended} diverged, "
            f"{self._failed} failed"
        )
        self._progress.update(self._bar, counts=counts, note=printable(self._note))


def _ticks(run: RunSpec) -> float:
    return run.duration / run.dt
