"""A share of successes, with an interval."""

from __future__ import annotations

from scipy.stats import binomtest

from mobman.benchmark.statistics.interval import Interval, check_level
from mobman.errors import UsageError


def proportion(successes: int, n: int, *, level: float = 0.95) -> Interval:
    """The share of successes with Wilson's score interval.

    It has a width also where all runs, or none, succeeded.

    Args:
        successes: How many.
        n: Of how many runs.
        level: Confidence level.

    Raises:
        UsageError: If the numbers are not whole, there are no runs, or more successes than runs.
    """
    whole = int(successes) == successes and int(n) == n
    if not whole or n < 1 or not 0 <= successes <= n:
        raise UsageError(
            f"successes, n: found {successes!r} of {n!r}; allowed are whole numbers, n from 1, "
            "successes from 0 to n"
        )
    found = binomtest(int(successes), int(n))
    limits = found.proportion_ci(confidence_level=check_level(level), method="wilson")
    return Interval(float(found.statistic), float(limits.low), float(limits.high))
