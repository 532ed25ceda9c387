"""The trials that are done, one a line, so that an interrupted tuning goes on from there."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

from mobman.benchmark.tuning.trial import Trial
from mobman.errors import MobmanError
from mobman.files import temporary_beside

NAME = "trials.jsonl"


class Journal:
    """``FOLDER/trials.jsonl``.

    Args:
        folder: The folder; it need not exist.
        problems: By label, a hash of all that its trials depend on.
        fresh: Begin anew.

    Raises:
        MobmanError: If it holds trials of something else, or cannot be read or written.
    """

    def __init__(self, folder: Path, problems: Mapping[str, str], *, fresh: bool = False) -> None:
        self._path, self._problems = folder / NAME, dict(problems)
        self._trials: dict[tuple[str, int], Trial] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lines = [] if fresh else self._read()
            # anew: what a killed process left of its last line would spoil the next one
            temporary = temporary_beside(self._path)
            temporary.write_text("".join(lines), encoding="utf-8")
            os.replace(temporary, self._path)
        except OSError as error:
            raise MobmanError(f"cannot use {self._path}: {error.strerror}") from error

    def get(self, label: str, number: int) -> Trial | None:
        """A trial, if it is done."""
        return self._trials.get((label, number))

    def add(self, trial: Trial) -> None:
        """Keep a trial, on the disk when this returns.

        Raises:
            MobmanError: If it cannot be written.
        """
        line = {"problem": self._problems[trial.label], **trial.as_dict()}
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise MobmanError(f"cannot write {self._path}: {error.strerror}") from error
        self._trials[trial.label, trial.number] = trial

    def __len__(self) -> int:
        return len(self._trials)

    def _read(self) -> list[str]:
        """The lines that are whole."""
        if not self._path.exists():
            return []
        kept = []
        lines = self._path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
        for number, line in enumerate(lines, 1):
            if not line.endswith("\n"):
                break  # the process was killed in the midst of it
            try:
                fields = json.loads(line)
                problem, trial = fields["problem"], Trial.from_dict(fields)
            except (ValueError, KeyError, TypeError, AttributeError) as error:
                raise MobmanError(
                    f"{self._path}, line {number}, is no trial; choose another folder with -o, or "
                    "begin anew with --fresh"
                ) from error
            if problem != self._problems.get(trial.label, problem):
                raise MobmanError(
                    f"{self._path} holds trials of {trial.label!r} with another tuning set, search "
                    "space, objective, or version of a program; choose another folder with -o, or "
                    "begin anew with --fresh"
                )
            self._trials[trial.label, trial.number] = trial
            kept.append(line)
        return kept
