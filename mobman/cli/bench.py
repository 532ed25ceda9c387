"""``mobman bench``: suites of runs."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from click import BadParameter, Choice, argument, group, option
from click.exceptions import Exit

from mobman.cli.options import COUNT, FOLDER, PATH, POSITIVE, complete, reports
from mobman.cli.output import SuiteDisplay, TuningDisplay, console, echo, note, report, table
from mobman.display import printable
from mobman.errors import MobmanError

if TYPE_CHECKING:
    from mobman.benchmark.report.report import ReportFiles
    from mobman.benchmark.runner import Summary
    from mobman.simulation.run_spec import RunSpec

_MOST_NAMED = 40
_WIDE = ("95 % interval", "runs")  # columns of the leaderboard that a terminal has no room for
_WORKERS = option("--workers", type=COUNT, help="Processes; one a core by default.")


@group()
def bench() -> None:
    """Suites of the comparative benchmark: list, show, tune, run, report, merge."""


@bench.command("list")
@reports
def list_command() -> None:
    """List the suites."""

    from mobman.benchmark.suite import list_suites, load_suite

    rows = []
    for name in list_suites():
        try:
            suite = load_suite(name)
            rows.append({"name": name, "runs": suite.size(), "description": suite.description})
        except MobmanError as error:  # another package's must not hide the others
            note(f"{name} is left out: {error}")
    report(rows)
    values, heads = [row.values() for row in rows], ("suite", "runs", "description")
    console().print(table(*heads, rows=values, right={"runs"}, names={"suite"}))


@bench.command("show")
@argument("suite", **complete("suites"))
@option("--runs", "each", is_flag=True, help="List every run.")
@reports
def show_command(suite: str, each: bool) -> None:
    """Show what SUITE (a name or a TOML file) contains, and check all of it; nothing is run."""
    from mobman.benchmark.suite import load_suite
    from mobman.model.platforms.custom import without_code

    chosen = load_suite(suite)
    with without_code():
        runs = chosen.runs()
    listing = [{"run_id": run.run_id, **run.as_dict()} for run in runs]
    report({"suite": chosen.model_dump(mode="json", by_alias=True), "runs": listing})
    simulated, cells = sum(run.duration for run in runs), {run.cell for run in runs}
    facts = {
        "runs": f"{len(runs)}, in {len(cells)} cells; {simulated:g} s simulated",
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
    laws = table(*headings, rows=_controllers(runs), names={"controller", "law"})
    heading = ": ".join(filter(None, (chosen.name, chosen.description)))
    for part in (heading, contents, laws):
        console().print(part)
    for run in runs if each else ():
        echo(f"{run.run_id}  {run}")


def _controllers(runs: list[RunSpec]) -> Iterator[tuple[str, str, str]]:
    """Label, law and gains; with the robots, where a label has different gains on them."""
    robots: dict[tuple[str, str, str], dict[str, None]] = {}
    for run in runs:
        gains = ", ".join(f"{name} = {value}" for name, value in run.gains.items())
        robots.setdefault((run.label, run.law, gains), {})[run.robot] = None
    labels = [label for label, *_ in robots]
    for label, law, gains in sorted(robots, key=lambda key: labels.index(key[0])):
        where = f" ({', '.join(robots[label, law, gains])})" if labels.count(label) > 1 else ""
        yield label, law, (gains or "none") + where


def _names(names: Iterable[str]) -> str:
    found = list(dict.fromkeys(names))
    more = f" ... ({len(found)})" if len(found) > _MOST_NAMED else ""
    return ", ".join(found[:_MOST_NAMED]) + more


# run ---------------------------------------------------------------------------------------------------


def _part(text: str) -> tuple[int, int]:
    """K/N as a pair of numbers."""
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise BadParameter(f"{text!r} is no part: give K/N with K from 1 to N, such as 2/4")
    return int(found[1]), int(found[2])


_DASK = "Run on the cluster of this Dask scheduler (tcp://host:8786)."
_REDO = "Re-run what other versions of mobman's source files or of libraries made."
_PART = "Every N-th run, from the K-th on; no report."
_LIMIT = "Wall time that a run may take (s); the suite's by default."


@bench.command("run")
@argument("suite", **complete("suites"))
@option("-o", "--output", type=FOLDER, help="Folder of the results; results/SUITE by default.")
@_WORKERS
@option("--dask", metavar="ADDRESS", help=_DASK)
@option("--fresh", is_flag=True, help="Re-run everything, ignoring existing results.")
@option("--redo-changed", is_flag=True, help=_REDO)
@option("--part", metavar="K/N", type=_part, help=_PART)
@option("--time-limit", type=POSITIVE, metavar="S", help=_LIMIT)
@reports
def run_command(
    suite: str, output: Path | None, part: tuple[int, int] | None, **options: Any
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
    try:
        with display:
            summary = run_suite(chosen, folder, part=part, on_event=display.tell, **options)
    except KeyboardInterrupt:
        if not display.asked:
            _leave("interrupted before the first run")
        if display.there == display.asked:
            _leave(
                f"interrupted; all runs are kept in {folder}, their report is written by: "
                f"mobman bench report {folder}"
            )
        _leave(
            f"interrupted after {display.there} of {display.asked} runs; what was done is kept in "
            f"{folder}, the same command goes on from there"
        )
    _tell(summary, folder)
    if summary.report is not None:
        _tell_report(summary.report, leaderboard=True)
    elif part is not None:
        echo(
            f"part {part[0]} of {part[1]} is in {folder}; the parts are joined by: "
            "mobman bench merge FOLDERS -o FOLDER"
        )
    if summary.failed:
        raise Exit(1)


def _leave(message: str) -> None:
    note(message)
    raise Exit(130) from None


def _tell(summary: Summary, folder: Path) -> None:
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
    page = None if summary.report is None else str(summary.report.html)
    report({"folder": str(folder), **counts, "outcomes": outcomes, "report": page})
    done = f"{summary.asked} runs: {summary.skipped} were there"
    if summary.outcomes:
        ended = sum(outcome.status in ("diverged", "singular") for outcome in summary.outcomes)
        done += (
            f", {len(summary.outcomes)} done in {summary.seconds:.0f} s with {summary.workers} "
            f"{'worker' if summary.workers == 1 else 'workers'}; {ended} of these diverged or met a "
            f"singularity, {len(summary.failed)} failed"
        )
    echo(done)
    for difference, count in Counter(other for _, other in summary.changed).items():
        note(
            f"{count} of the results were made by other sources ({difference}); they are kept, and run "
            "again with --redo-changed"
        )
    for outcome in summary.failed:
        note(f"failed: {outcome.run}: {outcome.message}")


# tune --------------------------------------------------------------------------------------------------

_OUTPUT = "Folder of the results; results/SUITE-tuning by default."
_TUNED = "Tune these alone; repeatable.  [default: all that have a search space]"


@bench.command("tune")
@argument("suite", **complete("suites"))
@option("-o", "--output", type=FOLDER, help=_OUTPUT)
@option("--trials", type=COUNT, help="Trials of each controller; the suite's by default.")
@_WORKERS
@option("--controllers", multiple=True, metavar="LABEL", help=_TUNED)
@option("--fresh", is_flag=True, help="Begin again, also where trials are there already.")
@reports
def tune_command(suite: str, output: Path | None, workers: int | None, **options: Any) -> None:
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
    options |= {"controllers": options["controllers"] or None, "workers": count}
    options |= {"on_start": display.start, "on_step": display.step}
    try:
        with display:
            result = tune_suite(chosen, folder, **options)
    except KeyboardInterrupt:
        _leave(
            f"interrupted; the trials that were done are kept in {folder}, the same command goes on "
            "from there"
        )
    for label, why in result.left_out.items():
        note(f"not tuned: {label!r} {why}")
    tuned: dict[str, dict[str, Any]] = {}
    for label, trials in result.trials.items():
        best = result.best(label)
        scores = {"score_default": trials[0].score, "score": best.score}
        tuned[label] = {"trials": len(trials), **scores, "trial": best.number, "gains": best.gains}
    files = {"suite": str(result.suite_file), "tuning": str(result.json_file)}
    rest = {"controllers": tuned, "not_tuned": dict(result.left_out)}
    report({**files, "seconds": result.seconds, **rest})
    numbers, out = ("trials", "score", "tuned", "trial"), console()
    listing = table("controller", *numbers, "gains", right=numbers, names={"controller"})
    for label, row in tuned.items():
        count, before, after, trial, found = row.values()
        gains = ", ".join(f"{name} = {value:g}" for name, value in found.items())
        texts = (str(count), f"{before:.3f}", f"{after:.3f}", str(trial))
        listing.add_row(label, *texts, gains or "the suite's own: no trial was better")
    out.print(listing)
    out.print(f"suite:  {result.suite_file}", soft_wrap=True)
    out.print(f"trials: {result.json_file}", soft_wrap=True)


# report and merge --------------------------------------------------------------------------------------

_CELL = "Draw this cell, 'ROBOT, TASK, SCENARIO' with * for any text; may be given several times."
_COLUMN = "Columns of a page that LaTeX figures span: 3.5 or 7.16 inches."
_MERGED = "Folder that gets everything; new, or with results of the same suite."


@bench.command("report")
@argument("folder", type=PATH)
@option("-o", "--output", type=FOLDER, help="Write the report here and leave FOLDER as it is.")
@option("--cell", "cells", multiple=True, metavar="NAME", help=_CELL)
@option("--latex", type=FOLDER, help="Write LaTeX tables and figures as PDF here, too.")
@option("--column", type=Choice(["single", "double"]), default="single", help=_COLUMN)
@option("--font", default="Liberation Sans", help="Font of LaTeX figures; 'serif'.")
@option("--font-size", "size", type=float, default=8.0, help="Its size (pt).")
@option("--replays", is_flag=True, help="Write a page of each run, FOLDER/replays/ID.html.")
@reports
def report_command(folder: Path, replays: bool, latex: Path | None, **options: Any) -> None:
    """Write the report of the results in FOLDER again, and its index."""
    from mobman.benchmark.report.report import report_on
    from mobman.figures.files import Print

    options["write_replay"] = _write_replay if replays else None
    how = Print(*(options.pop(key) for key in ("column", "font", "size")))
    files = report_on(folder, latex=latex, how=how, **options)
    example = None if latex is None else str(latex / "example.tex")
    report({**{k: str(getattr(files, k)) for k in ("html", "markdown", "csv")}, "latex": example})
    _tell_report(files)
    if example is not None:
        echo(f"LaTeX:  {example}")


def _tell_report(files: ReportFiles, *, leaderboard: bool = False) -> None:
    if leaderboard and files.leaderboard is not None:
        columns, rows = files.leaderboard.columns, files.leaderboard.rows
        narrow = [i for i, column in enumerate(columns) if column.text not in _WIDE]
        heads = [columns[i].text for i in narrow]
        cells = [[printable(row[i].text) for i in narrow] for row in rows]
        right = {column.text for column in columns if column.number}
        console().print(table(*heads, rows=cells, right=right, names={heads[0]}))
    echo(f"report: {files.html}")
    echo(f"        {files.markdown}")


def _write_replay(record: Path, page: Path, instant: float | None) -> None:
    from mobman.viewer.view import View, make_scene

    with View(make_scene(record, time=instant)) as shown:
        shown.save(page)
    echo(f"replay: {page}", err=True)


@bench.command("merge")
@argument("folders", nargs=-1, required=True, type=PATH)
@option("-o", "--output", required=True, type=FOLDER, help=_MERGED)
@reports
def merge_command(folders: tuple[Path, ...], output: Path) -> None:
    """Join FOLDERS of one suite's results into another folder.

    The folders are left as they are. Exit status 1 if a record could not be read, or two folders
    have different results for one run.
    """
    from mobman.benchmark.results import merge

    merged = merge(folders, output)
    for message in merged.unusable:
        note(f"left out: {message}")
    for message in merged.conflicts:
        note(f"conflict, the first is kept: {message}")
    report({"folder": str(output), **asdict(merged)})
    echo(
        f"{output}: {merged.there} of {merged.asked} runs, {merged.copied} copied; the report is "
        f"written by: mobman bench report {output}"
    )
    if merged.unusable or merged.conflicts:
        raise Exit(1)
