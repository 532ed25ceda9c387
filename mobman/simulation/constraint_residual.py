"""How far a motion is from the platform's constraints."""

from __future__ import annotations

from mobman.arrays import Matrix, Vector
from mobman.kernels.dense import dot
from mobman.kernels.kernel import kernel


@kernel
def largest_residual(A: Matrix, q_dot: Vector, largest: Vector) -> None:
    """The largest entry of A q' up to now; it should be rounding only."""
    for i in range(A.shape[0]):
        largest[0] = max(largest[0], abs(dot(A[i], q_dot)))
