"""One set of gains, and how it went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

from mobman.benchmark.tuning.evaluation import RunScore
from mobman.benchmark.tuning.objective import mean_score


@dataclass(frozen=True)
class Trial:
    """One set of gains of a controller, and its runs."""

    label: str
    number: int
    """0 is the suite's own gains."""
    gains: dict[str, float]
    """Those that are tuned; none in trial 0."""
    runs: tuple[RunScore, ...]
    """In the order of the tuning set."""

    @property
    def score(self) -> float:
        """Less is better."""
        return mean_score([run.score for run in self.runs])

    def as_dict(self) -> dict[str, Any]:
        """As plain values."""
        return {**asdict(self), "runs": [asdict(run) for run in self.runs], "score": self.score}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Self:
        """What :meth:`as_dict` gave.

        Raises:
            KeyError, TypeError: If it is not that.
        """
        return cls(
            fields["label"],
            fields["number"],
            dict(fields["gains"]),
            tuple(RunScore(**run) for run in fields["runs"]),
        )


def best(trials: Sequence[Trial]) -> Trial:
    """The one with the least score; of equals, the first."""
    return min(trials, key=lambda trial: (trial.score, trial.number))
