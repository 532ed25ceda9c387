"""Wilcoxon's signed-rank test with Pratt's zeros: exact with ties for few differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr
from scipy.stats import rankdata

from mobman.arrays import Array, Index

EXACT = 100
"""Up to so many differences that are not zero, p is of the exact distribution."""


@dataclass(frozen=True)
class SignedRank:
    """What the ranks of differences say."""

    effect_size: float
    """(sum of the positive's ranks - sum of the negative's) / sum of all, the zeros' included."""
    p_value: float
    """Two-sided: that as uneven signs, or more, come up if each is as likely + as -."""
    smallest_p: float
    """The p of these differences if all had one sign."""


def signed_rank(differences: Array) -> SignedRank:
    """The test of differences, of which some may be zero, tied, -inf or inf.

    Args:
        differences: Shape (n,). Infinite ones are tied for the largest; zeros take the lowest ranks
            and have no sign (Pratt).
    """
    ranks = rankdata(np.abs(differences))
    signed = np.sign(differences) * ranks
    untied = int(np.count_nonzero(signed))
    if untied == 0:
        return SignedRank(0.0, 1.0, 1.0)
    if untied <= EXACT:
        # ranks of ties are halves
        p_value = _exact_p(np.rint(2.0 * signed[signed != 0.0]).astype(np.int64))
    else:
        p_value = 2.0 * _tail(-abs(signed.sum()), ranks[signed != 0.0])
    return SignedRank(float(signed.sum() / ranks.sum()), p_value, min(1.0, 2.0 ** (1 - untied)))


def evidence_below(differences: Array) -> float:
    """One-sided p of differences that tend to be below zero, by the ranks of untied ones.

    The null distribution is that of ranks without ties and zeros: exact where there are none,
    approximate else. In return no difference can grow and the p fall, which that of tied ranks does
    at times: the sum of signed ranks is that of the signs of all d_i + d_j, i <= j, and what it is
    held against does not depend on the differences.
    """
    total = (np.sign(differences) * rankdata(np.abs(differences))).sum()
    ranks = np.arange(1, len(differences) + 1)
    if len(ranks) > EXACT:
        return _tail(total, ranks.astype(np.float64))
    chance = _distribution(ranks)
    # the sum of positive ranks is half of their total and the signed sum
    found = int(np.ceil((ranks.sum() + total) / 2.0))
    return float(chance[: found + 1].sum())


def _exact_p(signed: Index) -> float:
    """Two-sided p of signed ranks, over all signs."""
    chance = _distribution(np.abs(signed))
    found = int(signed[signed > 0].sum())
    tail = min(chance[: found + 1].sum(), chance[found:].sum())
    return float(min(1.0, 2.0 * tail))


def _distribution(ranks: Index) -> Array:
    """The chance of each sum of positive ranks, from 0 up, if each sign is as likely."""
    chance = np.zeros(ranks.sum() + 1)
    chance[0] = 1.0
    for rank in ranks:
        chance[rank:] = 0.5 * (chance[rank:] + chance[:-rank])
        chance[:rank] *= 0.5
    return chance


def _tail(total: float, ranks: Array) -> float:
    """The chance of a signed sum of at most that, of many ranks: it is nearly normal."""
    return float(ndtr(total / np.sqrt((ranks**2).sum())))
