"""From a folder of results to its report."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mobman.benchmark.report.content import FailedRun, ReportedRun, ReportedSuite, ReportFiles
from mobman.benchmark.report.format import end_time
from mobman.benchmark.report.report import write_report
from mobman.benchmark.store import Store
from mobman.errors import MobmanError, RecordError

WriteReplay = Callable[[Path, Path, float | None], None]
"""Writes a page: given a record's file, the page's, and the instant that it opens at (s), if any."""
_REPLAYS = "replays"


def report_on(
    folder: str | os.PathLike[str], *, write_replay: WriteReplay | None = None
) -> ReportFiles:
    """Write the report of a folder of results, and rebuild its index.

    Args:
        folder: The folder.
        write_replay: Writes the page ``replays/RUN_ID.html`` of a run, at its instant of failure if
            it ended early; by default none is written, and those that are there are linked if they
            are no older than their records.

    Runs whose record is missing or unreadable are listed with the reason; none is dropped.

    Raises:
        MobmanError: If the folder holds no results at all.
    """
    store = Store(folder)
    runs, suite = store.runs, store.suite
    reasons = {failure.run_id: failure.reason for failure in store.failures}
    reported: list[ReportedRun] = []
    failed: list[FailedRun] = []
    for run in runs:
        try:
            record = store.record(run)
        except RecordError as error:
            reason = reasons.get(run.run_id, str(error))
            failed.append(
                FailedRun(run.label, run.robot, run.task, run.scenario["name"], run.seed, reason)
            )
            continue
        path = store.path(run)
        entry = ReportedRun(run.label, path.relative_to(store.folder).as_posix(), record, run.gains)
        instant = _failure(entry)
        page = store.folder / _REPLAYS / f"{run.run_id}.html"
        if write_replay is not None:
            write_replay(path, page, instant)
        reported.append(
            replace(
                entry,
                command=_command(path, instant),
                replay=page.relative_to(store.folder).as_posix() if _is_of(page, path) else "",
            )
        )
    if not reported and not failed:
        raise MobmanError(f"{folder} holds no runs")
    store.rebuild_index()
    seconds, workers = store.timing
    return write_report(
        Path(folder),
        ReportedSuite(suite.name, suite.description, suite.duration, runs[0].dt, seconds, workers),
        reported,
        failed,
    )


def _failure(run: ReportedRun) -> float | None:
    """When a run failed (s); None if it did not."""
    if run.record.ok:
        return None
    instant = end_time(run)
    return None if math.isnan(instant) else instant


def _command(path: Path, instant: float | None) -> str:
    """What shows a run's replay."""
    words = ["mobman", "view", str(path)]
    if instant is not None:
        words += ["--time", f"{instant:.6g}"]
    return shlex.join(words)


def _is_of(page: Path, record: Path) -> bool:
    """Whether a page is there and not of an earlier record."""
    try:
        return page.stat().st_mtime_ns >= record.stat().st_mtime_ns
    except OSError:
        return False
