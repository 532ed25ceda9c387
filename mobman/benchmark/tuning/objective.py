"""Objectives of tuning: the score of a run; that of a set of gains is the mean over the tuning set."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mobman.registry import Registry

CEILING = 6.0
"""The largest score of a run that was completed; those that were not score between it and twice it."""


@dataclass(frozen=True)
class Objective:
    """A score of a completed run; less is better.

    Scores are decadic logarithms, so that their mean is that of a geometric mean: a factor of two
    counts the same on every robot and in every scenario.
    """

    name: str
    formula: str  # formula in terms of metrics, for reports
    metrics: tuple[str, ...]  # the metrics in it
    function: Callable[[Mapping[str, float]], float]  # the score, of metrics by name

    def score(self, status: str, metrics: Mapping[str, float], fraction: float) -> float:
        """The score of a run.

        Args:
            status: The record's, or another word if there is no record.
            metrics: By name.
            fraction: The part of its duration that the run lasted, 0 to 1.

        Returns:
            At most :data:`CEILING` for a run that was completed, and more than that for any other:
            the more, the earlier it ended.
        """
        if status != "ok":
            return CEILING * (2.0 - min(max(fraction, 0.0), 1.0))
        value = self.function(metrics)
        return min(value, CEILING) if not math.isnan(value) else CEILING


objectives: Registry[Objective] = Registry(
    "tuning objective", "mobman.benchmark.tuning.objectives", "mobman.objectives"
)
