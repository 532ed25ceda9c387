"""All runs with all metrics, as a table for other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from mobman.benchmark.report.cells import Group, unique
from mobman.benchmark.report.content import FailedRun, ReportedRun

_PLACE = ("robot", "task", "scenario", "family", "duration", "dt", "controller", "seed")
_OUTCOME = ("law", "status", "message", "created", "file")


def run_list(groups: Sequence[Group]) -> str:
    """The runs as CSV, one a row; those without a result have the status "failed" or "not run".

    Numbers have all digits; ``inf`` and ``nan`` are written so.
    """
    cells = [cell for group in groups for cell in group.cells]
    metrics = unique([name for cell in cells for run in cell.runs for name in run.metrics])
    content = io.StringIO()
    writer = csv.writer(content, lineterminator="\n")
    writer.writerow([*_PLACE, *_OUTCOME, *metrics])
    for cell in cells:
        for run in cell.runs:
            outcome = [run.law, run.status, run.message, run.created, run.file]
            values = [repr(float(run.metric(name))) for name in metrics]
            writer.writerow([*_where(run, cell.family), *outcome, *values])
        for failure in cell.failures:
            status = "not run" if failure.pending else "failed"
            outcome = ["", status, " ".join(failure.reason.split()), "", ""]
            writer.writerow([*_where(failure, cell.family), *outcome, *("" for _ in metrics)])
    return content.getvalue()


def _where(run: ReportedRun | FailedRun, family: str) -> list[object]:
    cell = run.cell
    return [
        *(cell.robot, cell.task, cell.scenario, family),
        *(repr(cell.duration), repr(cell.dt), run.label, run.seed),
    ]
