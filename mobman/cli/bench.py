"""``mobman bench``: suites of runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mobman.cli.names import complete
from mobman.cli.output import (
    FOLDER,
    POSITIVE,
    console,
    echo,
    print_json,
    reports,
    table,
)
from mobman.cli.progress import SuiteDisplay, TuningDisplay, interrupted_once
from mobman.errors import MobmanError
from mobman.printable import printable

if TYPE_CHECKING:
    from mobman.benchmark.report.report import ReportFiles
    from mobman.benchmark.runner import Summary
    from mobman.simulation.run_spec import RunSpec

_MOST_NAMED = 40
_COUNT = click.IntRange(min=1)
_WIDE = ("95 % interval", "runs")  # columns of the leaderboard that a terminal has no room for


@click.group()
def bench() -> None:
    """Suites of the comparative benchmark: list, show, tune, run, report, merge."""


@bench.command("list")
@reports
def list_command(as_json: bool) -> None:
    """List the suites."""
    from mobman.benchmark.suite import list_suites, load_suite

    rows = []
    for name in list_suites():
        try:
            suite = load_suite(name)
            count = suite.size()
        except MobmanError as error:  # another package's must not hide the others
            echo(f"mobman: {name} is left out: {' '.join(str(error).split())}", err=True)
            continue
        rows.append({"name": name, "runs": count, "description": suite.description})
    if as_json:
        print_json(rows)
    else:
        values = [row.values() for row in rows]
        heads = ("suite", "runs", "description")
        console().print(table(*heads, rows=values, right={"runs"}, names={"suite"}))


@bench.command("show")
@click.argument("suite", **complete("suites"))
@click.option("--runs", "each", is_flag=True, help="List every run.")
@reports
def show_command(suite: str, each: bool, as_json: bool) -> None:
    """Show what SUITE (a name or a TOML file) contains, and check all of it; nothing is run."""
    from mobman.benchmark.suite import load_suite
    from mobman.model.platforms.custom import without_code

    chosen = load_suite(suite)
    with without_code():
        runs = chosen.runs()
    if as_json:
        listing = [{"run_id": run.run_id, **run.as_dict()} for run in runs]
        print_json({"suite": chosen.model_dump(mode="json", by_alias=True), "runs": listing})
        return
    simulated = sum(run.duration for run in runs)
    facts = {
        "runs": f"{len(runs)}, in {len({run.cell for run in runs})} cells; {simulated:g} s simulated",
        "robots": _names(run.robot for run in runs),
        "tasks": _names(run.task for run in runs),
        "scenarios": _names(run.scenario["name"] for run in runs),
        "durations": _names(f"{run.duration:g} s" for run in runs),
        "dt": _names(f"{run.dt:g} s" for run in runs),
        "placements": _names(str(run.placement) for run in runs),
        "seeds": _names(str(run.seed) for run in runs),
        "time limit": f"{chosen.time_limit:g} s a run, wall time",
        "samples": f"one every {chosen.record_period:g} s in the files",
    }
    contents = table(rows=facts.items())
    contents.columns[0].style = "bold"
    headings = ("controller", "law", "gains in addition to the defaults")
    for part in (
        f"{chosen.name}: {chosen.description}",
        contents,
        table(*headings, rows=_controllers(runs), names={"controller", "law"}),
    ):
        console().print(part)
    if each:
        for run in runs:
            echo(f"{run.run_id}  {run}")


def _controllers(runs: list[RunSpec]) -> Iterator[tuple[str, str, str]]:
    """Label, law and gains; with the robots, where a label has different gains on them."""
    robots: dict[tuple[str, str, str], dict[str, None]] = {}
    for run in runs:
        gains = ", ".join(f"{name} = {value}" for name, value in run.gains.items())
        robots.setdefault((run.label, run.law, gains), {})[run.robot] = None
    labels = [label for label, *_ in robots]
    for label, law, gains in sorted(robots, key=lambda key: labels.index(key[0])):
        note = f" ({', '.join(robots[label, law, gains])})" if labels.count(label) > 1 else ""
        yield label, law, (gains or "none") + note


def _names(names: Iterable[str]) -> str:
    found = list(dict.fromkeys(names))
    more = f" ... ({len(found)})" if len(found) > _MOST_NAMED else ""
    return ", ".join(found[:_MOST_NAMED]) + more


# run ---------------------------------------------------------------------------------------------------


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


@bench.command("run")
@click.argument("suite", **complete("suites"))
@click.option(
    "-o", "--output", type=FOLDER, help="Folder of the results; results/SUITE by default."
)
@click.option("--workers", type=_COUNT, help="Processes; one a core by default.")
@click.option(
    "--dask", metavar="ADDRESS", help="Run on the cluster of this Dask scheduler (tcp://host:8786)."
)
@click.option("--fresh", is_flag=True, help="Re-run everything, ignoring existing results.")
@click.option(
    "--redo-changed",
    is_flag=True,
    help="Re-run what other versions of mobman's source files or of libraries made.",
)
@click.option(
    "--part", metavar="K/N", callback=_part, help="Every N-th run, from the K-th on; no report."
)
@click.option(
    "--time-limit",
    type=POSITIVE,
    metavar="S",
    help="Wall time that a run may take (s); the suite's by default.",
)
@reports
def run_command(
    suite: str,
    output: Path | None,
    part: tuple[int, int] | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Run SUITE (a name or a TOML file), write its report and print its leaderboard.

    What is in the folder already is not run again: after Ctrl-C the same command goes on. Exit
    status 1 if a run gave no result; a run that diverged is a result.
    """
    from mobman.benchmark.suite import load_suite

    chosen = load_suite(suite)
    if options["dask"] is None:
        from mobman.benchmark.workers import start_ahead
        from mobman.compiled import anything_kept

        if anything_kept():  # else both would compile
            start_ahead()  # while the following is imported
    from mobman.benchmark.runner import run_suite

    folder = output or Path("results") / chosen.name
    display = SuiteDisplay()
    with interrupted_once():
        try:
            with display:
                summary = run_suite(chosen, folder, part=part, on_event=display.tell, **options)
        except KeyboardInterrupt:
            if 0 < display.asked == display.there:
                _leave(
                    f"interrupted; all runs are kept in {folder}, their report is written by: "
                    f"mobman bench report {folder}"
                )
            _leave(
                f"interrupted after {display.there} of {display.asked} runs; what was done is kept in "
                f"{folder}, the same command goes on from there"
                if display.asked
                else "interrupted before the first run"
            )
    _tell(summary, as_json, folder)
    if summary.report is not None and not as_json:
        _tell_report(summary.report, leaderboard=True)
    elif part is not None and not as_json:
        echo(
            f"part {part[0]} of {part[1]} is in {folder}; the parts are joined by: "
            "mobman bench merge FOLDERS -o FOLDER"
        )
    if summary.failed:
        raise click.exceptions.Exit(1)


def _leave(message: str) -> None:
    echo(f"mobman: {message}", err=True)
    raise click.exceptions.Exit(130) from None


def _tell(summary: Summary, as_json: bool, folder: Path) -> None:
    if as_json:
        outcomes = [
            {
                "run_id": outcome.run.run_id,
                "run": str(outcome.run),
                "status": outcome.status,
                "message": outcome.message,
                "task_error_max": outcome.task_error,
            }
            for outcome in summary.outcomes
        ]
        counts = {key: getattr(summary, key) for key in ("asked", "skipped", "seconds", "workers")}
        report = None if summary.report is None else str(summary.report.html)
        print_json({"folder": str(folder), **counts, "outcomes": outcomes, "report": report})
    done = f"{summary.asked} runs: {summary.skipped} were there"
    if summary.outcomes:
        ended = sum(outcome.status in ("diverged", "singular") for outcome in summary.outcomes)
        done += (
            f", {len(summary.outcomes)} done in {summary.seconds:.0f} s with {summary.workers} "
            f"{'worker' if summary.workers == 1 else 'workers'}; {ended} of these diverged or met a "
            f"singularity, {len(summary.failed)} failed"
        )
    if not as_json:
        echo(done)
    differences = dict.fromkeys(difference for _, difference in summary.changed)
    for difference in differences:
        count = sum(other == difference for _, other in summary.changed)
        echo(
            f"mobman: {count} of the results were made by other sources ({difference}); they are kept, "
            "and run again with --redo-changed",
            err=True,
        )
    for outcome in summary.failed:
        echo(f"mobman: failed: {outcome.run}: {outcome.message}", err=True)


# tune --------------------------------------------------------------------------------------------------


@bench.command("tune")
@click.argument("suite", **complete("suites"))
@click.option(
    "-o", "--output", type=FOLDER, help="Folder of the results; results/SUITE-tuning by default."
)
@click.option("--trials", type=_COUNT, help="Trials of each controller; the suite's by default.")
@click.option("--workers", type=_COUNT, help="Processes; one a core by default.")
@click.option(
    "--controllers",
    multiple=True,
    metavar="LABEL",
    help="Tune these alone; repeatable.  [default: all that have a search space]",
)
@click.option("--fresh", is_flag=True, help="Begin again, also where trials are there already.")
@reports
def tune_command(
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
    from mobman.benchmark.backends import default_workers
    from mobman.benchmark.suite import load_suite
    from mobman.benchmark.tuning.tune import tune_suite

    chosen = load_suite(suite)
    folder = output or Path("results") / f"{chosen.name}-tuning"
    count = default_workers() if workers is None else workers
    display = TuningDisplay(count)
    options |= {"controllers": controllers or None, "workers": count}
    try:
        with interrupted_once(), display:
            result = tune_suite(
                chosen, folder, on_start=display.start, on_step=display.step, **options
            )
    except KeyboardInterrupt:
        _leave(
            f"interrupted; the trials that were done are kept in {folder}, the same command goes on "
            "from there"
        )
    for label, why in result.left_out.items():
        echo(f"mobman: not tuned: {label!r} {why}", err=True)
    tuned: dict[str, dict[str, Any]] = {
        label: {
            "trials": len(trials),
            "score_default": trials[0].score,
            "score": result.best(label).score,
            "trial": result.best(label).number,
            "gains": result.best(label).gains,
        }
        for label, trials in result.trials.items()
    }
    if as_json:
        files = {"suite": str(result.suite_file), "tuning": str(result.json_file)}
        times = {"seconds": result.seconds}
        print_json({**files, **times, "controllers": tuned, "not_tuned": dict(result.left_out)})
        return
    numbers, out = ("trials", "score", "tuned", "trial"), console()
    listing = table("controller", *numbers, "gains", right=numbers, names={"controller"})
    for label, row in tuned.items():
        trials, *scores, trial, found = row.values()
        gains = ", ".join(f"{name} = {value:g}" for name, value in found.items())
        texts = (str(trials), *(f"{score:.3f}" for score in scores), str(trial))
        listing.add_row(label, *texts, gains or "the suite's own: no trial was better")
    out.print(listing)
    out.print(f"suite:  {result.suite_file}", soft_wrap=True)
    out.print(f"trials: {result.json_file}", soft_wrap=True)


# report and merge --------------------------------------------------------------------------------------


@bench.command("report")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=FOLDER, help="Write the report here and leave FOLDER as it is."
)
@click.option(
    "--cell",
    "cells",
    multiple=True,
    metavar="NAME",
    help="Draw this cell, 'ROBOT, TASK, SCENARIO' with * for any text; may be given several times.",
)
@click.option("--latex", type=FOLDER, help="Write LaTeX tables and figures as PDF here, too.")
@click.option(
    "--column",
    type=click.Choice(["single", "double"]),
    default="single",
    show_default=True,
    help="Columns of a page that LaTeX figures span: 3.5 or 7.16 inches.",
)
@click.option(
    "--font", default="Liberation Sans", show_default=True, help="Font of LaTeX figures; 'serif'."
)
@click.option(
    "--font-size", "size", type=float, default=8.0, show_default=True, help="Its size (pt)."
)
@click.option("--replays", is_flag=True, help="Write a page of each run, FOLDER/replays/ID.html.")
@reports
def report_command(
    folder: Path,
    replays: bool,
    latex: Path | None,
    column: str,
    font: str,
    size: float,
    as_json: bool,
    **options: Any,
) -> None:
    """Write the report of the results in FOLDER again, and its index."""
    from mobman.benchmark.report.report import report_on
    from mobman.figures.files import Print

    write_replay = _write_replay if replays else None
    how = Print(column, font, size)
    files = report_on(folder, latex=latex, how=how, write_replay=write_replay, **options)
    if as_json:
        found = {key: str(getattr(files, key)) for key in ("html", "markdown", "csv")}
        print_json({**found, "latex": None if latex is None else str(latex / "example.tex")})
        return
    _tell_report(files)
    if latex is not None:
        echo(f"LaTeX:  {latex / 'example.tex'}")


def _tell_report(files: ReportFiles, *, leaderboard: bool = False) -> None:
    if leaderboard and files.leaderboard is not None:
        heads = [column.text for column in files.leaderboard.columns]
        narrow = [i for i, head in enumerate(heads) if head not in _WIDE]
        listing = table(
            *(heads[i] for i in narrow),
            rows=[[printable(row[i].text) for i in narrow] for row in files.leaderboard.rows],
            right={column.text for column in files.leaderboard.columns if column.number},
            names={heads[narrow[0]]},
        )
        console().print(listing)
    echo(f"report: {files.html}")
    echo(f"        {files.markdown}")


def _write_replay(record: Path, page: Path, instant: float | None) -> None:
    from mobman.viewer.view import View, make_scene

    scene = make_scene(record, time=instant)
    for warning in scene.warnings:
        warnings.warn(warning, stacklevel=1)
    with View(scene) as shown:
        shown.save(page)
    echo(f"replay: {page}", err=True)


@bench.command("merge")
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    required=True,
    type=FOLDER,
    help="Folder that gets everything; new, or with results of the same suite.",
)
@reports
def merge_command(folders: tuple[Path, ...], output: Path, as_json: bool) -> None:
    """Join FOLDERS of one suite's results into another folder.

    The folders are left as they are. Exit status 1 if a record could not be read, or two folders
    have different results for one run.
    """
    from mobman.benchmark.store import merge

    merged = merge(folders, output)
    for message in merged.unusable:
        echo(f"mobman: left out: {message}", err=True)
    for message in merged.conflicts:
        echo(f"mobman: conflict, the first is kept: {message}", err=True)
    if as_json:
        print_json({"folder": str(output), **asdict(merged)})
    else:
        echo(
            f"{output}: {merged.there} of {merged.asked} runs, {merged.copied} copied; the "
            f"report is written by: mobman bench report {output}"
        )
    if merged.unusable or merged.conflicts:
        raise click.exceptions.Exit(1)
