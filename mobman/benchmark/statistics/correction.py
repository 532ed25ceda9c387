"""Correction of p-values for how many there are."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import false_discovery_control

from mobman.arrays import Array
from mobman.errors import UsageError

Correction = Literal["holm", "benjamini-hochberg"]


def adjust(p_values: ArrayLike, method: Correction = "holm") -> Array:
    """Adjusted p-values: to be held against the threshold that one p-value would be.

    Args:
        p_values: Shape (n,), of one family of tests; none are allowed.
        method: ``"holm"``, for the chance of any false finding, or ``"benjamini-hochberg"``, for the
            share of false ones among the findings.

    Returns:
        Shape (n,), in the same order, none below its p-value and none above 1.

    Raises:
        UsageError: If a p-value is not in [0, 1] or the method is neither.
    """
    try:
        p = np.asarray(p_values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"p_values: expected numbers ({error})") from None
    if p.ndim != 1 or not ((p >= 0.0) & (p <= 1.0)).all():
        raise UsageError("p_values: allowed is a list of numbers from 0 to 1")
    if method == "holm":
        return _holm(p)
    if method == "benjamini-hochberg":
        return np.asarray(false_discovery_control(p, method="bh")) if p.size else p
    raise UsageError(f"method: found {method!r}; allowed are 'holm' and 'benjamini-hochberg'")


def _holm(p: Array) -> Array:
    """The i-th smallest of n times n - i, none below the one before."""
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    return np.minimum(adjusted, 1.0)
