"""What a report is made of, and what it leaves."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mobman.simulation.record import Record
from mobman.simulation.run_spec import Cell

_INSTANT = re.compile(r"\bt = ([0-9][0-9.eE+-]*) s")


@dataclass(frozen=True)
class ReportedSuite:
    """The suite, as the report's head shows it."""

    name: str
    description: str
    seconds: float | None = None
    """Wall time of the suite (s); None if unknown."""
    workers: int | None = None
    """Processes that worked on it; None if unknown."""
    tuned: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """By label, where its gains are tuned: what of, with what budget, and what came of it."""
    folder: str = "DIR"
    """Of the results, for commands."""


@dataclass(frozen=True)
class ReportedRun:
    """A run with a result: what its file says without its samples, which are read when drawn."""

    label: str
    """The controller's label in the suite, for instance ``"tsm"`` or ``"tsm explicit"``."""
    cell: Cell
    seed: int
    file: str
    """The record's file, relative to the report's folder."""
    law: str
    """The controller's name in the record."""
    status: str
    message: str
    metrics: Mapping[str, float]
    """Of all samples, also where the file keeps fewer."""
    settings: Mapping[str, Any]
    """Gains in force."""
    versions: Mapping[str, str]
    created: str
    """When, ISO 8601."""
    load: Callable[[], Record]
    """Reads the record with its samples; raises RecordError."""
    machine: Mapping[str, str] = field(default_factory=dict)
    """What it was computed on; empty if unknown."""
    acceleration: str = ""
    """How its scenario measures z'; empty if unknown."""
    family: str = ""
    """Of its scenario: what the suite makes several scenarios from; its name if it is alone."""
    gains: Mapping[str, Any] | None = None
    """The gains that the suite gives the controller; None if unknown."""
    command: str = ""
    """The command that shows its replay; none if empty."""
    replay: str = ""
    """The page of its replay, relative to the report's folder; none if empty."""

    @property
    def ok(self) -> bool:
        """Whether it went to its end."""
        return self.status == "ok"

    @property
    def explicit(self) -> bool:
        """Whether its controller is the explicit discretisation of a sliding law."""
        return self.settings.get("discretization") == "explicit"

    @property
    def succeeded(self) -> bool:
        """Whether it was completed and its task error settled."""
        return self.metrics.get("success", 0.0) == 1.0

    @property
    def end(self) -> float:
        """When a run that did not go to its end ended (s); NaN if its message does not say it."""
        # not its last sample: a decimated record may end before
        found = _INSTANT.search(self.message)
        return float(found.group(1)) if found else math.nan

    @property
    def saturation(self) -> float | None:
        """When a limit of its motors first cut a torque (s); None if none did."""
        if not self.metric("saturation_share") > 0.0:
            return None
        return self.metric("saturation_start")

    def metric(self, name: str) -> float:
        """A metric; NaN if the record does not have it."""
        return self.metrics.get(name, math.nan)


@dataclass(frozen=True)
class FailedRun:
    """A run without a result, by a fault of the software or machine, or because it was not done.

    The former counts as failed; of the latter nothing is known.
    """

    label: str
    cell: Cell
    seed: int
    reason: str
    family: str = ""
    """Of its scenario."""
    pending: bool = False
    """Whether it was not done yet, rather than tried in vain."""


@dataclass(frozen=True)
class UnusedFile:
    """A file among the records that is not used, or only in part."""

    file: str
    """Relative to the folder of results."""
    reason: str


@dataclass(frozen=True)
class ReportFiles:
    """Where a report is."""

    html: Path
    markdown: Path
    csv: Path
