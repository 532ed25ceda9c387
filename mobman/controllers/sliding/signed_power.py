"""The powers of (31) and (51)."""

from __future__ import annotations

import math

from mobman.kernels.kernel import kernel


@kernel
def signed_power(x: float, exponent: float) -> float:
    """sign(x) |x|^exponent: what the paper's odd roots mean."""
    return math.copysign(math.pow(abs(x), exponent), x)
