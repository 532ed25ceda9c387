"""The scale that scores are averaged and compared on: theirs, or decades."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError

Scale = Literal["linear", "log10"]
FLOOR = 1e-12
"""On ``log10``, what is smaller counts as this, in the scores' unit: zeros must count as something."""


def to_scale(values: Array, scale: Scale, floor: float) -> Array:
    """Values on a scale.

    Args:
        values: Any shape; inf stays inf.
        scale: ``"linear"``, as they are, or ``"log10"``.
        floor: What smaller values count as on ``"log10"``; not used on ``"linear"``.

    Raises:
        UsageError: If the scale is neither; on ``log10`` also if values are negative, or the floor
            is not positive.
    """
    if scale == "linear":
        return values
    if scale != "log10":
        raise UsageError(f"scale: found {scale!r}; allowed are 'linear' and 'log10'")
    if not 0.0 < floor < np.inf:
        raise UsageError(f"floor: found {floor!r}; allowed on scale 'log10' are finite numbers > 0")
    if (values < 0.0).any():
        raise UsageError(
            f"values: found {values.min():.6g}; scale 'log10' has no negative values, "
            "use scale='linear'"
        )
    return np.asarray(np.log10(np.maximum(values, floor)))


def from_scale(values: Array, scale: Scale) -> Array:
    """The inverse of :func:`to_scale`, above the floor."""
    return values if scale == "linear" else np.asarray(np.power(10.0, values))
