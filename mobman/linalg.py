"""Small dense linear algebra for compiled functions: vectors and matrices of the size of a robot.

Plain loops that write into arrays that they are given: at 5 to 40 rows a call of BLAS costs more than
its arithmetic.
"""

from __future__ import annotations

import math

from mobman.arrays import Matrix, Vector
from mobman.compiled import kernel

_ROUNDING = 1e-14  # of the largest pivot: what rounding leaves of a pivot that should be 0


@kernel
def dot(a: Vector, b: Vector) -> float:
    """a . b."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def norm(a: Vector) -> float:
    """Euclidean length."""
    return math.sqrt(dot(a, a))


@kernel
def copy(a: Matrix, to: Matrix) -> None:
    """to = A; an assignment to to[:] would allocate."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            to[i, j] = a[i, j]


@kernel
def apply(a: Matrix, x: Vector, y: Vector) -> None:
    """y = A x."""
    for i in range(a.shape[0]):
        y[i] = dot(a[i], x)


@kernel
def apply_transpose(a: Matrix, x: Vector, y: Vector) -> None:
    """y = A^T x, by four rows at a time: y is read and written a quarter as often."""
    fours = a.shape[0] - a.shape[0] % 4
    for j in range(a.shape[1]):
        y[j] = 0.0
    for i in range(0, fours, 4):
        x0, x1, x2, x3 = x[i], x[i + 1], x[i + 2], x[i + 3]
        for j in range(a.shape[1]):
            first = (y[j] + a[i, j] * x0) + a[i + 1, j] * x1
            y[j] = (first + a[i + 2, j] * x2) + a[i + 3, j] * x3
    for i in range(fours, a.shape[0]):
        for j in range(a.shape[1]):
            y[j] += a[i, j] * x[i]


@kernel
def multiply(a: Matrix, b: Matrix, c: Matrix) -> None:
    """C = A B."""
    for i in range(a.shape[0]):
        apply_transpose(b, a[i], c[i])


@kernel
def gram(a: Matrix, c: Matrix) -> None:
    """C = A A^T, symmetric to the last bit; by two rows and two columns, with half the reading."""
    last = a.shape[0] - 1
    for i in range(0, last + 1, 2):
        i1 = min(i + 1, last)  # of an odd number of rows, the last one stands for two
        for j in range(0, i + 1, 2):
            j1 = min(j + 1, last)
            s00 = s01 = s10 = s11 = 0.0
            for k in range(a.shape[1]):
                s00 += a[i, k] * a[j, k]
                s01 += a[i, k] * a[j1, k]
                s10 += a[i1, k] * a[j, k]
                s11 += a[i1, k] * a[j1, k]
            c[i, j], c[i, j1], c[i1, j], c[i1, j1] = s00, s01, s10, s11
            c[j, i], c[j1, i], c[j, i1], c[j1, i1] = s00, s01, s10, s11


@kernel
def cholesky(a: Matrix, lower: Matrix) -> int:
    """L with L L^T = A, from and to the lower triangles alone; ``lower`` may be ``a`` itself.

    Returns:
        0, or the order of the first leading minor that is not positive.
    """
    for j in range(a.shape[0]):
        for i in range(j, a.shape[0]):
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
    """True if a Cholesky factor's matrix has its full rank beyond rounding."""
    least = greatest = lower[0, 0]
    for i in range(1, lower.shape[0]):
        least = min(least, lower[i, i])
        greatest = max(greatest, lower[i, i])
    return bool(least * least >= _ROUNDING * greatest * greatest)


@kernel
def cholesky_solve(lower: Matrix, b: Vector, x: Vector) -> None:
    """x = (L L^T)^-1 b; x may be b itself."""
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


@kernel
def cholesky_solve_columns(lower: Matrix, x: Matrix, n: int) -> None:
    """The first n columns of X = (L L^T)^-1 X, each as :func:`cholesky_solve` gives it."""
    for i in range(lower.shape[0]):
        for k in range(i):
            for c in range(n):
                x[i, c] -= lower[i, k] * x[k, c]
        for c in range(n):
            x[i, c] /= lower[i, i]
    for i in range(lower.shape[0] - 1, -1, -1):
        for c in range(n):
            x[i, c] /= lower[i, i]
        for k in range(i):
            for c in range(n):
                x[k, c] -= lower[i, k] * x[i, c]


@kernel
def solve(a: Matrix, b: Vector, x: Vector, work: Matrix) -> int:
    """x with A x = b, by Gaussian elimination with partial pivoting; not in the place of b.

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
