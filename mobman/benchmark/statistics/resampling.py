"""Resamples of the bootstrap: how often each value is drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobman.arrays import Index
from mobman.errors import UsageError

RESAMPLES = 2000
_BLOCK = 2**14  # draws at a time: they stay in the processor's cache, and memory does not grow


def resampled_counts(strata: Index, resamples: int, seed: int) -> Iterator[Index]:
    """Draws with replacement within strata, each as large as it is.

    Args:
        strata: Shape (n,), each value's stratum.
        resamples: How many.
        seed: The same gives the same draws.

    Yields:
        Blocks of shape (some resamples, n): how often each value is drawn.

    Raises:
        UsageError: If the number is not a positive whole one.
    """
    if isinstance(resamples, bool) or int(resamples) != resamples or resamples < 1:
        raise UsageError(f"resamples: found {resamples!r}; allowed are whole numbers from 1")
    return _blocks(strata, int(resamples), np.random.default_rng(seed))


def _blocks(strata: Index, resamples: int, generator: np.random.Generator) -> Iterator[Index]:
    n = len(strata)
    members = np.argsort(strata, kind="stable")
    _, first, inverse, sizes = np.unique(
        strata[members], return_index=True, return_inverse=True, return_counts=True
    )
    start, size = first[inverse], sizes[inverse]
    block = max(1, _BLOCK // n)
    for done in range(0, resamples, block):
        rows = min(block, resamples - done)
        drawn = members[start + (generator.random((rows, n)) * size).astype(np.int64)]
        drawn += n * np.arange(rows)[:, None]
        yield np.bincount(drawn.ravel(), minlength=rows * n).reshape(rows, n)
