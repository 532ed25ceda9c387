"""What both stages do over a tick with the n that they chose: u = -k n on a transpose."""

from __future__ import annotations

from mobman.arrays import Matrix, Vector
from mobman.kernels.dense import apply_transpose, gram
from mobman.kernels.kernel import kernel


@kernel
def end_without_control(s: Vector, residual: Vector, dt: float, b: Vector) -> None:
    """What s would be at the tick's end."""
    for i in range(s.shape[0]):
        b[i] = s[i] + dt * residual[i]


@kernel
def transpose_gram(J: Matrix, k: Vector, dt: float, matrix: Matrix) -> None:
    """dt k J J^T: what n takes away from s over the tick."""
    gram(J, matrix)
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] *= dt * k[0]


@kernel
def transpose_rate(J: Matrix, k: Vector, n: Vector, rate: Vector) -> None:
    """rate = J^T u with u = -k n: v_ref' (35), (43) of (34), (44), and with B for J v' (56) of (55)."""
    apply_transpose(J, n, rate)
    for i in range(rate.shape[0]):
        rate[i] *= -k[0]


@kernel
def integrate(rate: Vector, dt: float, integral: Vector) -> None:
    """integral += dt rate."""
    for i in range(rate.shape[0]):
        integral[i] += dt * rate[i]
