"""Curves with no more points than can be seen."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mobman.arrays import Array


def thin(t: Array, values: Array, columns: int = 500) -> tuple[Array, Array]:
    """The least and the largest value in each of some columns, in their order in time.

    Unlike every n-th sample this keeps what chatters as wide as it is. Samples that are not finite
    stay as gaps.

    Args:
        t: Increasing, shape (n,).
        values: Shape (n,).
        columns: How many columns the whole of t is divided into.
    """
    n = len(t)
    if n <= 2 * columns:
        return t, values
    starts = np.linspace(0, n, columns + 1).astype(int)
    kept = {0, n - 1}
    for start, end in pairwise(starts):
        part = values[start:end]
        finite = np.isfinite(part)
        if not finite.all():
            kept.add(int(start + np.argmin(finite)))
        if finite.any():
            kept.add(int(start + np.argmin(np.where(finite, part, np.inf))))
            kept.add(int(start + np.argmax(np.where(finite, part, -np.inf))))
    indices = np.array(sorted(kept))
    return t[indices], values[indices]
