"""Curves with no more points than can be seen."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array


def thin(t: Array, values: Array, columns: int = 500) -> tuple[Array, Array]:
    """The least and the largest value in each of some columns, in their order in time.

    Unlike every n-th sample this keeps what chatters as wide as it is. Samples that are not finite
    stay as gaps.

    Args:
        t: Increasing, shape (n,).
        values: Shape (n,).
        columns: How many columns the whole of t is divided into, at most.
    """
    n = len(t)
    if n <= 2 * columns:
        return t, values
    wide = -(-n // columns)
    rows = -(-n // wide)
    padded = np.full(rows * wide, np.nan)
    padded[:n] = values
    block = padded.reshape(rows, wide)
    finite = np.isfinite(block)
    first = wide * np.arange(rows)
    some = finite.any(axis=1)
    least = first + np.where(finite, block, np.inf).argmin(axis=1)
    largest = first + np.where(finite, block, -np.inf).argmax(axis=1)
    # what fills the last row up is a gap too, but not one of the curve's
    gaps = (first + finite.argmin(axis=1))[~finite.all(axis=1)]
    kept = np.unique(np.concatenate([[0, n - 1], least[some], largest[some], gaps[gaps < n]]))
    return t[kept], values[kept]
