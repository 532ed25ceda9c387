"""Score profiles: the distribution function of the runs' scores, with a band."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobman.arrays import Array
from mobman.benchmark.statistics.interval import check_level, percentile_limits
from mobman.benchmark.statistics.resampling import RESAMPLES, resampled_counts
from mobman.benchmark.statistics.samples import as_sample, as_strata


@dataclass(frozen=True, eq=False)
class ScoreProfile:
    """The share of runs that reach each threshold; all of shape (n_taus,)."""

    taus: Array
    """The thresholds, in the scores' unit."""
    share: Array
    low: Array
    """The band's lower edge, for each threshold by itself."""
    high: Array


def score_profile(
    values: ArrayLike,
    taus: ArrayLike,
    *,
    strata: Sequence[Hashable] | None = None,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> ScoreProfile:
    """The share of runs with a score of at most tau, with a pointwise bootstrap band.

    Args:
        values: Shape (n,), lower is better; inf is a failure, which reaches no threshold.
        taus: Shape (n_taus,), thresholds in the unit of the values.
        strata: Shape (n,), labels to resample within; by default all are one stratum.
        level: Confidence level of the band at each threshold.
        resamples: Of the percentile bootstrap.
        seed: Of its draws.

    Raises:
        UsageError: If there are no values, some are NaN, or an argument cannot be.
    """
    sample = as_sample(values)
    thresholds = as_sample(taus, "taus")
    level = check_level(level)
    numbers = as_strata(strata, len(sample))
    order = np.lexsort((sample, numbers))
    sample, numbers = sample[order], numbers[order]
    ascending = np.argsort(sample, kind="stable")
    finite = np.sort(sample[np.isfinite(sample)])
    reached = np.searchsorted(finite, thresholds, side="right")
    shares = []
    for counts in resampled_counts(numbers, resamples, seed):
        up_to = np.zeros((len(counts), len(sample) + 1), dtype=np.int64)
        np.cumsum(counts[:, ascending], axis=1, out=up_to[:, 1:])
        shares.append(up_to[:, reached] / len(sample))
    low, high = percentile_limits(np.concatenate(shares), level)
    return ScoreProfile(thresholds, reached / len(sample), low, high)
