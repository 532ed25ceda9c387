"""What a report is made of, and what it leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobman.simulation.record import Record


@dataclass(frozen=True)
class ReportedSuite:
    """The suite, as the report's head shows it."""

    name: str
    description: str
    duration: float
    """Of each run (s)."""
    dt: float
    """Sampling period (s)."""
    seconds: float | None
    """Wall time of the suite (s); None if unknown."""
    workers: int | None
    """Processes that worked on it; None if unknown."""


@dataclass(frozen=True)
class ReportedRun:
    """A run and its place in the suite."""

    label: str
    """The controller's label in the suite, for instance ``"tsm"`` or ``"tsm explicit"``."""
    file: str
    """The record's file, relative to the report's folder."""
    record: Record
    """May be decimated: the figures are drawn from it, the metrics are those of all samples."""
    gains: Mapping[str, Any] | None = None
    """The gains that the suite gives the controller; None if unknown."""
    command: str = ""
    """The command that shows its replay; none if empty."""
    replay: str = ""
    """The page of its replay, relative to the report's folder; none if empty."""

    @property
    def explicit(self) -> bool:
        """Whether its controller is the explicit discretisation of a sliding law."""
        return self.record.settings.get("discretization") == "explicit"

    @property
    def succeeded(self) -> bool:
        """Whether it was completed and its task error settled."""
        return self.record.metrics.get("success", 0.0) == 1.0


@dataclass(frozen=True)
class FailedRun:
    """A run without a result, by a fault of the software rather than of the controller."""

    label: str
    robot: str
    task: str
    scenario: str
    seed: int
    reason: str


@dataclass(frozen=True)
class ReportFiles:
    """Where a report is."""

    html: Path
    markdown: Path
