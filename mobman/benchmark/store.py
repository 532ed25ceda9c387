"""Folders of results: one file a run, a manifest, and an index."""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np

from mobman.benchmark.suite import Suite
from mobman.errors import MobmanError, RecordError, SpecError
from mobman.files import as_path, check_within, is_abandoned, read_within, sync_folder, write_whole
from mobman.provenance import COMPUTING, versions
from mobman.simulation.record import Record, RecordSummary, load_record, read_summary
from mobman.simulation.run_spec import RunSpec

SCHEMA_VERSION = 3
EARLIER = (2,)  # schemas that are read and shown, and not added to
_MANIFEST = "suite.json"
_MEGABYTES = 200.0  # 10,000 runs take some 5 MB
_ADVICE = (
    "Run the suite again, into another folder, or into this one without that file: runs that are there "
    "and still fit are used"
)
_SHARED = ("gains", "settings", "task_given", "task_parameters", "scenario")
_OF_RUNS = ("run_id", "label", "robot", "task", "family")  # texts of the index
_OF_RECORDS = ("status", "message", "state_sha256")
_COMPARED = ("law", "seed", "dt", "duration", "task_parameters", "scenario", "monitor")


@dataclass(frozen=True)
class Manifest:
    """``suite.json``: the runs of a suite, the time that they took, and the hashes of their records."""

    suite: Suite
    runs: tuple[RunSpec, ...]  # in the suite's order
    seconds: float | None = None  # time that its runs took altogether (s); None if none was done
    workers: int | None = None  # number of workers of the last call
    hashes: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of records' files, by run id; of those that were done when a call ended."""
    schema_version: int = SCHEMA_VERSION

    def write(self, folder: Path) -> None:
        """
        Raises:
            OSError: If it cannot be written; one that is there is left as it was.
        """
        shared: dict[str, int] = {}  # tables that thousands of runs have in common, each once

        def place(table: dict[str, Any]) -> int:
            return shared.setdefault(json.dumps(table, sort_keys=True, default=str), len(shared))

        runs = [
            {
                k: place(value) if isinstance(value, dict) else value
                for k, value in run.as_dict().items()
            }
            for run in self.runs
        ]
        content = {
            "schema_version": SCHEMA_VERSION,
            "suite": self.suite.model_dump(mode="json", by_alias=True),
            "seconds": self.seconds,
            "workers": self.workers,
            "runs": runs,
            "shared": [json.loads(text) for text in shared],
            "records": dict(self.hashes),
        }
        write_whole(folder / _MANIFEST, json.dumps(content).encode())

    @classmethod
    def read(cls, folder: Path) -> Self:
        """The manifest of a folder.

        Raises:
            MobmanError: If there is none, or it is not whole, or of another schema.
        """
        path = folder / _MANIFEST
        try:
            if folder.exists() and not folder.is_dir():
                raise MobmanError(f"{folder} is not a folder of results: it is a file")
            if not os.path.lexists(path):
                raise MobmanError(f"{folder} holds no results: there is no {_MANIFEST}")
            content = json.loads(read_within(path, folder, "manifest", _MEGABYTES))
        except OSError as error:
            raise MobmanError(f"cannot read {path}: {error.strerror or error}") from error
        except SpecError as error:
            raise MobmanError(str(error)) from error
        except (ValueError, RecursionError) as error:
            raise MobmanError(f"cannot read {path}: it is not JSON ({error}). {_ADVICE}") from error
        version = content.get("schema_version") if isinstance(content, dict) else None
        if version not in (*EARLIER, SCHEMA_VERSION):
            this = f"this mobman reads version {SCHEMA_VERSION}"
            raise MobmanError(f"{path} has schema version {version}; {this}. {_ADVICE}")
        try:
            parts = content["shared"]
            runs = [
                RunSpec.of_fields({k: parts[v] if k in _SHARED else v for k, v in run.items()})
                for run in content["runs"]
            ]
            suite = Suite.model_validate(content["suite"])
            seconds, workers = content["seconds"], content["workers"]
            for name, value in (("seconds", seconds), ("workers", workers)):
                if value is not None and not (type(value) in (int, float) and 0 <= value < 1e12):
                    raise ValueError(f"{name} is {value!r}")
            hashes = {str(key): str(value) for key, value in content.get("records", {}).items()}
            return cls(suite, tuple(runs), seconds, workers, hashes, version)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, MobmanError) as error:
            raise MobmanError(
                f"{path} is not whole ({type(error).__name__}: {error}). {_ADVICE}"
            ) from error


class Store:
    """A folder of results.

    ``runs/RUN_ID.h5`` are the records and ``failures/RUN_ID.json`` the runs that gave none, each there
    whole or not at all; ``suite.json`` has the runs and the hashes of their records; ``index.h5`` links
    the records with a table of specs and metrics, and can be rebuilt from these files at any time. What
    cannot be written is a MobmanError.

    Args:
        folder: The folder; it need not exist.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = as_path("folder", folder)
        self._summaries: dict[Path, tuple[tuple[int, int], RecordSummary]] = {}
        self._hashes: dict[str, str] | None = None

    def path(self, run: RunSpec) -> Path:
        """The file of a run's record, which need not be there."""
        return self.folder / "runs" / f"{run.run_id}.h5"

    def begin(self, suite: Suite, runs: Iterable[RunSpec]) -> None:
        """Note the runs of a suite, and clear away what a killed run left half-written.

        Raises:
            MobmanError: If the folder holds another suite's results, or those of an earlier mobman, or
                cannot be written.
        """
        manifest = Manifest(suite, tuple(runs))
        if self.exists:
            before = self.manifest
            if before.schema_version != SCHEMA_VERSION:
                raise MobmanError(
                    f"{self.folder} holds results made by an earlier mobman (schema "
                    f"{before.schema_version}): they can be reported and viewed, but new runs are not "
                    "added to them; choose another folder with -o"
                )
            if before.suite.name != suite.name:
                raise MobmanError(
                    f"{self.folder} holds results of the suite {before.suite.name!r}, not of "
                    f"{suite.name!r}; choose another folder with -o"
                )
            manifest = replace(before, suite=suite, runs=manifest.runs)
        with self._writing():
            for name in ("runs", "failures"):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
            for name in ("runs", "failures", "figures", "."):
                for leftover in filter(is_abandoned, (self.folder / name).glob(".*.tmp")):
                    leftover.unlink(missing_ok=True)
            self.write(manifest)
            sync_folder(self.folder.absolute().parent)

    def keep(self, run: RunSpec, content: bytes) -> None:
        """Keep the content of a run's record.

        Raises:
            RecordError: If it is not a record, or another run's.
            MobmanError: If it cannot be written; nothing half-written is left.
        """
        path, found = self.path(run), []

        def check(temporary: Path) -> None:
            found.append(read_summary(temporary))
            require_record_of(run, found[0], path)

        with self._writing():
            write_whole(path, content, check)
            self._failure(run.run_id).unlink(missing_ok=True)
        self._known_hashes[run.run_id] = hashlib.sha256(content).hexdigest()
        self._summaries[path] = (_state(path), found[0])

    def fail(self, run: RunSpec, reason: str) -> None:
        """Note that a run gave no result, and why."""
        content = json.dumps({"run_id": run.run_id, "run": str(run), "reason": reason})
        with self._writing():
            write_whole(self._failure(run.run_id), content.encode())

    def finish(self, seconds: float | None = None, workers: int | None = None) -> None:
        """Note the hashes of the records and, if runs were done now, the time that they took (s) and the
        number of workers; and rebuild the index."""
        after = replace(self.manifest, hashes=dict(self._known_hashes))
        if seconds is not None:
            after = replace(after, seconds=seconds + (after.seconds or 0.0), workers=workers)
        self.write(after)
        self.rebuild_index()

    @property
    def exists(self) -> bool:
        """True if the folder holds results."""
        return (self.folder / _MANIFEST).exists()

    @property
    def manifest(self) -> Manifest:
        """The manifest of the folder; a MobmanError if it holds no results."""
        return Manifest.read(self.folder)

    @property
    def runs(self) -> tuple[RunSpec, ...]:
        """The runs of the suite, in its order."""
        return self.manifest.runs

    @property
    def failures(self) -> dict[str, str]:
        """The reasons of runs that gave no result, which lie outside their controllers, by run id."""
        found = {}
        for path in sorted((self.folder / "failures").glob("*.json")):
            try:
                content = json.loads(read_within(path, path.parent, "failure", 1.0))
                found[path.stem] = str(content["reason"])
            except MobmanError as error:
                found[path.stem] = str(error)
            except (ValueError, KeyError, TypeError, RecursionError) as error:
                # not its text, which may be that of any file
                found[path.stem] = f"{path} is not readable: {type(error).__name__}"
        return found

    def done(self, run: RunSpec) -> bool:
        """True if a run's record is there, whole, and of this run."""
        try:
            self.summary(run)
        except RecordError:
            return False
        return True

    def changed(self, run: RunSpec) -> str:
        """Differences in what made a run's record and what would make it now: libraries, and mobman's
        own source files; empty if there are none."""
        then, now = self.summary(run).versions, versions()
        return ", ".join(
            f"{name} {then.get(name, 'unknown')} then, {now[name]} now"
            for name in COMPUTING
            if then.get(name) != now[name]
        )

    def record(self, run: RunSpec) -> Record:
        """A run's record; a RecordError if it is not there or cannot be read."""
        return load_record(self.path(run))

    def summary(self, run: RunSpec) -> RecordSummary:
        """A run's record without its samples; errors as those of :meth:`read`."""
        return self.read(self.path(run), run)

    def read(self, path: Path, run: RunSpec | None = None) -> RecordSummary:
        """The summary of a file of the folder, of whichever run by default; read again where it changed.

        Its samples are read, too, or where the manifest has its hash, compared with that.

        Raises:
            RecordError: If it is not there, is damaged, is another run's, or is a link to elsewhere.
        """
        try:
            check_within(path, path.parent)
            state = _state(path)
        except SpecError as error:
            raise RecordError(str(error)) from error
        except OSError:
            return read_summary(path)  # which says what is wrong
        kept, summary = self._summaries.get(path, (None, None))
        if summary is None or kept != state:
            kept, summary = None, read_summary(path)
        if run is not None:
            require_record_of(run, summary, path)
        if kept is None:
            if path.stem not in self._known_hashes:
                load_record(path)
                self._known_hashes[path.stem] = _hash(path)
            elif self._known_hashes[path.stem] != _hash(path):
                raise RecordError(f"{path} is damaged: its content is not what was written")
            self._summaries[path] = (state, summary)
        return summary

    def outcomes(self) -> Iterator[tuple[RunSpec, RecordSummary | RecordError, str]]:
        """Yield every run of the suite, its record's summary or what is wrong with it, and why there is
        none: empty where the run is done, or is not done yet."""
        reasons = self.failures
        for run in self.runs:
            try:
                yield run, self.summary(run), ""
            except RecordError as error:
                there = os.path.lexists(self.path(run))
                yield run, error, reasons.get(run.run_id) or (str(error) if there else "")

    def forget(self, runs: Iterable[RunSpec]) -> None:
        """Remove records, so that they are run again; with the last, the time that they took."""
        with self._writing():
            for run in runs:
                self.path(run).unlink(missing_ok=True)
                self._failure(run.run_id).unlink(missing_ok=True)
                self._known_hashes.pop(run.run_id, None)
        if not any(self.path(run).exists() for run in self.runs):
            self.write(replace(self.manifest, seconds=None, workers=None))

    def rebuild_index(self) -> Path:
        """Write ``index.h5`` again: a link to every record, and a table of specs and metrics."""
        rows = [
            (run, found) for run, found, _ in self.outcomes() if isinstance(found, RecordSummary)
        ]
        path = self.folder / "index.h5"
        with self._writing():
            write_whole(path, _index(rows))
        return path

    @property
    def _known_hashes(self) -> dict[str, str]:
        if self._hashes is None:
            self._hashes = dict(self.manifest.hashes) if self.exists else {}
        return self._hashes

    def _failure(self, run_id: str) -> Path:
        return self.folder / "failures" / f"{run_id}.json"

    def write(self, manifest: Manifest) -> None:
        """Write the manifest."""
        with self._writing():
            manifest.write(self.folder)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            words = error.strerror or error
            raise MobmanError(f"cannot write to {self.folder}: {words}") from error


def require_record_of(run: RunSpec, summary: RecordSummary, path: Path) -> None:
    """
    Raises:
        RecordError: If a record is another run's, by what it says of the run.
    """
    found, asked = dict(summary.spec), run.as_dict()
    # a law of one's own may report other settings than its gains; None and "auto" become numbers
    given = {name: value for name, value in run.settings.items() if value not in (None, "auto")}
    asked["gains"], gains = given, found.get("gains") or {}
    if isinstance(gains, dict):
        found["gains"] = {name: gains[name] for name in gains.keys() & given.keys()}
        asked["gains"] = {name: given[name] for name in gains.keys() & given.keys()}
    for name in (*_COMPARED, "gains"):
        there, here = (json.dumps(d.get(name), sort_keys=True, default=str) for d in (found, asked))
        if there != here:
            raise RecordError(
                f"{path} is another run's record: its {name.replace('_', ' ')} is {there[:80]}, where "
                f"the suite asks for {here[:80]}"
            )


def _state(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _index(rows: Sequence[tuple[RunSpec, RecordSummary]]) -> bytes:
    """Content of the index of runs and their records, which are in the folder ``runs`` next to it."""
    runs, records = [run for run, _ in rows], [record for _, record in rows]
    texts = {name: [getattr(run, name) for run in runs] for name in _OF_RUNS}
    texts |= {name: [getattr(record, name) for record in records] for name in _OF_RECORDS}
    texts["scenario"] = [run.scenario["name"] for run in runs]
    specs = (run.as_dict() for run in runs)
    texts["spec_json"] = [json.dumps(spec, sort_keys=True, default=str) for spec in specs]
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION
        links, table = file.create_group("runs"), file.create_group("table")
        for run in runs:
            links[run.run_id] = h5py.ExternalLink(f"runs/{run.run_id}.h5", "/")
        for name, values in texts.items():
            table.create_dataset(name, data=values, dtype=h5py.string_dtype())
        for name, kind in {"placement": int, "seed": int, "dt": float, "duration": float}.items():
            table[name] = np.array([getattr(run, name) for run in runs], dtype=kind)
        metrics = table.create_group("metrics")
        for name in sorted({name for record in records for name in record.metrics}):
            metrics[name] = np.array([record.metrics.get(name, np.nan) for record in records])
    return content.getvalue()
