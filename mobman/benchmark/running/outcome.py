"""How runs and suites went, and what is told on the way."""

from __future__ import annotations

from dataclasses import dataclass, field

from mobman.simulation.run_spec import RunSpec


@dataclass(frozen=True)
class Outcome:
    """How one run went."""

    run: RunSpec
    status: str
    """The record's, or ``"failed"`` if there is none."""
    message: str
    task_error: float
    """Its metric task_error_max (m); NaN if there is no record."""


@dataclass
class Summary:
    """How a suite went."""

    asked: int = 0
    skipped: int = 0
    seconds: float = 0.0
    workers: int = 0
    """Runs at a time; on a cluster, the most that there were."""
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def failed(self) -> list[Outcome]:
        """Runs without a result."""
        return [outcome for outcome in self.outcomes if outcome.status == "failed"]


@dataclass(frozen=True)
class Started:
    """The suite begins."""

    asked: int
    skipped: int
    """Runs that were there already."""
    todo: tuple[RunSpec, ...]


@dataclass(frozen=True)
class Running:
    """How many runs are in progress has changed."""

    count: int


@dataclass(frozen=True)
class Ended:
    """A run is done."""

    outcome: Outcome


@dataclass(frozen=True)
class Again:
    """A run is tried once more, for a reason outside its controller."""

    run: RunSpec
    reason: str


@dataclass(frozen=True)
class Waiting:
    """Nothing can go on for now; empty when it does."""

    reason: str


Event = Started | Running | Ended | Again | Waiting
