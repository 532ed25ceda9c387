"""What the statistics take: samples without NaN, in which inf is a failure."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mobman.arrays import Array, Index
from mobman.errors import UsageError


def as_sample(values: ArrayLike, name: str = "values", *, dimensions: int = 1) -> Array:
    """Scores as an array.

    Args:
        values: Numbers, lower is better; inf is a failure.
        name: What they are called in messages.
        dimensions: 1, or 2 for a table.

    Raises:
        UsageError: If they are none, have another shape, or some are NaN or -inf.
    """
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


def as_table(labels: Sequence[str], scores: ArrayLike) -> tuple[list[str], Array]:
    """Labels, and their scores on the same cells: shape (n_labels, n_cells).

    Raises:
        UsageError: If a label is there twice, the shape does not fit, or a score cannot be.
    """
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


def as_strata(strata: Sequence[Hashable] | None, n: int) -> Index:
    """Each value's stratum as a number, in an order that does not depend on the values'.

    Raises:
        UsageError: If there is not one for each of the ``n`` values.
    """
    if strata is None:
        return np.zeros(n, dtype=np.int64)
    given = strata.tolist() if isinstance(strata, np.ndarray) else list(strata)
    if len(given) != n:
        raise UsageError(f"strata: found {len(given)} for {n} values; allowed is one for each")
    number = {stratum: i for i, stratum in enumerate(sorted(set(given), key=repr))}
    return np.array([number[stratum] for stratum in given], dtype=np.int64)
