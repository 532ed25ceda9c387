"""``mobman bench``: suites of runs."""

from __future__ import annotations

from pathlib import Path

import click

from mobman.cli.bench_merge import merge_command
from mobman.cli.bench_progress import SuiteProgress
from mobman.cli.bench_suites import list_command, show_command
from mobman.cli.bench_tune import tune
from mobman.cli.interruption import interrupted_once
from mobman.cli.output import echo


def _part(
    context: click.Context, parameter: click.Parameter, value: str | None
) -> tuple[int, int] | None:
    """K/N as a pair of numbers."""
    if value is None:
        return None
    first, _, count = value.partition("/")
    if not (first.isdecimal() and count.isdecimal() and 1 <= int(first) <= int(count)):
        raise click.BadParameter(f"{value!r} is no part: give K/N with K from 1 to N, such as 2/4")
    return int(first), int(count)


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
@click.option(
    "--dask", metavar="ADDRESS", help="Run on the cluster of this Dask scheduler (tcp://host:8786)."
)
@click.option("--fresh", is_flag=True, help="Run everything anew, also what is there already.")
@click.option(
    "--part", metavar="K/N", callback=_part, help="Every N-th run, from the K-th on; no report."
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0, min_open=True),
    metavar="S",
    help="Wall time that a run may take (s); the suite's by default.",
)
def run_command(
    suite: str,
    output: Path | None,
    workers: int | None,
    dask: str | None,
    fresh: bool,
    part: tuple[int, int] | None,
    time_limit: float | None,
) -> None:
    """Run SUITE (a name or a TOML file) and write its report.

    What is in the folder already is not run again: after Ctrl-C the same command goes on. Exit
    status 1 if a run gave no result; a run that diverged is a result.
    """
    from mobman.benchmark.suite import load_suite

    chosen = load_suite(suite)
    if dask is None:
        from mobman.benchmark.running.worker_processes import start_ahead

        start_ahead()  # while the following is imported
    from mobman.benchmark.runner import run_suite

    folder = output or Path("results") / chosen.name
    display = SuiteProgress()
    with interrupted_once():
        try:
            with display:
                summary = run_suite(
                    chosen,
                    folder,
                    workers=workers,
                    dask=dask,
                    fresh=fresh,
                    part=part,
                    time_limit=time_limit,
                    on_event=display.tell,
                )
        except KeyboardInterrupt:
            echo(f"mobman: {_interrupted(display, folder)}", err=True)
            raise click.exceptions.Exit(130) from None
    ended = sum(outcome.status in ("diverged", "singular") for outcome in summary.outcomes)
    done = f"{summary.asked} runs: {summary.skipped} were there"
    if summary.outcomes:
        done += (
            f", {len(summary.outcomes)} done in {summary.seconds:.0f} s with {summary.workers} "
            f"{'worker' if summary.workers == 1 else 'workers'}; {ended} of these diverged or met a "
            f"singularity, {len(summary.failed)} failed"
        )
    echo(done)
    for outcome in summary.failed:
        echo(f"mobman: failed: {outcome.run}: {outcome.message}", err=True)
    if part is None:
        try:
            _report(folder)
        except KeyboardInterrupt:
            echo(
                f"mobman: interrupted; all runs are kept in {folder}, their report is written by: "
                f"mobman bench report {folder}",
                err=True,
            )
            raise click.exceptions.Exit(130) from None
    else:
        echo(
            f"part {part[0]} of {part[1]} is in {folder}; the parts are joined by: "
            "mobman bench merge FOLDERS -o FOLDER"
        )
    if summary.failed:
        raise click.exceptions.Exit(1)


def _interrupted(display: SuiteProgress, folder: Path) -> str:
    if not display.asked:
        return "interrupted before the first run"
    return (
        f"interrupted after {display.there} of {display.asked} runs; what was done is kept in {folder}, "
        "the same command goes on from there"
    )


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
    echo(f"report: {files.html}")
    echo(f"        {files.markdown}")
    if latex is not None:
        echo(f"LaTeX:  {latex / 'example.tex'}")


def _write_replay(record: Path, page: Path, instant: float | None) -> None:
    import warnings

    from mobman.viewer.view import View, make_scene

    scene = make_scene(record, time=instant)
    for warning in scene.warnings:
        warnings.warn(warning, stacklevel=1)
    with View(scene) as shown:
        shown.save(page)
    echo(f"replay: {page}", err=True)
