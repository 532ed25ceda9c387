"""Where a suite's results are: one file a run, what was asked for, and an index."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from mobman.benchmark.index import write_index
from mobman.benchmark.manifest import NAME, Manifest, read_manifest
from mobman.benchmark.suite import Suite
from mobman.errors import MobmanError, RecordError, SpecError
from mobman.files import is_abandoned, write_whole
from mobman.input_file import check_within, read_within
from mobman.simulation.record import Record, RecordSummary, load_record, read_summary
from mobman.simulation.run_spec import RunSpec


@dataclass(frozen=True)
class Failure:
    """A run that gave no result, for a reason outside its controller."""

    run_id: str
    reason: str


class Store:
    """A folder of results.

    ``runs/RUN_ID.h5`` are the records and ``failures/RUN_ID.json`` the runs that gave none, each there
    whole or not at all; ``suite.json`` says what was asked for; ``index.h5`` links the records with a
    table of what they are, and can be rebuilt from these files at any time.

    Args:
        folder: The folder; it need not exist.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self._summaries: dict[Path, tuple[tuple[int, int], RecordSummary]] = {}

    def path(self, run: RunSpec) -> Path:
        """Where a run's record is, or will be."""
        return self.folder / "runs" / f"{run.run_id}.h5"

    def begin(self, suite: Suite, runs: Iterable[RunSpec]) -> None:
        """Note what is asked for, and clear away what a killed run left half-written.

        Raises:
            MobmanError: If the folder holds another suite's results, or cannot be written.
        """
        manifest = Manifest(suite, tuple(runs))
        if (self.folder / NAME).exists():
            before = read_manifest(self.folder)
            if before.suite.name != suite.name:
                raise MobmanError(
                    f"{self.folder} holds results of the suite {before.suite.name!r}, not of "
                    f"{suite.name!r}; choose another folder with -o"
                )
            manifest = replace(manifest, seconds=before.seconds, workers=before.workers)
        try:
            for name in ("runs", "failures"):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
                self._clear(self.folder / name)
            self._clear(self.folder)
            manifest.write(self.folder)
        except OSError as error:
            raise self._cannot_write(error) from error

    def keep(self, run: RunSpec, content: bytes) -> None:
        """Keep a run's record.

        Args:
            run: The run.
            content: Its file's.

        Raises:
            MobmanError: If it cannot be written; nothing half-written is left.
        """
        self._write(self.path(run), content)
        self._failure(run.run_id).unlink(missing_ok=True)

    def fail(self, run: RunSpec, reason: str) -> None:
        """Note that a run gave no result, and why.

        Raises:
            MobmanError: If it cannot be written.
        """
        content = json.dumps({"run_id": run.run_id, "run": str(run), "reason": reason})
        self._write(self._failure(run.run_id), content.encode())

    def finish(self, seconds: float | None = None, workers: int | None = None) -> None:
        """Note how long it took, and rebuild the index.

        Args:
            seconds: How long the runs took that were done now; None if there were none.
            workers: With how many processes.

        Raises:
            MobmanError: If the folder cannot be written.
        """
        if seconds is not None:
            before = read_manifest(self.folder)
            after = replace(before, seconds=seconds + (before.seconds or 0.0), workers=workers)
            try:
                after.write(self.folder)
            except OSError as error:
                raise self._cannot_write(error) from error
        self.rebuild_index()

    @property
    def manifest(self) -> Manifest:
        """What was asked for.

        Raises:
            MobmanError: If the folder holds no results.
        """
        return read_manifest(self.folder)

    @property
    def runs(self) -> tuple[RunSpec, ...]:
        """The runs that were asked for, in the suite's order."""
        return self.manifest.runs

    @property
    def failures(self) -> list[Failure]:
        """The runs without a result, and why."""
        found = []
        for path in sorted((self.folder / "failures").glob("*.json")):
            try:
                content = json.loads(read_within(path, path.parent, "failure", 1.0))
                found.append(Failure(path.stem, str(content["reason"])))
            except MobmanError as error:
                found.append(Failure(path.stem, str(error)))
            except (ValueError, KeyError, TypeError, RecursionError) as error:
                # not its text, which may be that of any file
                found.append(Failure(path.stem, f"{path} is not readable: {type(error).__name__}"))
        return found

    def done(self, run: RunSpec) -> bool:
        """True if a run's record is there, can be read, and is of this run."""
        try:
            self.summary(run)
        except RecordError:
            return False
        return True

    def unreadable(self, runs: Iterable[RunSpec]) -> list[str]:
        """What is wrong with each record that is there and cannot be read."""
        found = []
        for run in runs:
            if os.path.lexists(self.path(run)):
                try:
                    self.summary(run)
                except RecordError as error:
                    found.append(str(error))
        return found

    def strangers(self) -> list[Path]:
        """Files among the records that are of no run that was asked for."""
        own = {self.path(run).name for run in self.runs}
        there = sorted((self.folder / "runs").glob("*"))
        return [path for path in there if path.name not in own and not path.name.startswith(".")]

    def record(self, run: RunSpec) -> Record:
        """A run's record.

        Raises:
            RecordError: If it is not there or cannot be read.
        """
        return load_record(self.path(run))

    def summary(self, run: RunSpec) -> RecordSummary:
        """A run's record without its samples.

        Raises:
            RecordError: If it is not there, cannot be read, or is another run's.
        """
        path = self.path(run)
        summary = self.read(path)
        asked = (run.scenario["name"], run.seed)
        found = (summary.scenario, summary.seed)
        if found != asked:
            raise RecordError(
                f"{path} is another run's record: scenario {found[0]!r} and seed {found[1]}, where the "
                f"suite asks for {asked[0]!r} and {asked[1]}"
            )
        return summary

    def read(self, path: Path) -> RecordSummary:
        """The summary of a file of the folder, whichever run it is of; read again where it changed.

        Raises:
            RecordError: If it is not there, cannot be read, or is a link to elsewhere.
        """
        try:
            check_within(path, path.parent)
            status = path.stat()
        except SpecError as error:
            raise RecordError(str(error)) from error
        except OSError:
            return read_summary(path)  # which says what is wrong
        key = (status.st_mtime_ns, status.st_size)
        kept = self._summaries.get(path)
        if kept is None or kept[0] != key:
            kept = self._summaries[path] = (key, read_summary(path))
        return kept[1]

    def forget(self, runs: Iterable[RunSpec]) -> None:
        """Remove records, so that they are run again; with the last, the time that they took.

        Raises:
            MobmanError: If they cannot be removed.
        """
        try:
            for run in runs:
                self.path(run).unlink(missing_ok=True)
                self._failure(run.run_id).unlink(missing_ok=True)
            if not any(self.path(run).exists() for run in self.runs):
                replace(self.manifest, seconds=None, workers=None).write(self.folder)
        except OSError as error:
            raise self._cannot_write(error) from error

    def rebuild_index(self) -> Path:
        """Rewrite ``index.h5``: a link to every record, and a table of specs and metrics.

        Raises:
            MobmanError: If it cannot be written.
        """
        rows = []
        for run in self.runs:
            try:
                rows.append((run, self.summary(run)))
            except RecordError:
                continue  # not run yet, or among the failures
        return write_index(self.folder / "index.h5", rows)

    def _failure(self, run_id: str) -> Path:
        return self.folder / "failures" / f"{run_id}.json"

    def _write(self, path: Path, content: bytes) -> None:
        try:
            write_whole(path, content)
        except OSError as error:
            raise self._cannot_write(error) from error

    def _cannot_write(self, error: OSError) -> MobmanError:
        return MobmanError(f"cannot write to {self.folder}: {error.strerror or error}")

    @staticmethod
    def _clear(folder: Path) -> None:
        for leftover in folder.glob(".*.tmp"):
            if is_abandoned(leftover):
                leftover.unlink(missing_ok=True)
