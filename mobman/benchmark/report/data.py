"""The runs of a suite as one pandas frame, with the cells that they are compared in."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mobman.arrays import Array
from mobman.benchmark.statistics import FLOOR
from mobman.benchmark.store import Store
from mobman.benchmark.suite_tables import TunedFrom
from mobman.display import printable
from mobman.errors import MobmanError, RecordError
from mobman.files import check_within
from mobman.simulation.record import RecordSummary, load_record
from mobman.simulation.run_spec import Cell, RunSpec

NOMINAL = "nominal"
DONE, FAILED, NOT_RUN = "done", "failed", "not run"
WriteReplay = Callable[[Path, Path, float | None], None]
"""Writes a page: given a record's file, the page's, and the instant that it opens at (s), if any."""
_INSTANT = re.compile(r"\bt = ([0-9][0-9.eE+-]*) s")
_CELL = list(Cell._fields)
_DEFAULTS: dict[str, Any] = {
    **dict.fromkeys(("robot", "base", "task", "scenario", "family", "label", "law", "file"), ""),
    "dt": 1e-3,
    "duration": 1.0,
    "placement": 0,
    "seed": 0,
    "state": DONE,
    **dict.fromkeys(("status", "message", "created", "acceleration", "command", "replay"), ""),
    **{name: {} for name in ("gains", "metrics", "settings", "versions", "machine")},
    "load": None,
}
"""Fields of a run. ``state``: done, failed (by a fault of software or machine, with the reason as the
message) or not run yet. ``base``: the same for robots on the same platform, empty if unknown.
``gains``: as the suite gives them."""


@dataclass
class Results:
    """Runs of a suite's folder of results, without their samples."""

    rows: Sequence[Mapping[str, Any]]  # that the suite asks for, in its order: fields by name
    name: str = ""
    description: str = ""
    seconds: float | None = None  # wall time of the suite; None if unknown
    workers: int | None = None  # processes that worked on it; None if unknown
    tuned: Mapping[str, TunedFrom] = field(default_factory=dict)  # by label
    folder: str = "DIR"  # for commands
    unused: dict[str, str] = field(default_factory=dict)  # files not used, or in part, and why

    @cached_property
    def runs(self) -> pd.DataFrame:
        """One row a run, those without a result too, by cell."""
        rows = [{**_DEFAULTS, **row} for row in self.rows]
        runs = pd.DataFrame(rows, columns=list(_DEFAULTS))
        done = runs.state == DONE
        runs["ok"] = done & (runs.status == "ok")
        runs["succeeded"] = done & (self.metric("success") == 1.0)
        error = self.metric("task_error_max")
        runs["error"] = error.where(done & error.notna(), math.inf)
        runs["end"] = [_instant(message) for message in runs.message]
        cut = self.metric("saturation_share") > 0.0
        runs["saturation"] = self.metric("saturation_start").where(cut)
        runs["beyond"] = done & (self.metric("time_beyond_limits") > 0.0)
        runs["explicit"] = [s.get("discretization") == "explicit" for s in runs.settings]
        cells = list(runs[_CELL].itertuples(index=False, name=None))
        numbers = {cell: i for i, cell in enumerate(dict.fromkeys(cells))}
        runs["cell"] = [numbers[cell] for cell in cells]
        order = {cell: i for i, cell in enumerate(self._cells_of(runs).index)}
        return runs.sort_values("cell", key=lambda c: c.map(order), kind="stable")

    @cached_property
    def metrics(self) -> pd.DataFrame:
        """Metrics by name, a row a run; NaN where there is none."""
        found = [dict(row.get("metrics", {})) for row in self.rows]
        return pd.DataFrame(found, index=range(len(found)), dtype=float)

    def metric(self, name: str) -> pd.Series:
        """A metric of each run; NaN where there is none."""
        return self.metrics.reindex(columns=[name])[name]

    @cached_property
    def cells(self) -> pd.DataFrame:
        """One row a cell, by group; with ``group``, ``case`` (the scenario, and what of period and
        duration varies), ``variant`` (the case and its placement), ``name``, ``family`` (of the
        scenario) and ``base`` (the first of the robots on the same platform)."""
        return self._cells_of(self.runs)

    def _cells_of(self, runs: pd.DataFrame) -> pd.DataFrame:
        first = runs.drop_duplicates("cell").sort_values("cell").set_index("cell")
        cells = first[_CELL].copy()
        known = {r: base for r, base in zip(runs.robot, runs.base, strict=True) if base}
        named: dict[str, str] = {}
        cells["base"] = [named.setdefault(known.get(r, r), r) for r in cells.robot]
        families = runs[runs.family != ""].drop_duplicates("cell").set_index("cell").family
        cells["family"] = families.reindex(cells.index).fillna(cells.scenario)
        cells["group"] = [f"{r}, {t}" for r, t in zip(cells.robot, cells.task, strict=True)]
        siblings = cells.groupby(["group", "scenario"], sort=False)

        def told(name: str, words: Callable[[Any], str]) -> pd.Series:
            return cells[name].map(words).where(siblings[name].transform("nunique") > 1, "")

        cells["case"] = cells.scenario + told("dt", lambda dt: f", dt {1e3 * dt:g} ms")
        cells["case"] += told("duration", lambda t: f", {t:g} s")
        cells["variant"] = cells.case + told("placement", lambda n: f", placement {n}")
        cells["name"] = [f"{g}, {v}" for g, v in zip(cells.group, cells.variant, strict=True)]
        # the nominal scenario first, the others as they come; each from the shortest period on
        order = cells[["group", "scenario", "dt", "duration", "placement"]].copy()
        for name in ("group", "scenario"):
            order[name] = pd.factorize(cells[name])[0]
        order.insert(1, "changed", cells.scenario != NOMINAL)
        return cells.loc[order.sort_values(list(order), kind="stable").index]

    @cached_property
    def labels(self) -> list[str]:
        """Labels of all controllers, in the suite's order."""
        return list(dict.fromkeys(row.get("label", "") for row in self.rows))

    @property
    def groups(self) -> list[str]:
        """Names of the groups of cells: robot and task."""
        return list(self.cells.group.unique())

    @property
    def lost(self) -> pd.DataFrame:
        """The runs without a result."""
        return self.runs[self.runs.state != DONE]

    def by_cell(self, values: pd.Series, how: str) -> pd.DataFrame:
        """Aggregate a column of the runs over seeds: cells by labels, NaN where none was asked for."""
        keys = [self.runs.cell, self.runs.label]
        found = values.reindex(self.runs.index).groupby(keys, sort=False).agg(how).unstack()
        return found.reindex(index=self.cells.index, columns=self.labels)

    @cached_property
    def errors(self) -> pd.DataFrame:
        """Scores (m): the worst of the seeds; inf where one has no result or did not go to its end."""
        return self.by_cell(self.runs.error, "max").clip(lower=FLOOR)

    @cached_property
    def solved(self) -> pd.DataFrame:
        """True where all seeds succeeded."""
        return self.by_cell(self.runs.succeeded, "all").eq(True)  # NaN is not

    @cached_property
    def pending(self) -> pd.DataFrame:
        """True where a seed was not run yet, so that nothing is known."""
        return self.by_cell(self.runs.state == NOT_RUN, "any").eq(True)

    @cached_property
    def counts(self) -> dict[str, pd.DataFrame]:
        """Numbers of runs, cells by labels: of all that were asked for, that ended early, that have no
        result, and that went beyond the robot's limits."""
        runs, done = self.runs, self.runs.state == DONE
        kinds = {"asked": done | ~done, "ended": done & ~runs.ok, "lost": ~done}
        kinds["beyond"] = runs.beyond
        return {kind: self.by_cell(values, "sum") for kind, values in kinds.items()}

    def effort(self, metric: str) -> pd.DataFrame:
        """A metric's median over seeds, over the least of its cell; inf where a seed failed."""
        found = self.metric(metric)
        whole = found.where(self.runs.ok & found.notna(), math.inf)
        failed = self.by_cell(whole, "max") == math.inf
        values = self.by_cell(whole, "median").mask(failed, math.inf)
        least = values.where(values > 0.0).min(axis=1)
        return values.div(least, axis=0).where(np.isfinite(values), math.inf).fillna(math.inf)

    def samples(self, row: Any) -> Any:
        """The record of a run; None, and a note in ``unused``, if its samples cannot be read."""
        try:
            return row.load()
        except (RecordError, OSError, RuntimeError, KeyError, ValueError) as error:
            self.unused[row.file] = f"its samples cannot be read: {error}"
            return None


def _instant(message: str) -> float:
    """Find the end of a run (s) in its message: a decimated record may end before."""
    found = _INSTANT.search(message)
    return float(found[1]) if found else math.nan


# A folder ------------------------------------------------------------------------------------------


def read_results(
    store: Store, place: Path | None = None, write_replay: WriteReplay | None = None
) -> Results:
    """Read everything in a folder of results but the samples.

    Files are named from another place than the folder if one is given; for the page of each run, see
    :func:`.report.report_on`.

    Raises:
        MobmanError: If there are no results at all.
    """
    place = place or store.folder
    rows: list[dict[str, Any]] = []
    unused: dict[str, str] = {}
    asked = set()
    for spec, found, reason in store.outcomes():
        path = store.path(spec)
        asked.add(path.name)
        row = _row(spec, _relative(path, place))
        rows.append(row)
        if isinstance(found, RecordError):
            if path.exists():
                unused[_relative(path, store.folder)] = str(found)
            row["state"] = FAILED if reason else NOT_RUN
            row["message"] = reason or "not done yet"
            continue
        row |= _outcome(found, path)
        page = place / "replays" / f"{path.stem}.html"
        check_within(page.parent, place)
        if write_replay is not None:
            try:
                write_replay(path, page, row.pop("instant"))
            except RecordError as error:  # its samples cannot be read, though its metrics can
                unused[_relative(path, store.folder)] = str(error)
        try:  # a page of an earlier record is none
            if page.stat().st_mtime_ns >= path.stat().st_mtime_ns:
                row["replay"] = _relative(page, place)
        except OSError:
            pass
    if not rows:
        raise MobmanError(f"{store.folder} holds no runs")
    unused |= _others(store, asked)
    manifest = store.manifest
    controllers = manifest.suite.controllers.items()
    return Results(
        rows,
        manifest.suite.name,
        manifest.suite.description,
        manifest.seconds,
        manifest.workers,
        tuned={label: entry.tuned for label, entry in controllers if entry.tuned is not None},
        folder=shlex.quote(str(store.folder)),
        unused=unused,
    )


def _row(spec: RunSpec, file: str) -> dict[str, Any]:
    measured = spec.scenario.get("acceleration", "")
    return {
        **spec.cell._asdict(),
        **{name: getattr(spec, name) for name in ("family", "label", "law", "seed", "gains")},
        "file": file,
        "acceleration": str(measured.get("type", "") if isinstance(measured, dict) else measured),
    }


def _outcome(summary: RecordSummary, path: Path) -> dict[str, Any]:
    load = partial(load_record, path)
    instant = None if summary.status == "ok" else _instant(summary.message)
    if instant is not None and math.isnan(instant):
        try:
            times: Array = load().t
            instant = float(times[-1]) if len(times) else None
        except RecordError:
            instant = None
    at = [] if instant is None else ["--time", f"{instant:.6g}"]
    names = ("status", "message", "metrics", "settings", "versions", "created", "machine")
    return {
        **{name: getattr(summary, name) for name in names},
        "base": _base_of(summary.spec.get("robot")),
        "load": load,
        "command": shlex.join(["mobman", "view", str(path), *at]),
        "instant": instant,
    }


def _base_of(robot: Any) -> str:
    """A text that is the same for robots on the same platform, by its type and numbers: what is mounted
    on it may differ, and of one described by a URDF the rest of that. An arm on no platform is alone."""
    platform = robot.get("platform") if isinstance(robot, dict) else None
    if not isinstance(platform, dict) or platform.get("type") == "fixed":
        return ""
    return json.dumps(platform, sort_keys=True, default=str)


def _others(store: Store, asked: set[str]) -> dict[str, str]:
    """Files beside the records that the suite asked for, and why they are not used."""
    found = {}
    for path in sorted((store.folder / "runs").glob("*")):
        if path.name in asked or path.name.startswith("."):  # the latter: being written
            continue
        reason = "not a record: these end in .h5"
        if path.suffix == ".h5":
            try:
                store.read(path)
                reason = "a record that this suite does not ask for"
            except RecordError as error:
                reason = str(error)
        found[_relative(path, store.folder)] = reason
    return found


def _relative(path: Path, folder: Path) -> str:
    """A path as a link from a folder."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on another drive
        return path.resolve().as_posix()


# All runs, for other programs ----------------------------------------------------------------------

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def csv_of(results: Results) -> str:
    """Write the runs as CSV, one a row; those without a result have the status "failed" or "not run".

    Numbers have all digits; ``inf`` and ``nan`` are written so. Texts that a spreadsheet would take
    for a formula have an apostrophe in front.
    """
    runs = results.runs
    done = runs.state == DONE
    table = pd.DataFrame(
        {
            **{name: runs[name] for name in ("robot", "task", "scenario")},
            "family": results.cells.family.reindex(runs.cell).to_numpy(),
            "duration": runs.duration.map(repr),
            "dt": runs.dt.map(repr),
            "placement": runs.placement,
            "controller": runs.label,
            "seed": runs.seed,
            "law": runs.law.where(done, ""),
            "status": runs.status.where(done, runs.state),
            "message": runs.message.where(done, runs.message.str.split().str.join(" ")),
            "created": runs.created,
            "file": runs.file.where(done, ""),
        }
    )
    texts = [name for name in table if name not in ("duration", "dt", "placement", "seed")]
    table[texts] = table[texts].map(_csv_text)
    numbers = results.metrics.reindex(runs.index).map(repr)
    numbers.columns = numbers.columns.map(_csv_text)
    whole = pd.concat([table, numbers.where(done, "")], axis=1)
    return str(whole.to_csv(index=False, lineterminator="\n"))


def _csv_text(text: str) -> str:
    # a carriage return would end the row
    return ("'" if text.startswith(_FORMULA) else "") + printable(text)
