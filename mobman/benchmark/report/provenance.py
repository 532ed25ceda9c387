"""What made the results: versions, and the machine."""

from __future__ import annotations

import os
import platform
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from mobman.benchmark.report.content import ReportedRun
from mobman.benchmark.report.format import UNDEFINED, count
from mobman.benchmark.report.table import Entry, Row, Table, text
from mobman.provenance import machine

UNKNOWN = "unknown"
_FACTS = ("processor", "architecture", "system")


@dataclass(frozen=True)
class Versions:
    """Of everything whose numbers are in the runs."""

    table: Table
    warning: str
    """Says where runs of different versions are mixed; empty if none are."""


def versions_of(runs: Sequence[ReportedRun]) -> Versions:
    """The versions in the runs' records."""
    known = {name for run in runs for name in run.versions}
    first = {"mobman", "python"} & known
    names = sorted(first) + sorted(known - first)
    rows, mixed = [], []
    for name in names:
        found = Counter(run.versions.get(name, UNKNOWN) for run in runs)
        different = list(found)
        if len(different) > 1:
            mixed.append(name)
            shown = ", ".join(f"{v} ({count(n, 'run')})" for v, n in found.items())
        else:
            shown = different[0]
        rows.append(Row(text(name), [text(shown, "bad" if len(different) > 1 else "")]))
    warning = (
        f"Runs of different versions are mixed ({', '.join(mixed)}): they are not strictly comparable. "
        "Run the suite anew to have one."
        if mixed
        else ""
    )
    return Versions(Table("Versions", [text("of"), text("version")], rows), warning)


def machines_table(runs: Sequence[ReportedRun]) -> Table:
    """The machines that the runs were computed on, as their records say it."""
    counts = Counter(tuple(run.machine.get(name) or UNKNOWN for name in _FACTS) for run in runs)
    rows = [
        Row(text(facts[0]), [*(text(fact) for fact in facts[1:]), Entry(str(n))])
        for facts, n in counts.most_common()
    ]
    columns = [*(text(name) for name in _FACTS), Entry("runs")]
    return Table("Machines that the runs were computed on", columns, rows)


def machine_table() -> Table:
    """The machine that writes the report."""
    facts = {
        "processor": machine()["processor"] or UNDEFINED,
        "architecture": platform.machine() or UNDEFINED,
        "logical cores": str(os.cpu_count() or UNDEFINED),
        "system": f"{platform.system()} {platform.release()}".strip() or UNDEFINED,
    }
    rows = [Row(text(name), [text(value)]) for name, value in facts.items()]
    return Table("Machine that wrote this report", [text("of"), text("value")], rows)
