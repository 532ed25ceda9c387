"""Vectors and matrices of the size of a robot.

Plain loops: at 5 to 40 rows a call of BLAS costs more than its arithmetic.
"""

from __future__ import annotations

import math

from mobman.arrays import Matrix, Vector
from mobman.kernels.kernel import kernel


@kernel
def dot(a: Vector, b: Vector) -> float:
    """a . b of two vectors."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def norm(a: Vector) -> float:
    """Euclidean length of a vector."""
    return math.sqrt(dot(a, a))


@kernel
def copy(a: Vector, to: Vector) -> None:
    """to = a, vectors."""
    for i in range(a.shape[0]):
        to[i] = a[i]


@kernel
def apply(a: Matrix, x: Vector, y: Vector) -> None:
    """y = A x."""
    for i in range(a.shape[0]):
        y[i] = dot(a[i], x)


@kernel
def apply_transpose(a: Matrix, x: Vector, y: Vector) -> None:
    """y = A^T x."""
    for j in range(a.shape[1]):
        y[j] = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            y[j] += a[i, j] * x[i]


@kernel
def multiply(a: Matrix, b: Matrix, c: Matrix) -> None:
    """C = A B."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            c[i, j] = 0.0
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                c[i, j] += a[i, k] * b[k, j]


@kernel
def gram(a: Matrix, c: Matrix) -> None:
    """C = A A^T."""
    for i in range(a.shape[0]):
        for j in range(i + 1):
            c[i, j] = dot(a[i], a[j])
            c[j, i] = c[i, j]
