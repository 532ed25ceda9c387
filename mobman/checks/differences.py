"""Derivatives by finite differences that reach nine digits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mobman.arrays import Array

# Central differences of order 8: the truncation error is h^8/630 times the ninth derivative.
_WEIGHTS = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


def derivative(function: Callable[[float], Array], step: float) -> Array:
    """d function(s)/ds at s = 0."""
    terms = [weight * (function(i * step) - function(-i * step)) for i, weight in _WEIGHTS]
    total: Array = np.sum(terms, axis=0) / step
    return total


def relative(found: Array, expected: Array) -> float:
    """Largest difference of two arrays over the largest entry of either, or over 1."""
    both = np.concatenate([np.ravel(found), np.ravel(expected)])
    if both.size == 0:
        return 0.0
    return float(np.abs(found - expected).max() / max(1.0, np.abs(both).max()))
