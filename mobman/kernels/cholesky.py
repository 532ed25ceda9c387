"""Cholesky factors of small symmetric positive definite matrices."""

from __future__ import annotations

import math

from mobman.arrays import Matrix, Vector
from mobman.kernels.kernel import kernel

_ROUNDING = 1e-14  # of the largest pivot: what rounding leaves of a pivot that should be 0


@kernel
def factor(a: Matrix, lower: Matrix) -> int:
    """L with L L^T = A.

    Args:
        a: Shape (n, n); only its lower triangle is read.
        lower: For L, shape (n, n); only its lower triangle is written. May be ``a`` itself.

    Returns:
        0, or the order of the first leading minor that is not positive.
    """
    n = a.shape[0]
    for j in range(n):
        for i in range(j, n):
            entry = a[i, j]
            for k in range(j):
                entry -= lower[i, k] * lower[j, k]
            if i > j:
                lower[i, j] = entry / lower[j, j]
            elif entry > 0.0:
                lower[j, j] = math.sqrt(entry)
            else:  # not positive, or not a number
                return j + 1
    return 0


@kernel
def well_posed(lower: Matrix) -> bool:
    """True if a factor's matrix has its full rank beyond rounding."""
    least = greatest = lower[0, 0]
    for i in range(1, lower.shape[0]):
        least = min(least, lower[i, i])
        greatest = max(greatest, lower[i, i])
    return bool(least * least >= _ROUNDING * greatest * greatest)


@kernel
def solve(lower: Matrix, b: Vector, x: Vector) -> None:
    """x = (L L^T)^-1 b, vectors; x may be b itself."""
    n = lower.shape[0]
    for i in range(n):
        entry = b[i]
        for k in range(i):
            entry -= lower[i, k] * x[k]
        x[i] = entry / lower[i, i]
    for i in range(n - 1, -1, -1):
        entry = x[i] / lower[i, i]
        x[i] = entry
        for k in range(i):
            x[k] -= lower[i, k] * entry
