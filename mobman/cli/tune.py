"""``mobman bench tune``: the same budget of tuning for every controller of a suite."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from mobman.cli.output import (
    FOLDER,
    JSON,
    Display,
    console,
    echo,
    interrupted_once,
    print_json,
    table,
)
from mobman.printable import printable

if TYPE_CHECKING:
    from mobman.benchmark.tuning.search import Step
    from mobman.benchmark.tuning.tune import Plan, TuningResult


@click.command("tune")
@click.argument("suite")
@click.option(
    "-o", "--output", type=FOLDER, help="Folder of the results; results/SUITE-tuning by default."
)
@click.option(
    "--trials", type=click.IntRange(min=1), help="Of each controller; the suite's by default."
)
@click.option("--workers", type=click.IntRange(min=1), help="Processes; one a core by default.")
@click.option(
    "--controllers",
    multiple=True,
    metavar="LABEL",
    help="Tune these alone; repeatable.  [default: all that have a search space]",
)
@click.option("--fresh", is_flag=True, help="Begin again, also where trials are there already.")
@JSON
def tune(
    suite: str,
    output: Path | None,
    workers: int | None,
    controllers: tuple[str, ...],
    as_json: bool,
    **options: Any,
) -> None:
    """Tune the controllers of SUITE (a name or a TOML file), and write it with the tuned gains.

    Every controller has the same number of trials on the same runs, none of which the suite reports.
    FOLDER/SUITE-tuned.toml compares its own gains with the tuned ones. Trials that are in the folder
    are not done again: after Ctrl-C the same command goes on.
    """
    from mobman.benchmark.runner import default_workers
    from mobman.benchmark.suite import load_suite
    from mobman.benchmark.tuning.tune import tune_suite

    chosen = load_suite(suite)
    folder = output or Path("results") / f"{chosen.name}-tuning"
    count = default_workers() if workers is None else workers
    display = _TuningDisplay(count)
    try:
        with interrupted_once(), display:
            result = tune_suite(
                chosen,
                folder,
                controllers=controllers or None,
                workers=count,
                on_start=display.start,
                on_step=display.step,
                **options,
            )
    except KeyboardInterrupt:
        echo(
            f"mobman: interrupted; the trials that were done are kept in {folder}, the same command "
            "goes on from there",
            err=True,
        )
        raise click.exceptions.Exit(130) from None
    for label, why in result.left_out.items():
        echo(f"mobman: not tuned: {label!r} {why}", err=True)
    if as_json:
        print_json(_as_json(result))
    else:
        _print(result)


def _as_json(result: TuningResult) -> dict[str, object]:
    return {
        "suite": str(result.suite_file),
        "tuning": str(result.json_file),
        "seconds": result.seconds,
        "controllers": {
            label: {
                "trials": len(trials),
                "score_default": trials[0].score,
                "score": result.best(label).score,
                "trial": result.best(label).number,
                "gains": result.best(label).gains,
            }
            for label, trials in result.trials.items()
        },
        "not_tuned": dict(result.left_out),
    }


def _print(result: TuningResult) -> None:
    numbers = ("trials", "score", "tuned", "trial")
    listing = table("controller", *numbers, "gains", right=numbers)
    for label, trials in result.trials.items():
        best = result.best(label)
        gains = ", ".join(f"{name} = {value:g}" for name, value in best.gains.items())
        listing.add_row(
            label,
            str(len(trials)),
            f"{trials[0].score:.3f}",
            f"{best.score:.3f}",
            str(best.number),
            gains or "the suite's own: no trial was better",
        )
    out = console()
    out.print(listing)
    out.print(f"suite:  {result.suite_file}", soft_wrap=True)
    out.print(f"trials: {result.json_file}", soft_wrap=True)


class _TuningDisplay(Display):
    """Shows the trials of a tuning."""

    def __init__(self, workers: int) -> None:
        super().__init__(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        self._workers = workers
        self._scores: dict[str, float] = {}
        self._first: set[str] = set()
        self._seconds: list[float] = []

    def start(self, plan: Plan) -> None:
        """Show what will be done."""
        self._plan, self._trials, self._runs = plan, plan.done, plan.done * plan.runs
        self._progress.update(self._bar, total=plan.total, completed=self._runs)
        gains = ", ".join(f"{label} ({count})" for label, count in plan.gains.items())
        simulated = len(plan.gains) * plan.trials * plan.seconds
        self.say(
            f"{len(plan.gains)} controllers (gains to tune): {gains}; {plan.trials} trials each, "
            f"{plan.runs} runs a trial: {plan.total} runs, {simulated:.0f} s of simulated time"
            + (f"; {plan.done} trials were there" if plan.done else "")
        )

    def step(self, step: Step) -> None:
        """Show that a run is done."""
        self._runs += 1
        self._seconds.append(step.run.seconds)
        self._progress.update(self._bar, advance=1)
        if step.trial is None:
            return
        score, controllers = step.trial.score, len(self._plan.gains)
        self._trials += 1
        best = self._scores[step.label] = min(self._scores.get(step.label, score), score)
        note = ", ".join(f"{label} {lowest:.2f}" for label, lowest in self._scores.items())
        self._progress.update(self._bar, note=printable(note))
        if not self.live:
            self.say(
                f"[{self._trials}/{controllers * self._plan.trials}] {step.label} · trial "
                f"{step.number}: {score:.3f}, best {best:.3f}"
            )
        # how long the rest takes, once there is a trial of each controller
        new = step.label not in self._first
        self._first.add(step.label)
        if new and len(self._first) == controllers:
            each = sum(self._seconds) / len(self._seconds)
            left = (self._plan.total - self._runs) * each / self._workers
            self.say(f"about {left / 60:.1f} min to go with {self._workers} workers")
