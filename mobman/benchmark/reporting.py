"""From a folder of results to its report."""

from __future__ import annotations

import os
from pathlib import Path

from mobman.benchmark.report.content import FailedRun, ReportedRun, ReportedSuite, ReportFiles
from mobman.benchmark.report.report import write_report
from mobman.benchmark.store import Store
from mobman.errors import MobmanError, RecordError


def report_on(folder: str | os.PathLike[str]) -> ReportFiles:
    """Write the report of a folder of results, and rebuild its index.

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
        file = store.path(run).relative_to(store.folder)
        reported.append(ReportedRun(run.label, file.as_posix(), record, run.gains))
    if not reported and not failed:
        raise MobmanError(f"{folder} holds no runs")
    store.rebuild_index()
    seconds, workers = store.timing
    return write_report(
        Path(folder),
        ReportedSuite(suite.name, suite.description, suite.duration, suite.dt, seconds, workers),
        reported,
        failed,
    )
