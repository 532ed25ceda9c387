"""An estimate and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval; each may be inf where runs failed."""

    estimate: float
    low: float
    high: float


def percentile_limits(estimates: Array, level: float) -> tuple[Array, Array]:
    """The percentile bootstrap's limits: the central share ``level`` of the resamples' estimates.

    Args:
        estimates: One for each resample along the first axis; may be inf.
        level: Confidence level, in (0, 1).

    Each limit is a resample's estimate, the outer neighbour of the quantile: between a number and inf
    there is nothing to interpolate.
    """
    tail = (1.0 - level) / 2.0 * (len(estimates) - 1)
    ordered = np.sort(estimates, axis=0)
    return ordered[int(np.floor(tail))], ordered[-1 - int(np.floor(tail))]


def check_level(level: float) -> float:
    """The confidence level, if it can be one.

    Raises:
        UsageError: If it is not in (0, 1).
    """
    if not 0.0 < level < 1.0:
        raise UsageError(f"level: found {level!r}; allowed are confidence levels between 0 and 1")
    return float(level)
