"""All runs with all metrics, as a table for other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from mobman.benchmark.report.cells import Group, unique
from mobman.benchmark.report.content import FailedRun, ReportedRun
from mobman.printable import printable

_PLACE = ("robot", "task", "scenario", "family", "duration", "dt", "controller", "seed")
_OUTCOME = ("law", "status", "message", "created", "file")
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def run_list(groups: Sequence[Group]) -> str:
    """The runs as CSV, one a row; those without a result have the status "failed" or "not run".

    Numbers have all digits; ``inf`` and ``nan`` are written so. Texts that a spreadsheet would take for
    a formula have an apostrophe in front.
    """
    cells = [cell for group in groups for cell in group.cells]
    metrics = unique([name for cell in cells for run in cell.runs for name in run.metrics])
    content = io.StringIO()
    writer = csv.writer(content, lineterminator="\n")
    writer.writerow([*_PLACE, *_OUTCOME, *map(_text, metrics)])
    for cell in cells:
        for run in cell.runs:
            outcome = [*map(_text, (run.law, run.status, run.message, run.created, run.file))]
            values = [repr(float(run.metric(name))) for name in metrics]
            writer.writerow([*_where(run, cell.family), *outcome, *values])
        for failure in cell.failures:
            status = "not run" if failure.pending else "failed"
            outcome = ["", status, _text(" ".join(failure.reason.split())), "", ""]
            writer.writerow([*_where(failure, cell.family), *outcome, *("" for _ in metrics)])
    return content.getvalue()


def _where(run: ReportedRun | FailedRun, family: str) -> list[object]:
    cell = run.cell
    return [
        *map(_text, (cell.robot, cell.task, cell.scenario, family)),
        *(repr(cell.duration), repr(cell.dt), _text(run.label), run.seed),
    ]


def _text(text: str) -> str:
    # the csv module does not quote a carriage return, which would end the row
    return ("'" if text.startswith(_FORMULA) else "") + printable(text)
