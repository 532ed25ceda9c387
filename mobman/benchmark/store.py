"""Where a suite's results are: one file a run, what was asked for, and an index."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mobman.benchmark.suite import RunSpec, Suite
from mobman.errors import MobmanError, RecordError
from mobman.simulation.record import Record, load_record
from mobman.simulation.record_file import RecordSummary, read_summary
from mobman.simulation.temporary import is_abandoned, temporary_beside

_SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Failure:
    """A run that gave no result, for a reason outside its controller."""

    run_id: str
    reason: str


class Store:
    """A folder of results.

    ``runs/RUN_ID.h5`` are the records, each there whole or not at all; ``suite.json`` says what was
    asked for; ``index.h5`` links the records with a table of what they are, and can be rebuilt from
    these files at any time.

    Args:
        folder: The folder; it need not exist.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)

    def path(self, run: RunSpec) -> Path:
        """Where a run's record is, or will be."""
        return self.folder / "runs" / f"{run.run_id}.h5"

    def begin(self, suite: Suite, runs: Iterable[RunSpec]) -> None:
        """Note what is asked for, and clear away what a killed run left half-written.

        Raises:
            MobmanError: If the folder holds another suite's results, or cannot be written.
        """
        try:
            self._begin(suite, runs)
        except OSError as error:
            raise MobmanError(f"cannot write to {self.folder}: {error.strerror}") from error

    def _begin(self, suite: Suite, runs: Iterable[RunSpec]) -> None:
        seconds = workers = None
        if (self.folder / "suite.json").exists():
            content = self._content()
            seconds, workers = content.get("seconds"), content.get("workers")
            other = content["suite"]["name"]
            if other != suite.name:
                raise MobmanError(
                    f"{self.folder} holds results of the suite {other!r}, not of {suite.name!r}; "
                    "choose another folder with -o"
                )
        (self.folder / "runs").mkdir(parents=True, exist_ok=True)
        for leftover in (*self.folder.glob(".*.tmp"), *(self.folder / "runs").glob(".*.tmp")):
            if is_abandoned(leftover):
                leftover.unlink(missing_ok=True)
        self._write(
            {
                "schema_version": _SCHEMA_VERSION,
                "suite": suite.model_dump(mode="json", by_alias=True),
                "runs": {run.run_id: asdict(run) for run in runs},
                "failures": {},
                "seconds": seconds,
                "workers": workers,
            }
        )

    def finish(
        self, failures: Iterable[Failure], seconds: float | None = None, workers: int | None = None
    ) -> None:
        """Note how the suite went, and rebuild the index.

        Args:
            failures: Runs without a result.
            seconds: How long the runs took that were done now; None if there were none.
            workers: With how many processes.
        """
        content = self._content()
        content["failures"] = {failure.run_id: failure.reason for failure in failures}
        if seconds is not None:
            content["seconds"] = seconds + (content.get("seconds") or 0.0)
            content["workers"] = workers
        content["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
        self._write(content)
        self.rebuild_index()

    @property
    def suite(self) -> Suite:
        """The suite whose results these are.

        Raises:
            MobmanError: If the folder holds no results.
        """
        return Suite.model_validate(self._content()["suite"])

    @property
    def timing(self) -> tuple[float | None, int | None]:
        """How long the runs took altogether (s), and with how many workers at last."""
        content = self._content()
        return content.get("seconds"), content.get("workers")

    @property
    def runs(self) -> list[RunSpec]:
        """The runs that were asked for, in the suite's order."""
        return [RunSpec(**fields) for fields in self._content()["runs"].values()]

    @property
    def failures(self) -> list[Failure]:
        """The runs without a result, and why."""
        return [Failure(*item) for item in self._content()["failures"].items()]

    def done(self, run: RunSpec) -> bool:
        """Whether a run's record is there and can be read."""
        try:
            read_summary(self.path(run))
        except RecordError:
            return False
        return True

    def record(self, run: RunSpec) -> Record:
        """A run's record.

        Raises:
            RecordError: If it is not there or cannot be read.
        """
        return load_record(self.path(run))

    def rebuild_index(self) -> Path:
        """Write ``index.h5`` anew: a link to every record, and a table of specs and metrics."""
        index = self.folder / "index.h5"
        temporary = temporary_beside(index)
        rows = []
        for run in self.runs:
            try:
                rows.append((run, read_summary(self.path(run))))
            except RecordError:
                continue  # not run yet, or among the failures
        try:
            with h5py.File(temporary, "w") as file:
                _fill_index(file, rows)
            os.replace(temporary, index)
        except OSError as error:
            raise MobmanError(f"cannot write {index}: {error}") from error
        finally:
            temporary.unlink(missing_ok=True)
        return index

    def _content(self) -> dict[str, Any]:
        path = self.folder / "suite.json"
        try:
            content: dict[str, Any] = json.loads(path.read_text())
        except FileNotFoundError as error:
            raise MobmanError(f"{self.folder} holds no results: there is no {path.name}") from error
        except (OSError, json.JSONDecodeError) as error:
            raise MobmanError(f"cannot read {path}: {error}") from error
        version = content.get("schema_version") if isinstance(content, dict) else None
        if version != _SCHEMA_VERSION:
            raise MobmanError(
                f"{path} has schema version {version}; this mobman reads version {_SCHEMA_VERSION}"
            )
        try:
            Suite.model_validate(content["suite"])
            [RunSpec(**fields) for fields in content["runs"].values()]
            dict(content["failures"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise MobmanError(f"{path} is not whole: {error!r}") from error
        return content

    def _write(self, content: dict[str, Any]) -> None:
        path = self.folder / "suite.json"
        temporary = temporary_beside(path)
        try:
            temporary.write_text(json.dumps(content, indent=1))
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def _fill_index(file: h5py.File, rows: list[tuple[RunSpec, RecordSummary]]) -> None:
    file.attrs["schema_version"] = _SCHEMA_VERSION
    links = file.create_group("runs")
    table = file.create_group("table")
    text = h5py.string_dtype()
    for run, _ in rows:
        links[run.run_id] = h5py.ExternalLink(f"runs/{run.run_id}.h5", "/")
    columns: dict[str, list[str]] = {
        "run_id": [run.run_id for run, _ in rows],
        "label": [run.label for run, _ in rows],
        "robot": [run.robot for run, _ in rows],
        "task": [run.task for run, _ in rows],
        "scenario": [record.scenario for _, record in rows],
        "status": [record.status for _, record in rows],
        "message": [record.message for _, record in rows],
        "spec_json": [json.dumps(asdict(run), sort_keys=True) for run, _ in rows],
    }
    for name, values in columns.items():
        table.create_dataset(name, data=values, dtype=text)
    table.create_dataset("seed", data=np.array([run.seed for run, _ in rows], dtype=int))
    metrics = table.create_group("metrics")
    for name in sorted({name for _, record in rows for name in record.metrics}):
        metrics.create_dataset(
            name, data=[record.metrics.get(name, np.nan) for _, record in rows], dtype=float
        )
