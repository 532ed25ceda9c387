"""Finite differences that reach ten digits, so that 1e-6 and 1e-8 can be asked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Central differences of order 8: the truncation error is h^8/630 times the ninth derivative, so a
# step as large as 0.004 leaves it below the rounding error, which is about 1e-16/h.
_WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)


def derivative(function: Callable[[float], np.ndarray | float], h: float = 4e-3):
    """d function(s)/ds at s = 0."""
    return (
        sum(
            weight * (function(k * h) - function(-k * h))
            for k, weight in enumerate(_WEIGHTS, start=1)
        )
        / h
    )


def jacobian(function: Callable[[np.ndarray], np.ndarray], q: np.ndarray, h: float = 4e-3):
    """d function(q)/dq, a column for each coordinate."""
    columns = []
    for direction in np.eye(len(q)):
        columns.append(derivative(lambda s, d=direction: function(q + s * d), h))
    return np.array(columns).T


def relative(found, expected) -> float:
    """Largest difference of two arrays over the largest entry of the expected one (or 1)."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    largest = np.abs(expected).max(initial=0.0)
    return float(np.abs(found - expected).max(initial=0.0) / max(1.0, largest))
