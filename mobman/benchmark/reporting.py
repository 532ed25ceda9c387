"""From a folder of results to its report."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from mobman.benchmark.report.content import (
    FailedRun,
    ReportedRun,
    ReportedSuite,
    ReportFiles,
    UnusedFile,
)
from mobman.benchmark.report.report import Request, write_report
from mobman.benchmark.store import Store
from mobman.errors import MobmanError, RecordError
from mobman.input_file import check_within
from mobman.simulation.record import RecordSummary, load_record
from mobman.simulation.run_spec import RunSpec

WriteReplay = Callable[[Path, Path, float | None], None]
"""Writes a page: given a record's file, the page's, and the instant that it opens at (s), if any."""
_REPLAYS = "replays"


@dataclass(frozen=True)
class Results:
    """What a folder holds, without the samples."""

    suite: ReportedSuite
    runs: list[ReportedRun]
    failures: list[FailedRun]
    """Runs without a result."""
    unused: list[UnusedFile]


def report_on(
    folder: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    cells: Sequence[str] = (),
    latex: str | os.PathLike[str] | None = None,
    write_replay: WriteReplay | None = None,
) -> ReportFiles:
    """Write the report of a folder of results, and its index.

    Args:
        folder: The folder.
        output: Where the report goes; into the folder by default. With another one, nothing is written
            into the folder, so that it may be read-only.
        cells: Names of the cells to draw, ``"ROBOT, TASK, SCENARIO"``, with ``*`` and ``?``; by
            default all of them, or a selection where they are many.
        latex: A folder for LaTeX tables and vector figures; none by default. The errors and torques
            are those of the first of ``cells``, or of the suite's first cell.
        write_replay: Writes the page ``replays/RUN_ID.html`` of a run, at its instant of failure if
            it ended early; by default none is written, and those that are there are linked if they
            are no older than their records.

    Runs whose record is missing or unreadable are listed with the reason; none is dropped.

    Raises:
        MobmanError: If the folder holds no results at all, or the report cannot be written.
        UsageError: If there is no such cell.
    """
    store = Store(folder)
    place = store.folder if output is None else Path(output)
    results = read_results(store, place, write_replay)
    files = write_report(
        place, results.suite, results.runs, results.failures, results.unused, Request(tuple(cells))
    )
    if latex is not None:
        from mobman.benchmark.report.latex import write_latex

        write_latex(Path(latex), results.suite, results.runs, results.failures, cells)
    if output is None:
        store.rebuild_index()  # a folder of unknown origin may hold links to anywhere
    return files


def read_results(
    store: Store, place: Path | None = None, write_replay: WriteReplay | None = None
) -> Results:
    """Everything in a folder of results but the samples.

    Args:
        store: The folder.
        place: The folder that files are named from; the store's own by default.
        write_replay: See :func:`report_on`.

    Raises:
        MobmanError: If there are no results at all.
    """
    place = store.folder if place is None else place
    reasons = {failure.run_id: failure.reason for failure in store.failures}
    runs: list[ReportedRun] = []
    failures: list[FailedRun] = []
    unused: list[UnusedFile] = []
    asked = set()
    for spec in store.runs:
        path = store.path(spec)
        asked.add(path.name)
        try:
            summary = store.summary(spec)
        except RecordError as error:
            reason = reasons.get(path.stem, "")
            there = path.exists()
            if there:
                unused.append(UnusedFile(_relative(path, store.folder), str(error)))
            pending = not reason and not there
            reason = reason or ("not done yet" if pending else str(error))
            failures.append(
                FailedRun(spec.label, spec.cell, spec.seed, reason, spec.family, pending)
            )
            continue
        run = _reported(spec, summary, path, place)
        page = place / _REPLAYS / f"{path.stem}.html"
        check_within(page.parent, place)
        if write_replay is not None:
            try:
                write_replay(path, page, _instant(run))
            except RecordError as error:  # its samples cannot be read, though its metrics can
                unused.append(UnusedFile(_relative(path, store.folder), str(error)))
        if _is_of(page, path):
            run = replace(run, replay=_relative(page, place))
        runs.append(run)
    if not runs and not failures:
        raise MobmanError(f"{store.folder} holds no runs")
    unused += _others(store, asked)
    return Results(_suite(store), runs, failures, unused)


def _reported(spec: RunSpec, summary: RecordSummary, path: Path, folder: Path) -> ReportedRun:
    run = ReportedRun(
        label=spec.label,
        cell=spec.cell,
        seed=spec.seed,
        file=_relative(path, folder),
        law=spec.law,
        status=summary.status,
        message=summary.message,
        metrics=summary.metrics,
        settings=summary.settings,
        versions=summary.versions,
        created=summary.created,
        machine=summary.machine,
        load=partial(load_record, path),
        acceleration=_acceleration(spec),
        family=spec.family,
        gains=spec.gains,
    )
    return replace(run, command=_command(path, _instant(run)))


def _acceleration(spec: RunSpec) -> str:
    found = spec.scenario.get("acceleration", "")
    return str(found.get("type", "")) if isinstance(found, dict) else str(found)


def _others(store: Store, asked: set[str]) -> list[UnusedFile]:
    """Files beside the records that the suite asked for."""
    found = []
    for path in sorted((store.folder / "runs").glob("*")):
        if path.name in asked or path.name.startswith("."):  # the latter: being written
            continue
        reason = "a record that this suite does not ask for"
        if path.suffix != ".h5":
            reason = "not a record: these end in .h5"
        else:
            try:
                store.read(path)
            except RecordError as error:
                reason = str(error)
        found.append(UnusedFile(_relative(path, store.folder), reason))
    return found


def _suite(store: Store) -> ReportedSuite:
    manifest = store.manifest
    suite = manifest.suite
    tuned = {
        label: entry.tuned.model_dump(mode="json")
        for label, entry in suite.controllers.items()
        if entry.tuned is not None
    }
    folder = shlex.quote(str(store.folder))
    return ReportedSuite(
        suite.name, suite.description, manifest.seconds, manifest.workers, tuned, folder
    )


def _instant(run: ReportedRun) -> float | None:
    """When a run failed (s); None if it did not."""
    if run.ok:
        return None
    instant = run.end
    if math.isnan(instant):
        try:
            times = run.load().t
        except RecordError:
            return None
        return float(times[-1]) if len(times) else None
    return instant


def _command(path: Path, instant: float | None) -> str:
    """What shows a run's replay."""
    words = ["mobman", "view", str(path)]
    if instant is not None:
        words += ["--time", f"{instant:.6g}"]
    return shlex.join(words)


def _relative(path: Path, folder: Path) -> str:
    """A path as a link from a folder."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on another drive
        return path.resolve().as_posix()


def _is_of(page: Path, record: Path) -> bool:
    """Whether a page is there and not of an earlier record."""
    try:
        return page.stat().st_mtime_ns >= record.stat().st_mtime_ns
    except OSError:
        return False
