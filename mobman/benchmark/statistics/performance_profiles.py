"""Performance profiles of Dolan and Moré: how near to the best of each cell, and how often."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mobman.arrays import Array
from mobman.benchmark.statistics.samples import as_sample
from mobman.errors import UsageError


def performance_profile(scores: ArrayLike, taus: ArrayLike, *, floor: float = 0.0) -> Array:
    """The share of cells in which a label's score is within a factor of the cell's best.

    Args:
        scores: Shape (n_labels, n_cells), >= 0, lower is better; inf is a failure, which is within no
            factor, also where all failed.
        taus: Shape (n_taus,), the factors, >= 1.
        floor: Scores below it are equal to it, in their unit: the ratio of two errors that are both
            rounding means nothing.

    Returns:
        Shape (n_labels, n_taus), each in [0, 1].

    Raises:
        UsageError: If scores are NaN or negative, taus below 1 or infinite, or the floor is negative.
    """
    table = as_sample(scores, "scores", dimensions=2)
    if (table < 0.0).any():
        raise UsageError(f"scores: found {table.min():.6g}; ratios to the best need scores >= 0")
    factors = as_sample(taus, "taus")
    if (factors < 1.0).any() or np.isinf(factors).any():
        raise UsageError("taus: allowed are finite factors >= 1: no score is below the cell's best")
    if not 0.0 <= floor < np.inf:
        raise UsageError(f"floor: found {floor!r}; allowed are finite numbers >= 0")
    solved = np.isfinite(table)
    floored = np.maximum(table, floor)
    best = floored.min(axis=0)
    shares = [(solved & (floored <= factor * best)).mean(axis=1) for factor in factors]
    return np.stack(shares, axis=1)
