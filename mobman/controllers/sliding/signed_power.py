"""The powers of (31) and (51)."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array


def signed_power(x: Array, exponent: float) -> Array:
    """sign(x) |x|^exponent, component by component: what the paper's odd roots mean."""
    power: Array = np.copysign(np.abs(x) ** exponent, x)
    return power
