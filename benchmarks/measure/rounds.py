"""Fair timing on a noisy machine: interleaved repetitions, and medians of what each round says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np

Measure = Callable[[], float]
"""Does its work once (a batch of calls, a run) and returns what one unit of it took (s)."""


@dataclass(frozen=True)
class Spread:
    """A median with its quartiles over the rounds."""

    median: float
    low: float
    """First quartile."""
    high: float
    """Third quartile."""

    @classmethod
    def of(cls, values: np.ndarray) -> Spread:
        """Of one value a round."""
        low, median, high = np.percentile(values, (25, 50, 75))
        return cls(float(median), float(low), float(high))


def interleaved(
    measures: Mapping[str, Measure], rounds: int, warm_up: bool = True
) -> dict[str, np.ndarray]:
    """Run all measures in turn, again and again, so that a slow minute slows them all.

    Each round starts with another one, so that none always follows the same.

    Args:
        measures: By name.
        rounds: How often each counts.
        warm_up: Whether a first round does not count: first calls compile and fill caches.

    Returns:
        What each measure returned, shape (rounds,), by name.
    """
    names = list(measures)
    if warm_up:
        for name in names:
            measures[name]()
    taken = {name: np.empty(rounds) for name in names}
    for turn in range(rounds):
        first = turn % len(names) if names else 0
        for name in names[first:] + names[:first]:
            taken[name][turn] = measures[name]()
    return taken


def batch(call: Callable[[], object], seconds: float) -> Measure:
    """A measure of a short call: as many calls in a row as take about that long (s)."""
    count = 1
    while (taken := _repeated(call, count)) < 0.1 * seconds:
        count *= 4
    count = max(1, round(count * seconds / taken))
    return lambda: _repeated(call, count) / count


def once(call: Callable[[], object], units: int = 1) -> Measure:
    """A measure of a long call that does that many units of work."""
    return lambda: _repeated(call, 1) / units


def ratio(numerator: np.ndarray, denominator: np.ndarray) -> Spread:
    """Of two measures: the quotient of each round, and then its median."""
    return Spread.of(numerator / denominator)


def exponent(sizes: np.ndarray, costs: np.ndarray) -> float:
    """p of cost = c size^p by least squares in the logarithms; NaN if a cost is not above 0."""
    if np.any(np.asarray(costs) <= 0.0):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def _repeated(call: Callable[[], object], count: int) -> float:
    repeat = range(count)
    started = perf_counter()
    for _ in repeat:
        call()
    return perf_counter() - started
