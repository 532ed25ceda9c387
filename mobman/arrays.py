"""The types of arrays in mobman: double precision, and indices; and how large numbers may be.

The named shapes say what compiled functions (:mod:`mobman.compiled`) take; to a type checker they are
all alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Vector = NDArray[np.float64]
"""Shape (n,)."""
Matrix = NDArray[np.float64]
"""Shape (n, m), by rows in memory."""
Columns = NDArray[np.float64]
"""Shape (n, m), by columns in memory, as Pinocchio's."""
Tensor = NDArray[np.float64]
"""Shape (n, m, l), by rows in memory."""
Index = NDArray[np.int64]
"""Shape (n,), of whole numbers."""

SMALLEST, LARGEST = 1e-30, 1e15
"""Sizes of the numbers that users may give, other than 0: far beyond those of any robot, and products of
several of them are still finite and not 0."""
SIZES = f"0, or of a size from {SMALLEST:g} to {LARGEST:g}"
"""The same for messages."""


def beyond_sizes(value: Any) -> bool:
    """True if a number, or one in a list or mapping, is infinite or of a size that is not allowed."""
    if isinstance(value, Mapping):
        return any(map(beyond_sizes, value.values()))
    if isinstance(value, (list, tuple, np.ndarray)):
        return any(map(beyond_sizes, np.ravel(value) if isinstance(value, np.ndarray) else value))
    if not isinstance(value, (float, np.floating)):
        return False
    return value != 0.0 and not SMALLEST <= abs(float(value)) <= LARGEST
