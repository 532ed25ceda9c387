"""``mobman bench``: suites of runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from mobman.cli.bench_merge import merge_command
from mobman.cli.bench_suites import list_command, show_command
from mobman.cli.bench_tune import tune
from mobman.cli.output import console, number

if TYPE_CHECKING:
    from mobman.benchmark.runner import Outcome


@click.group()
def bench() -> None:
    """Suites of the comparative benchmark: list, show, tune, run, report, merge."""


bench.add_command(list_command)
bench.add_command(show_command)
bench.add_command(merge_command)
bench.add_command(tune)


@bench.command("run")
@click.argument("suite")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the results; results/SUITE by default.",
)
@click.option("--workers", type=click.IntRange(min=1), help="Processes; one a core by default.")
@click.option("--fresh", is_flag=True, help="Run everything anew, also what is there already.")
def run_command(suite: str, output: Path | None, workers: int | None, fresh: bool) -> None:
    """Run SUITE (a name or a TOML file) and write its report.

    What is in the folder already is not run again: after Ctrl-C the same command goes on. Exit
    status 1 if a run gave no result; a run that diverged is a result.
    """
    from mobman.benchmark.runner import default_workers, run_suite
    from mobman.benchmark.suite import load_suite

    chosen = load_suite(suite)
    folder = output or Path("results") / chosen.name
    count = default_workers() if workers is None else workers
    display = _Display()
    try:
        with display:
            summary = run_suite(
                chosen,
                folder,
                workers=count,
                fresh=fresh,
                on_start=display.start,
                on_done=display.done,
            )
    except KeyboardInterrupt:
        click.echo(
            f"mobman: interrupted; what was done is kept in {folder}, the same command goes on from "
            "there",
            err=True,
        )
        raise click.exceptions.Exit(130) from None
    ended = sum(outcome.status in ("diverged", "singular") for outcome in summary.outcomes)
    click.echo(
        f"{summary.asked} runs: {summary.skipped} were there, {len(summary.outcomes)} done in "
        f"{summary.seconds:.0f} s with {count} workers; {ended} of these diverged or met a "
        f"singularity, {len(summary.failed)} failed"
    )
    for outcome in summary.failed:
        click.echo(f"mobman: failed: {outcome.run}: {outcome.message}", err=True)
    _report(folder)
    if summary.failed:
        raise click.exceptions.Exit(1)


@bench.command("report")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write the report here and leave FOLDER as it is.",
)
@click.option(
    "--cell",
    "cells",
    multiple=True,
    metavar="NAME",
    help="Draw this cell, 'ROBOT, TASK, SCENARIO' with * for any text; may be given several times.",
)
@click.option(
    "--latex",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write LaTeX tables and figures as PDF here, too.",
)
@click.option("--replays", is_flag=True, help="Write a page of each run, FOLDER/replays/ID.html.")
def report_command(
    folder: Path, output: Path | None, cells: tuple[str, ...], latex: Path | None, replays: bool
) -> None:
    """Write the report of the results in FOLDER anew, and its index."""
    _report(folder, replays=replays, output=output, cells=cells, latex=latex)


def _report(
    folder: Path,
    *,
    replays: bool = False,
    output: Path | None = None,
    cells: tuple[str, ...] = (),
    latex: Path | None = None,
) -> None:
    from mobman.benchmark.reporting import report_on

    write_replay = _write_replay if replays else None
    files = report_on(folder, output=output, cells=cells, latex=latex, write_replay=write_replay)
    click.echo(f"report: {files.html}")
    click.echo(f"        {files.markdown}")
    if latex is not None:
        click.echo(f"LaTeX:  {latex / 'example.tex'}")


def _write_replay(record: Path, page: Path, instant: float | None) -> None:
    import warnings

    from mobman.viewer.view import View, make_scene

    scene = make_scene(record, time=instant)
    for warning in scene.warnings:
        warnings.warn(warning, stacklevel=1)
    with View(scene) as shown:
        shown.save(page)
    click.echo(f"replay: {page}", err=True)


class _Display:
    """Live progress on a terminal; one plain line a run elsewhere."""

    def __init__(self) -> None:
        self._console = console(stderr=True)
        self._ended = 0
        self._failed = 0
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._bar = self._progress.add_task("runs", total=None, note="")

    def __enter__(self) -> _Display:
        self._progress.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.__exit__(None, None, None)

    def start(self, asked: int, skipped: int) -> None:
        """The suite begins."""
        self._progress.update(self._bar, total=asked, completed=skipped)
        self._total, self._count = asked, skipped

    def done(self, outcome: Outcome) -> None:
        """A run is done."""
        self._count += 1
        self._failed += outcome.status == "failed"
        self._ended += outcome.status in ("diverged", "singular")
        note = f"{self._ended} diverged, {self._failed} failed"
        self._progress.update(self._bar, advance=1, note=note)
        if not self._console.is_terminal:
            error = number(outcome.task_error)
            click.echo(
                f"[{self._count}/{self._total}] {outcome.run}: {outcome.status}, |e_e| {error} m",
                err=True,
            )
