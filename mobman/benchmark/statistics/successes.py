"""Success rates of two labels on the same cells."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binomtest

from mobman.benchmark.statistics.interval import Interval
from mobman.benchmark.statistics.proportions import proportion
from mobman.errors import UsageError


@dataclass(frozen=True)
class SuccessComparison:
    """What the cells say of a's successes against b's; positive: a succeeds more often."""

    n: int
    """Cells."""
    difference: Interval
    """Success rate of a - that of b: the effect, with Newcombe's interval for pairs."""
    p_value: float
    """Of McNemar's exact test, two-sided, for this pair alone: see :func:`adjust`."""
    both: int
    only_a: int
    """Cells in which a succeeds and b does not."""
    only_b: int
    neither: int
    smallest_p: float
    """The p if all cells in which they differ said the same."""


def compare_successes(a: ArrayLike, b: ArrayLike, *, level: float = 0.95) -> SuccessComparison:
    """Compare two labels by success or failure on the same cells.

    Args:
        a: Shape (n,), True or 1 for a success, False or 0 for a failure.
        b: Shape (n,), on the same cells in the same order.
        level: Confidence level of the difference's interval.

    Raises:
        UsageError: If the shapes differ, there are no cells, or a value is neither.
    """
    first, second = _as_successes(a, "a"), _as_successes(b, "b")
    if len(first) != len(second):
        raise UsageError(
            f"a and b: found {len(first)} and {len(second)} values; allowed is one of each for a cell"
        )
    both = int((first & second).sum())
    only_a = int((first & ~second).sum())
    only_b = int((~first & second).sum())
    neither = len(first) - both - only_a - only_b
    differ = only_a + only_b
    return SuccessComparison(
        n=len(first),
        difference=_difference(both, only_a, only_b, neither, level),
        p_value=float(binomtest(only_a, differ).pvalue) if differ else 1.0,
        both=both,
        only_a=only_a,
        only_b=only_b,
        neither=neither,
        smallest_p=min(1.0, 2.0 ** (1 - differ)),
    )


def _as_successes(values: ArrayLike, name: str) -> NDArray[np.bool_]:
    given = np.asarray(values)
    if given.ndim != 1 or given.size == 0 or not np.isin(given, (0, 1)).all():
        raise UsageError(f"{name}: allowed is a list of True or False, one for each cell")
    return given.astype(bool)


def _difference(both: int, only_a: int, only_b: int, neither: int, level: float) -> Interval:
    """The difference of paired rates with the score interval of Newcombe's method 10."""
    n = both + only_a + only_b + neither
    a, b = proportion(both + only_a, n, level=level), proportion(both + only_b, n, level=level)
    # the correlation of the two, less a correction for continuity where it is positive
    excess = float(both * neither - only_a * only_b)
    if excess > 0.0:
        excess = max(excess - n / 2.0, 0.0)
    margins = (both + only_a) * (only_b + neither) * (both + only_b) * (only_a + neither)
    phi = excess / math.sqrt(margins) if margins else 0.0

    def distance(of_a: float, of_b: float) -> float:
        return math.sqrt(max(of_a**2 - 2.0 * phi * of_a * of_b + of_b**2, 0.0))

    estimate = (only_a - only_b) / n
    down = distance(a.estimate - a.low, b.high - b.estimate)
    up = distance(a.high - a.estimate, b.estimate - b.low)
    return Interval(estimate, max(estimate - down, -1.0), min(estimate + up, 1.0))
