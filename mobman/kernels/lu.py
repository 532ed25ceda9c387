"""Small systems of linear equations."""

from __future__ import annotations

import math

from mobman.arrays import Matrix, Vector
from mobman.kernels.kernel import kernel


@kernel
def solve(a: Matrix, b: Vector, x: Vector, work: Matrix) -> int:
    """x with A x = b, by Gaussian elimination with partial pivoting.

    Args:
        a: Shape (n, n).
        b: Shape (n,).
        x: For the result, shape (n,); not b itself.
        work: Shape (n, n).

    Returns:
        0, or the number of the pivot that is 0 or not finite.
    """
    n = a.shape[0]
    for i in range(n):
        x[i] = b[i]
        for j in range(n):
            work[i, j] = a[i, j]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if work[pivot, k] == 0.0 or not math.isfinite(work[pivot, k]):
            return k + 1
        if pivot != k:
            for j in range(k, n):
                work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
            x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, n):
            factor = work[i, k] / work[k, k]
            for j in range(k + 1, n):
                work[i, j] -= factor * work[k, j]
            x[i] -= factor * x[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= work[i, j] * x[j]
        x[i] /= work[i, i]
    return 0
