"""Weighted means of ordered values: the median and the interquartile mean, of many resamples at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import UsageError

Weight = Callable[[Index, int], Array]
"""The weight of the ``count`` lowest of n values together, from 0 to 1."""
Statistic = Literal["interquartile_mean", "median"]


def _median(count: Index, n: int) -> Array:
    middle = 1 if n % 2 else 2  # how many values are in the middle
    return np.clip((count - (n - middle) / 2) / middle, 0.0, 1.0)


def _interquartile_mean(count: Index, n: int) -> Array:
    return np.clip(2.0 * count / n - 0.5, 0.0, 1.0)


WEIGHTS: dict[str, Weight] = {"interquartile_mean": _interquartile_mean, "median": _median}


def weight_of(statistic: str) -> Weight:
    """The weights of a statistic.

    Raises:
        UsageError: If there is none of that name.
    """
    if statistic not in WEIGHTS:
        allowed = " and ".join(map(repr, WEIGHTS))
        raise UsageError(f"statistic: found {statistic!r}; allowed are {allowed}")
    return WEIGHTS[statistic]


def l_estimates(values: Array, counts: Index, weight: Weight) -> Array:
    """The estimate of each resample.

    Args:
        values: Shape (n,), ascending; may have inf at the end, and -inf at the beginning.
        counts: Shape (resamples, n): how often each value is drawn, n draws together.
        weight: Of the statistic.

    Returns:
        Shape (resamples,). Infinite if an infinite value has weight; values of both signs cancel (the
        two middle differences, one a failure of each side, have the middle 0).
    """
    n = len(values)
    below, above = np.isneginf(values).sum(), n - np.isposinf(values).sum()
    lowest = np.zeros((len(counts), 1))
    weights = np.concatenate((lowest, weight(counts.cumsum(axis=1), n)), axis=1)
    finite = values[below:above]
    estimates = np.zeros(len(counts))
    if finite.size:
        # not a matrix product: its bits depend on the number of BLAS's threads
        shares = np.diff(weights[:, below : above + 1], axis=1)
        # weights add up to 1 but for rounding: the mean of equal values is the value
        estimates = np.clip(np.einsum("ij,j->i", shares, finite), finite[0], finite[-1])
    failed, failed_other = weights[:, above] < 1.0, weights[:, below] > 0.0
    estimates[failed] = np.inf
    estimates[failed_other] = -np.inf
    estimates[failed & failed_other] = 0.0
    return estimates
