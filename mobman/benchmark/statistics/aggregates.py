"""One number for a sample of runs, with a bootstrap interval."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mobman.arrays import Array, Index
from mobman.benchmark.statistics.interval import Interval, check_level, percentile_limits
from mobman.benchmark.statistics.l_estimators import Statistic, l_estimates, weight_of
from mobman.benchmark.statistics.resampling import RESAMPLES, resampled_counts
from mobman.benchmark.statistics.samples import as_sample, as_strata
from mobman.benchmark.statistics.scale import FLOOR, Scale, from_scale, to_scale


def median(
    values: ArrayLike,
    *,
    scale: Scale = "linear",
    floor: float = FLOOR,
    strata: Sequence[Hashable] | None = None,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """The median: inf if half of the runs failed.

    Args:
        values: Shape (n,), lower is better; inf is a failure.
        scale: What the mean of the two middle values of an even number is of: ``"linear"``, of them;
            ``"log10"``, of their logarithms.
        floor: On ``"log10"``, what smaller values count as.
        strata: Shape (n,), labels to resample within; by default all are one stratum.
        level: Confidence level of the interval.
        resamples: Of the percentile bootstrap.
        seed: Of its draws.

    Returns:
        The median and its interval, in the unit of the values.

    Raises:
        UsageError: If there are no values, some are NaN, or an argument cannot be.
    """
    return _aggregate("median", values, scale, floor, strata, level, resamples, seed)


def interquartile_mean(
    values: ArrayLike,
    *,
    scale: Scale = "linear",
    floor: float = FLOOR,
    strata: Sequence[Hashable] | None = None,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """The mean of the middle half of the runs: inf if a failure is in it.

    Where n is no multiple of 4, the values at the edges of the middle half count in part.

    Args:
        values: Shape (n,), lower is better; inf is a failure.
        scale: ``"linear"``, or ``"log10"`` for the geometric mean of the middle half.
        floor: On ``"log10"``, what smaller values count as.
        strata: Shape (n,), labels to resample within; by default all are one stratum.
        level: Confidence level of the interval.
        resamples: Of the percentile bootstrap.
        seed: Of its draws.

    Returns:
        The mean and its interval, in the unit of the values.

    Raises:
        UsageError: If there are no values, some are NaN, or an argument cannot be.
    """
    return _aggregate("interquartile_mean", values, scale, floor, strata, level, resamples, seed)


def _aggregate(
    statistic: Statistic,
    values: ArrayLike,
    scale: Scale,
    floor: float,
    strata: Sequence[Hashable] | None,
    level: float,
    resamples: int,
    seed: int,
) -> Interval:
    sample = as_sample(values)
    scaled = to_scale(sample, scale, floor)
    numbers = as_strata(strata, len(sample))
    found = bootstrap(scaled, numbers, statistic, check_level(level), resamples, seed)
    return in_unit_of(sample, found, scale, floor)


def bootstrap(
    values: Array, strata: Index, statistic: Statistic, level: float, resamples: int, seed: int
) -> Interval:
    """A statistic of values, -inf and inf among them, with its interval on the same scale.

    The draws go with the values in ascending order, not with the order that they are given in.
    """
    weight = weight_of(statistic)
    order = np.lexsort((values, strata))
    values, strata = values[order], strata[order]
    ascending = np.argsort(values, kind="stable")
    values = values[ascending]
    estimate = l_estimates(values, np.ones((1, len(values)), dtype=np.int64), weight)
    estimates = np.concatenate(
        [
            l_estimates(values, counts[:, ascending], weight)
            for counts in resampled_counts(strata, resamples, seed)
        ]
    )
    low, high = percentile_limits(estimates, level)
    return Interval(float(estimate[0]), float(low), float(high))


def in_unit_of(sample: Array, interval: Interval, scale: Scale, floor: float) -> Interval:
    """An interval on a scale, in the unit of the sample that it is of.

    It does not leave the sample's range by rounding: what is of equal values is that value.
    """
    if scale == "linear":
        return interval
    limits = from_scale(np.array([interval.estimate, interval.low, interval.high]), scale)
    estimate, low, high = np.clip(limits, max(sample.min(), floor), max(sample.max(), floor))
    return Interval(float(estimate), float(low), float(high))
