"""Several runs side by side: their metrics as a table, their errors and torques as a figure."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mobman.display import Displayed, Shown
from mobman.errors import UsageError
from mobman.files import as_path
from mobman.simulation.record import Record, load_record

if TYPE_CHECKING:
    import pandas as pd

_NAMED_BY = ("controller", "robot", "task", "scenario", "seed")
Run = Record | str | os.PathLike[str]


class Comparison(Displayed):
    """Runs side by side, see :func:`compare`; ``records`` has the records by label."""

    def __init__(self, records: Mapping[str, Record]) -> None:
        self.records = dict(records)

    @property
    def table(self) -> pd.DataFrame:
        """A frame of a row a run, by label: robot, task, scenario, controller, seed, status, and every
        metric by its name (units as ``mobman metrics`` lists them)."""
        import pandas as pd

        rows = [
            {name: getattr(record, name) for name in (*_NAMED_BY, "status")} | record.metrics
            for record in self.records.values()
        ]
        return pd.DataFrame(rows, index=list(self.records))

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Draw the norms of errors and torques of all runs against time: into a file, whose path is
        given back, or a chart of Altair; argument and errors are those of :meth:`mobman.Record.plot`."""
        from mobman.figures import charts, files
        from mobman.figures.looks import looks_of

        records = self.records
        laws = {label: str(r.spec.get("law") or r.controller) for label, r in records.items()}
        looks, title = looks_of(laws), " · ".join(records)
        duration = max(float(record.t[-1]) for record in records.values()) or 1.0
        specs: list[charts.Spec] = []
        names = {"|eᵉ|  (m)": "task_error", "|eᵃ|": "auxiliary_error", "|v|": "torque"}
        for axis, name in names.items():
            curves = []
            for label, record in records.items():
                end = math.nan if record.ok else float(record.t[-1])
                curves.append(charts.norm_curve(label, record.t, getattr(record, name), end))
            heading, text = "" if specs else title, f"{axis} against time: {title}"
            options: dict[str, Any] = {"title": text, "axis": axis, "heading": heading}
            specs.append(charts.time_chart(curves, looks, duration=duration, **options))
        if path is None:
            return files.displayed(specs)
        return files.save(as_path("path", path), specs, title)

    def _shown(self) -> Shown:
        return Shown(f"Comparison({', '.join(self.records)})", {})

    def _repr_html_(self) -> str:
        return str(self.table.T.to_html(float_format="{:.4g}".format, escape=True))


def compare(runs: Sequence[Run] | Mapping[str, Run]) -> Comparison:
    """Compare runs: a table and a figure.

    >>> import mobman as mm
    >>> laws = ["pseudo-inverse", "damped-least-squares"]
    >>> both = mm.compare([mm.simulate("youbot", law, "paper", duration=0.05) for law in laws])
    >>> both.table.index.tolist(), bool((both.table["task_error_final"] > 3).all())
    (['pseudo-inverse', 'damped-least-squares'], True)
    >>> both.plot("both.svg").name
    'both.svg'

    Args:
        runs: Records or their files; a dictionary gives them labels, which are otherwise what the runs
            differ in (controller, robot, task, scenario, seed).

    Raises:
        UsageError: If there is no run, or one is neither a record nor a path.
        RecordError: If a file is not a record.
    """
    if isinstance(runs, (Record, str, os.PathLike)) or not isinstance(runs, (Sequence, Mapping)):
        raise UsageError(f"runs = {runs!r}: expected a list or a dictionary of records or files")
    if not runs:
        raise UsageError("runs is empty: expected at least one record")
    records = [_record(run) for run in (runs.values() if isinstance(runs, Mapping) else runs)]
    labels = list(map(str, runs)) if isinstance(runs, Mapping) else _labels(records)
    return Comparison(dict(zip(labels, records, strict=True)))


def _record(run: Run) -> Record:
    if isinstance(run, (str, os.PathLike)):
        return load_record(run)
    if not isinstance(run, Record):
        raise UsageError(f"{run!r} is not a run: expected a record or the path of its file")
    return run


def _labels(records: Sequence[Record]) -> list[str]:
    """Labels of what the runs differ in, numbered where that is nothing."""
    parts = [name for name in _NAMED_BY if len({getattr(r, name) for r in records}) > 1]
    names = [
        " · ".join(
            f"seed {r.seed}" if p == "seed" else getattr(r, p) for p in parts or ["controller"]
        )
        for r in records
    ]
    return [
        f"{name} ({names[: i + 1].count(name)})" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]
