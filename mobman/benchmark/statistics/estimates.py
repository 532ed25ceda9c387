"""Estimates with bootstrap intervals: medians, interquartile means, shares and profiles."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, stdtrit
from scipy.stats import binomtest

from mobman.arrays import Array, Index
from mobman.errors import UsageError

FLOOR = 1e-12
"""Smaller values count as this on ``log10``, in the scores' unit: zeros must count as something."""
_BLOCK = 2**14  # draws at a time: they stay in the processor's cache, and memory does not grow

WEIGHTS: dict[str, Callable[[Index, Index], Array]] = {
    "interquartile_mean": lambda count, n: np.clip(2.0 * count / n - 0.5, 0.0, 1.0),
    "median": lambda count, n: np.clip((count - (n - 2 + n % 2) / 2) / (2 - n % 2), 0.0, 1.0),
}
"""The weight of the ``count`` lowest of n values together, from 0 to 1; n of each resample, since
clusters differ in size."""
_Estimator = Callable[[Array, Index], Array]
"""Estimates of resamples, shape (resamples, ...): of n ascending values, and of how often each is
drawn, shape (resamples, n)."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval; each may be inf where runs failed."""

    estimate: float
    low: float
    high: float


def median(values: ArrayLike, **options: Any) -> Interval:
    """The median, in the unit of the values: inf if half of the runs failed.

    Args:
        values: Shape (n,).
        **options: Fields of :class:`Bootstrap`. On the scale ``"log10"`` the middle of an even number is
            the mean of the logarithms of the two middle values.
    """
    return Bootstrap(**options).aggregate("median", values)


def interquartile_mean(values: ArrayLike, **options: Any) -> Interval:
    """The mean of the middle half of the runs, in the unit of the values: inf if a failure is in it.

    Where n is no multiple of 4, the values at the edges of the middle half count in part.

    Args:
        values: Shape (n,).
        **options: Fields of :class:`Bootstrap`; on the scale ``"log10"`` the mean is the geometric one.
    """
    return Bootstrap(**options).aggregate("interquartile_mean", values)


def proportion(successes: int, n: int, *, level: float = 0.95) -> Interval:
    """The share of successes with Wilson's score interval.

    It has a width also where all runs, or none, succeeded.

    Args:
        successes: Their number.
        n: Number of runs.
        level: Confidence level.
    """
    whole = int(successes) == successes and int(n) == n
    if not whole or n < 1 or not 0 <= successes <= n:
        raise UsageError(
            f"successes, n: found {successes!r} of {n!r}; allowed are whole numbers, n from 1, "
            "successes from 0 to n"
        )
    found = binomtest(int(successes), int(n))
    limits = found.proportion_ci(confidence_level=Bootstrap(level=level).level, method="wilson")
    return Interval(float(found.statistic), float(limits.low), float(limits.high))


def performance_profile(scores: ArrayLike, taus: ArrayLike, *, floor: float = 0.0) -> Array:
    """The share of cells in which a label's score is within a factor of the cell's best.

    Args:
        scores: Shape (n_labels, n_cells), >= 0; a failure is within no factor, also where all failed.
        taus: Shape (n_taus,), the factors, >= 1.
        floor: Scores below it are equal to it, in their unit: the ratio of two errors that are both
            rounding means nothing.

    Returns:
        Shape (n_labels, n_taus), each in [0, 1].
    """
    table, factors = as_sample(scores, "scores", dimensions=2), as_sample(taus, "taus")
    if (table < 0.0).any():
        raise UsageError(f"scores: found {table.min():.6g}; ratios to the best need scores >= 0")
    if (factors < 1.0).any() or np.isinf(factors).any():
        raise UsageError("taus: allowed are finite factors >= 1: no score is below the cell's best")
    if not 0.0 <= floor < np.inf:
        raise UsageError(f"floor: found {floor!r}; allowed are finite numbers >= 0")
    floored = np.maximum(table, floor)
    best = floored.min(axis=0)
    within = [np.isfinite(table) & (floored <= factor * best) for factor in factors]
    return np.asarray(np.mean(within, axis=2).T)


@dataclass(frozen=True, eq=False)
class ScoreProfile:
    """The share of runs that reach each threshold; all of shape (n_taus,)."""

    taus: Array  # the thresholds, in the scores' unit
    share: Array
    low: Array  # the band's lower edge, for each threshold by itself
    high: Array


def score_profile(values: ArrayLike, taus: ArrayLike, **options: Any) -> ScoreProfile:
    """The share of runs with a score of at most tau, with a pointwise bootstrap band.

    Args:
        values: Shape (n,); a failure reaches no threshold.
        taus: Shape (n_taus,), thresholds in the unit of the values.
        **options: Fields of :class:`Bootstrap`; the scale makes no difference.
    """
    sample, thresholds = as_sample(values), as_sample(taus, "taus")
    reached = np.searchsorted(np.sort(sample[np.isfinite(sample)]), thresholds, side="right")

    def shares(_: Array, counts: Index) -> Array:
        below = np.pad(counts.cumsum(axis=1), ((0, 0), (1, 0)))
        return np.asarray(below[:, reached] / below[:, -1:])

    return ScoreProfile(thresholds, *Bootstrap(**options).estimate(sample, shares))


@dataclass(frozen=True, kw_only=True)
class Bootstrap:
    """The percentile bootstrap of samples in which inf is a failure.

    It is not SciPy's, which refuses samples of one value, interpolates its limits (between a number and
    inf there is nothing to interpolate), and does not draw several labels' cells jointly within strata
    or by clusters.
    """

    scale: Literal["linear", "log10"] = "linear"
    """Values are averaged and subtracted as they are, or as decades. Comparisons and ranks take
    ``"log10"`` by default."""
    floor: float = FLOOR  # smaller values count as this on "log10"
    strata: Sequence[Hashable] | None = None
    """Labels, one a value, to resample within; by default all values are one stratum."""
    clusters: Sequence[Hashable] | None = None
    """Labels, one a value, of what is drawn as a whole: values that are much alike, or of one robot.
    Intervals are then wider, as Student's t has it for so many clusters."""
    level: float = 0.95  # confidence level of each interval
    resamples: int = 2000
    seed: int = 0  # seed of the draws

    def __post_init__(self) -> None:
        whole = not isinstance(self.resamples, bool) and int(self.resamples) == self.resamples
        log, floor = self.scale == "log10", self.floor
        for name, fine, allowed in (
            ("level", 0.0 < self.level < 1.0, "are confidence levels between 0 and 1"),
            ("resamples", whole and self.resamples >= 1, "are whole numbers from 1"),
            ("scale", self.scale in ("linear", "log10"), "are 'linear' and 'log10'"),
            ("floor", not log or 0.0 < floor < np.inf, "on scale 'log10' are finite numbers > 0"),
        ):
            if not fine:
                raise UsageError(f"{name}: found {getattr(self, name)!r}; allowed {allowed}")
        if self.strata is not None and self.clusters is not None:
            raise UsageError("strata and clusters: found both; allowed is one of them")

    def to_scale(self, values: Array) -> Array:
        """Values on the scale; inf stays inf."""
        if self.scale == "linear":
            return values
        if (values < 0.0).any():
            raise UsageError(
                f"values: found {values.min():.6g}; scale 'log10' has no negative values, "
                "use scale='linear'"
            )
        return np.asarray(np.log10(np.maximum(values, self.floor)))

    def in_unit_of(self, sample: Array, estimate: Array, low: Array, high: Array) -> Interval:
        """An estimate and its limits on the scale, in the unit of the sample that they are of.

        They do not leave the sample's range by rounding: what is of equal values is that value.
        """
        numbers = np.array((estimate, low, high))
        if self.scale == "log10":
            least, most = np.maximum((sample.min(), sample.max()), self.floor)
            numbers = np.clip(np.power(10.0, numbers), least, most)
        return Interval(*map(float, numbers))

    def aggregate(self, statistic: str, values: ArrayLike) -> Interval:
        """A statistic of values, in their unit."""
        sample = as_sample(values)
        return self.in_unit_of(sample, *self.estimate(self.to_scale(sample), weighted(statistic)))

    def estimate(self, values: Array, estimator: _Estimator) -> tuple[Array, Array, Array]:
        """An estimate of values, -inf and inf among them, and the limits of its interval.

        The draws go with the values in ascending order, not with the order that they are given in.
        """
        groups = self.groups_of(len(values))
        order = np.lexsort((values, groups))
        estimates, drawn = self._joint(values[None, order], groups[order], estimator)
        return estimates[0], *self.limits(drawn[:, 0])

    def estimates(self, rows: Array, estimator: _Estimator) -> tuple[Array, Array]:
        """Estimates of each row, (n_rows, ...), and of resamples of the columns, drawn jointly by their
        places, (resamples, n_rows, ...)."""
        return self._joint(rows, self.groups_of(rows.shape[1]), estimator)

    def limits(self, drawn: Array) -> tuple[Array, Array]:
        """The central share of the resamples' estimates, which lie along the first axis.

        Each limit is a resample's estimate, the outer neighbour of the quantile.
        """
        tail = math.floor(self._tail * (len(drawn) - 1))
        ordered = np.sort(drawn, axis=0)
        return ordered[tail], ordered[-1 - tail]

    @property
    def _tail(self) -> float:
        """Share of the resamples beyond each limit: with n clusters that which the normal distribution
        has beyond t sqrt(n/(n-1)), since resamples vary too little (Hesterberg 2015)."""
        tail = (1.0 - self.level) / 2.0
        n = len(set(map(repr, self.clusters or ())))
        return tail if n < 2 else float(ndtr(stdtrit(n - 1, tail) * math.sqrt(n / (n - 1))))

    def _joint(self, rows: Array, groups: Index, estimator: _Estimator) -> tuple[Array, Array]:
        orders = np.argsort(rows, axis=1, kind="stable")
        ascending = np.take_along_axis(rows, orders, axis=1)

        def estimates(counts: Index) -> Array:
            found = [estimator(row, counts[:, o]) for row, o in zip(ascending, orders, strict=True)]
            return np.stack(found, axis=1)

        # without clusters each value is one
        units = np.arange(len(groups)) if self.clusters is None else groups
        strata = groups if self.clusters is None else np.zeros(groups.max() + 1, dtype=np.int64)
        blocks = [estimates(counts[:, units]) for counts in self._counts(strata)]
        return estimates(np.ones((1, len(groups)), dtype=np.int64))[0], np.concatenate(blocks)

    def _counts(self, strata: Index) -> Iterator[Index]:
        """Blocks of (some resamples, n): how often each unit is drawn, with replacement."""
        generator, n = np.random.default_rng(self.seed), len(strata)
        members, sizes = np.argsort(strata, kind="stable"), np.bincount(strata)
        start, size = (sizes.cumsum() - sizes)[strata[members]], sizes[strata[members]]
        block = max(1, _BLOCK // n)
        for done in range(0, int(self.resamples), block):
            rows = min(block, int(self.resamples) - done)
            drawn = members[start + (generator.random((rows, n)) * size).astype(np.int64)]
            drawn += n * np.arange(rows)[:, None]
            yield np.bincount(drawn.ravel(), minlength=rows * n).reshape(rows, n)

    def groups_of(self, n: int) -> Index:
        """Each value's cluster, or stratum, as a number, in an order that does not depend on the
        values'."""
        kind = "strata" if self.clusters is None else "clusters"
        given = getattr(self, kind)
        if given is None:
            return np.zeros(n, dtype=np.int64)
        names = [repr(group) for group in given]
        if len(names) != n:
            raise UsageError(f"{kind}: found {len(names)} for {n} values; allowed is one for each")
        return np.unique(names, return_inverse=True)[1]

    def by_cluster(self, differences: Array) -> Array:
        """The median of each cluster's differences, -inf and inf among them; each one without
        clusters."""
        if self.clusters is None:
            return differences
        groups, middle = self.groups_of(len(differences)), weighted("median")
        own = [np.sort(differences[groups == group]) for group in range(groups.max() + 1)]
        return np.array([middle(values, np.ones((1, len(values)), np.int64))[0] for values in own])


def weighted(statistic: str) -> _Estimator:
    """A mean of ordered values by :data:`WEIGHTS`: infinite if an infinite value has weight.

    Infinite values of both signs cancel: the two middle differences, one a failure of each side, have
    the middle 0.
    """
    if statistic not in WEIGHTS:
        allowed = " and ".join(map(repr, WEIGHTS))
        raise UsageError(f"statistic: found {statistic!r}; allowed are {allowed}")

    def estimator(values: Array, counts: Index) -> Array:
        n = len(values)
        below, above = np.isneginf(values).sum(), n - np.isposinf(values).sum()
        weights, below_each = np.zeros((len(counts), n + 1)), counts.cumsum(axis=1)
        weights[:, 1:] = WEIGHTS[statistic](below_each, below_each[:, -1:])
        estimates, finite = np.zeros(len(counts)), values[below:above]
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

    return estimator


def as_sample(values: ArrayLike, name: str = "values", *, dimensions: int = 1) -> Array:
    """Scores as an array of so many dimensions: at least one, and none NaN or -inf."""
    try:
        sample = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name}: expected numbers ({error})") from None
    if sample.ndim != dimensions:
        raise UsageError(
            f"{name}: found an array of shape {sample.shape}; allowed are {dimensions} dimensions"
        )
    if sample.size == 0:
        raise UsageError(f"{name}: found none; a statistic needs at least one value")
    if undefined := int(np.isnan(sample).sum()):
        raise UsageError(
            f"{name}: found {undefined} NaN of {sample.size}; score a failure as inf, and leave out, "
            "of all that is compared, what has no meaning for a run"
        )
    if np.isneginf(sample).any():
        raise UsageError(f"{name}: found -inf; lower is better, so a failure is scored as inf")
    return sample
