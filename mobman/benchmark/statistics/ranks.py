"""Ranks, as far as the cells settle them."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobman.arrays import Array, Index
from mobman.benchmark.statistics.aggregates import in_unit_of
from mobman.benchmark.statistics.comparison import paired_differences
from mobman.benchmark.statistics.interval import Interval, check_level, percentile_limits
from mobman.benchmark.statistics.l_estimators import Statistic, l_estimates, weight_of
from mobman.benchmark.statistics.resampling import RESAMPLES, resampled_counts
from mobman.benchmark.statistics.samples import as_strata, as_table
from mobman.benchmark.statistics.scale import FLOOR, Scale, to_scale
from mobman.benchmark.statistics.signed_rank import evidence_below


@dataclass(frozen=True)
class Rank:
    """The ranks that a label can have."""

    label: str
    score: Interval
    """In the scores' unit."""
    first: int
    """The best: 1, and one more for each label that is settled to be better."""
    last: int
    """The worst: the number of labels, and one less for each that is settled to be worse."""


def ranking(
    labels: Sequence[str],
    scores: ArrayLike,
    *,
    statistic: Statistic = "interquartile_mean",
    scale: Scale = "log10",
    floor: float = FLOOR,
    strata: Sequence[Hashable] | None = None,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> list[Rank]:
    """The range of ranks of each label that its scores on the same cells allow.

    Cells are resampled jointly for all labels. The order of two labels is settled if one has the
    lower score in nearly all resamples, and the ranks of its differences to the other say that it is
    lower: (resamples in which its score is not lower + 1) / (resamples + 1), and the one-sided p of
    the signed ranks, are both at most (1 - level) / 2 over the number of pairs, so that all settled
    orders hold together. Labels whose order is not settled share ranks.

    Args:
        labels: Of the rows.
        scores: Shape (n_labels, n_cells), lower is better; inf is a failure.
        statistic: The score of a label: ``"interquartile_mean"`` or ``"median"`` of its cells.
        scale: That the statistic is taken on: ``"log10"`` or ``"linear"``.
        floor: On ``"log10"``, what smaller scores count as.
        strata: Shape (n_cells,), labels of cells to resample within.
        level: Confidence level of each interval, and of all settled orders together.
        resamples: Of the percentile bootstrap; more are drawn where the number of pairs needs them.
        seed: Of its draws.

    Returns:
        The best estimate first. The order of the labels given makes no difference.

    Raises:
        UsageError: If the shapes do not fit, scores are NaN, or an argument cannot be.
    """
    names, table = as_table(labels, scores)
    scaled = to_scale(table, scale, floor)
    numbers = as_strata(strata, table.shape[1])
    level = check_level(level)
    tail = (1.0 - level) / 2.0 / max(1, math.comb(len(names), 2))
    resamples = max(resamples, math.ceil(1.0 / tail))
    estimates, resampled = _joint_estimates(scaled, numbers, statistic, resamples, seed)
    settled = _settled(resampled, tail) & _supported(scaled, scale, tail)
    low, high = percentile_limits(resampled, level)
    ranks = []
    for i, name in enumerate(names):
        interval = Interval(float(estimates[i]), float(low[i]), float(high[i]))
        first = 1 + int(settled[:, i].sum())
        last = len(names) - int(settled[i].sum())
        score = in_unit_of(table[i], interval, scale, floor)
        ranks.append(Rank(name, score, first, last))
    return sorted(ranks, key=lambda rank: (rank.score.estimate, rank.first, rank.last, rank.label))


def _joint_estimates(
    scores: Array, strata: Index, statistic: Statistic, resamples: int, seed: int
) -> tuple[Array, Array]:
    """Each label's estimate, and its estimates of resamples: shape (resamples, n_labels).

    The draws go with the places of the cells, not with scores: a worse score can only make an
    estimate worse.
    """
    weight = weight_of(statistic)
    orders = np.argsort(scores, axis=1, kind="stable")
    rows = [(row[order], order) for row, order in zip(scores, orders, strict=True)]

    def estimates(counts: Index) -> Array:
        found = [l_estimates(row, counts[:, order], weight) for row, order in rows]
        return np.stack(found, axis=1)

    blocks = [estimates(counts) for counts in resampled_counts(strata, resamples, seed)]
    once = np.ones((1, scores.shape[1]), dtype=np.int64)
    return estimates(once)[0], np.concatenate(blocks)


def _settled(resampled: Array, tail: float) -> NDArray[np.bool_]:
    """Whether label i (row) is better than label j (column) in nearly all resamples."""
    n_labels = resampled.shape[1]
    settled = np.zeros((n_labels, n_labels), dtype=bool)
    for i in range(n_labels):
        not_better = (resampled[:, [i]] >= resampled).sum(axis=0)
        settled[i] = (not_better + 1) / (len(resampled) + 1) <= tail
    return settled


def _supported(scores: Array, scale: Scale, tail: float) -> NDArray[np.bool_]:
    """Whether the cells, paired, say that label i (row) is better than label j (column).

    The bootstrap alone is too sure of itself with few cells.
    """
    n_labels = len(scores)
    supported = np.zeros((n_labels, n_labels), dtype=bool)
    for i, j in permutations(range(n_labels), 2):
        differences = paired_differences(scores[i], scores[j], scale)
        supported[i, j] = evidence_below(differences) <= tail
    return supported
