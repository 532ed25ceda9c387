"""Comparisons of labels on the same cells: paired tests, success rates, corrections, ranks."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr
from scipy.stats import binomtest, false_discovery_control, rankdata, wilcoxon

from mobman.arrays import Array, Index
from mobman.benchmark.statistics.estimates import (
    Bootstrap,
    Interval,
    as_sample,
    proportion,
    weighted,
)
from mobman.errors import UsageError

EXACT = 100
"""Up to so many differences that are not zero, p of the signed ranks is exact."""
_DIGITS = 12  # of a decade: ratios that are equal but for rounding are tied


@dataclass(frozen=True)
class Difference:
    """Comparison of a with b on the same cells; negative numbers: a is lower, so better."""

    n: int  # cells
    median_difference: Interval
    """Median over cells of a - b: in the scores' unit, or in decades, as ``scale`` says."""
    p_value: float
    """Two-sided, by Wilcoxon's signed-rank test, for this pair alone: see :func:`adjust`."""
    effect_size: float
    """Matched-pairs rank-biserial correlation: -1, a is better in all cells; 1, b is."""
    wins: int  # cells in which a is better
    ties: int  # cells in which they are equal, or both failed
    losses: int  # cells in which b is better
    smallest_p: float
    """The p that as many untied units would give if all said the same: if it is, times the number of
    pairs, above one's threshold, there are too few for any outcome to be significant."""
    scale: str  # scale of the differences


def compare(a: ArrayLike, b: ArrayLike, **options: Any) -> Difference:
    """Compare two labels by their scores on the same cells.

    Args:
        a: Shape (n,). A failure against a result is the largest difference there is; where both failed,
            the difference is 0.
        b: Shape (n,), on the same cells in the same order.
        **options: Fields of :class:`Bootstrap`; on the scale ``"log10"``, the default, differences are
            decades (-1: a tenth of b's score), and two scores below the floor are tied.
    """
    first, second = as_sample(a, "a"), as_sample(b, "b")
    if len(first) != len(second):
        raise UsageError(
            f"a and b: found {len(first)} and {len(second)} scores; allowed is one of each for a cell"
        )
    bootstrap = Bootstrap(**{"scale": "log10", **options})
    differences = _differences(bootstrap, *map(bootstrap.to_scale, (first, second)))
    units = bootstrap.by_cluster(differences)
    # infinite differences are tied for the largest; zeros take the lowest ranks and have no sign (Pratt)
    ranks = rankdata(np.abs(units))
    signed = np.sign(units) * ranks
    middle = bootstrap.estimate(differences, weighted("median"))
    return Difference(
        n=len(differences),
        median_difference=Interval(*map(float, middle)),
        p_value=_two_sided_p(units, signed[signed != 0.0]),
        effect_size=float(signed.sum() / ranks.sum()),
        wins=int((differences < 0.0).sum()),
        ties=int((differences == 0.0).sum()),
        losses=int((differences > 0.0).sum()),
        smallest_p=min(1.0, 2.0 ** (1 - np.count_nonzero(signed))),
        scale=bootstrap.scale,
    )


@dataclass(frozen=True)
class PairComparison:
    """Two labels compared, as one of several pairs."""

    a: str
    b: str
    comparison: Difference  # comparison of a with b
    adjusted_p: float  # the comparison's p-value, corrected for all pairs


def compare_all(
    labels: Sequence[str], scores: ArrayLike, *, method: str = "holm", **options: Any
) -> list[PairComparison]:
    """Compare every label with every other by their scores, shape (labels, cells), on the same cells.

    There is one comparison for each pair, in the order of the labels; the method is that of
    :func:`adjust`, the options are those of :func:`compare`.
    """
    names, table = _table(labels, scores)
    pairs = list(combinations(range(len(names)), 2))
    found = [compare(table[i], table[j], **options) for i, j in pairs]
    adjusted = adjust([comparison.p_value for comparison in found], method)
    return [
        PairComparison(names[i], names[j], comparison, float(p))
        for (i, j), comparison, p in zip(pairs, found, adjusted, strict=True)
    ]


def adjust(p_values: ArrayLike, method: str = "holm") -> Array:
    """Adjusted p-values: to be held against the threshold that one p-value would be.

    Args:
        p_values: Shape (n,), of one family of tests; none are allowed.
        method: ``"holm"``, for the chance of any false finding, or ``"benjamini-hochberg"``, for the
            share of false ones among the findings.

    Returns:
        Shape (n,), in the same order, none below its p-value and none above 1.
    """
    try:
        p = np.asarray(p_values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"p_values: expected numbers ({error})") from None
    if p.ndim != 1 or not ((p >= 0.0) & (p <= 1.0)).all():
        raise UsageError("p_values: allowed is a list of numbers from 0 to 1")
    if method == "benjamini-hochberg":
        return np.asarray(false_discovery_control(p, method="bh")) if p.size else p
    if method != "holm":
        raise UsageError(f"method: found {method!r}; allowed are 'holm' and 'benjamini-hochberg'")
    # the i-th smallest of n times n - i, none below the one before
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    return np.minimum(adjusted, 1.0)


@dataclass(frozen=True)
class SuccessComparison:
    """Comparison of a's successes with b's on the same cells; positive: a succeeds more often."""

    n: int  # cells
    difference: Interval
    """Success rate of a - that of b: the effect, with Newcombe's interval for pairs."""
    p_value: float  # two-sided, by McNemar's exact test, for this pair alone: see :func:`adjust`
    both: int
    only_a: int  # cells in which a succeeds and b does not
    only_b: int
    neither: int
    smallest_p: float  # the p if all cells in which they differ said the same


def compare_successes(
    a: ArrayLike,
    b: ArrayLike,
    *,
    clusters: Sequence[Hashable] | None = None,
    level: float = 0.95,
) -> SuccessComparison:
    """Compare two labels by success or failure on the same cells.

    Args:
        a: Shape (n,), True or 1 for a success, False or 0 for a failure.
        b: Shape (n,), on the same cells in the same order.
        clusters: Labels, one a cell, of what the test counts once: for whoever solves more of it.
        level: Confidence level of the difference's interval.
    """
    given = {"a": np.asarray(a), "b": np.asarray(b)}
    for name, values in given.items():
        if values.ndim != 1 or values.size == 0 or not np.isin(values, (0, 1)).all():
            raise UsageError(f"{name}: allowed is a list of True or False, one for each cell")
    first, second = (values.astype(bool) for values in given.values())
    if len(first) != len(second):
        raise UsageError(
            f"a and b: found {len(first)} and {len(second)} values; allowed is one of each for a cell"
        )
    both, neither = int((first & second).sum()), int((~first & ~second).sum())
    only_a, only_b = int((first & ~second).sum()), int((~first & second).sum())
    ahead = np.sign(first.astype(float) - second)
    if clusters is not None:
        groups = Bootstrap(clusters=clusters).groups_of(len(ahead))
        ahead = np.sign(np.bincount(groups, weights=ahead))
    won, differ = int((ahead > 0.0).sum()), int(np.count_nonzero(ahead))
    return SuccessComparison(
        n=len(first),
        difference=_rate_difference(both, only_a, only_b, neither, level),
        p_value=float(binomtest(won, differ).pvalue) if differ else 1.0,
        both=both,
        only_a=only_a,
        only_b=only_b,
        neither=neither,
        smallest_p=min(1.0, 2.0 ** (1 - differ)),
    )


@dataclass(frozen=True)
class Rank:
    """The ranks that a label can have."""

    label: str
    score: Interval  # estimate with its interval, in the scores' unit
    first: int  # the best: 1, and one more for each label that is settled to be better
    last: int  # the worst: the number of labels, and one less for each that is settled to be worse


def ranking(
    labels: Sequence[str],
    scores: ArrayLike,
    *,
    statistic: Literal["interquartile_mean", "median"] = "interquartile_mean",
    **options: Any,
) -> list[Rank]:
    """The range of ranks of each label that its scores on the same cells allow, the best estimate first.

    Cells, or clusters of them, are resampled jointly for all labels. The order of two labels is settled
    if one has the lower score in nearly all resamples, and the ranks of its differences to the other
    (the median ones of clusters) say that it is lower: (resamples in which its score is not lower + 1)
    / (resamples + 1), and the one-sided p of the signed ranks, are both at most (1 - level) / 2 over
    the number of pairs, so that all settled orders hold together. Labels whose order is not settled
    share ranks. The order of the labels given makes no difference.

    Args:
        labels: Of the rows.
        scores: Shape (n_labels, n_cells).
        statistic: The score of a label: ``"interquartile_mean"`` or ``"median"`` of its cells.
        **options: Fields of :class:`Bootstrap`, by default on the scale ``"log10"``. The level is that
            of each interval, and of all settled orders together; more resamples are drawn where the
            number of pairs needs them.
    """
    names, table = _table(labels, scores)
    bootstrap = Bootstrap(**{"scale": "log10", **options})
    tail = (1.0 - bootstrap.level) / 2.0 / max(1, math.comb(len(names), 2))
    bootstrap = replace(bootstrap, resamples=max(bootstrap.resamples, math.ceil(1.0 / tail)))
    scaled = bootstrap.to_scale(table)
    # drawn by the places of the cells, not by scores: a worse score can only make an estimate worse
    estimates, drawn = bootstrap.estimates(scaled, weighted(statistic))
    low, high = bootstrap.limits(drawn)
    better = np.zeros((len(names), len(names)), dtype=bool)  # i (row) than j (column), settled
    for i, j in permutations(range(len(names)), 2):
        not_lower = (drawn[:, i] >= drawn[:, j]).sum()
        # the bootstrap alone is too sure of itself with few cells
        better[i, j] = (not_lower + 1) / (len(drawn) + 1) <= tail and (
            evidence_below(bootstrap.by_cluster(_differences(bootstrap, scaled[i], scaled[j])))
            <= tail
        )
    ranks = [
        Rank(
            name,
            bootstrap.in_unit_of(table[i], estimates[i], low[i], high[i]),
            first=1 + int(better[:, i].sum()),
            last=len(names) - int(better[i].sum()),
        )
        for i, name in enumerate(names)
    ]
    return sorted(ranks, key=lambda rank: (rank.score.estimate, rank.first, rank.last, rank.label))


def evidence_below(differences: Array) -> float:
    """One-sided p of differences that tend to be below zero, by the ranks of untied ones.

    The null distribution is that of ranks without ties and zeros: exact where there are none,
    approximate else. In return no difference can grow and the p fall, which that of tied ranks does
    at times: the sum of signed ranks is that of the signs of all d_i + d_j, i <= j, and what it is
    held against does not depend on the differences.
    """
    total = (np.sign(differences) * rankdata(np.abs(differences))).sum()
    ranks = np.arange(1, len(differences) + 1)
    if len(ranks) > EXACT:  # their sum is nearly normal
        return float(ndtr(total / np.sqrt((ranks.astype(np.float64) ** 2).sum())))
    # the sum of positive ranks is half of their total and the signed sum
    found = int(np.ceil((ranks.sum() + total) / 2.0))
    return float(_distribution(ranks)[: found + 1].sum())


def _two_sided_p(differences: Array, signed: Array) -> float:
    """Wilcoxon's p of differences, by their signed ranks that are not zero."""
    if not signed.size:
        return 1.0
    if signed.size > EXACT:
        found: Any = wilcoxon(differences.tolist(), zero_method="pratt", method="approx")
        return float(found.pvalue)
    doubled = np.rint(2.0 * signed).astype(np.int64)  # ranks of ties are halves
    chance, plus = _distribution(np.abs(doubled)), int(doubled[doubled > 0].sum())
    return float(min(1.0, 2.0 * min(chance[: plus + 1].sum(), chance[plus:].sum())))


def _distribution(ranks: Index) -> Array:
    """The chance of each sum of positive ranks, from 0 up, if each sign is as likely.

    SciPy has it for ranks without ties alone.
    """
    chance = np.zeros(ranks.sum() + 1)
    chance[0] = 1.0
    for rank in ranks:
        chance[rank:] = 0.5 * (chance[rank:] + chance[:-rank])
        chance[:rank] *= 0.5
    return chance


def _differences(bootstrap: Bootstrap, a: Array, b: Array) -> Array:
    """a - b, both on the scale: -inf, 0 or inf where b, both or a failed."""
    both = np.isinf(a) & np.isinf(b)
    differences = np.where(both, 0.0, a) - np.where(both, 0.0, b)
    return np.round(differences, _DIGITS) if bootstrap.scale == "log10" else differences


def _rate_difference(both: int, only_a: int, only_b: int, neither: int, level: float) -> Interval:
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


def _table(labels: Sequence[str], scores: ArrayLike) -> tuple[list[str], Array]:
    """Labels, and their scores on the same cells: shape (n_labels, n_cells)."""
    names = list(labels)
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise UsageError(f"labels: found more than once: {', '.join(map(repr, twice))}")
    table = as_sample(scores, "scores", dimensions=2)
    if len(table) != len(names):
        raise UsageError(
            f"scores: found {len(table)} rows for {len(names)} labels; allowed is one a label, "
            "with a column for each cell"
        )
    return names, table
