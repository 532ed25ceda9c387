"""Cholesky factors of small symmetric positive definite matrices, straight from LAPACK.

scipy's checked wrappers cost several times the factorisation itself at these sizes.
"""

from __future__ import annotations

from scipy.linalg.lapack import dpotrf, dpotrs

from mobman.arrays import Array
from mobman.errors import SingularityError

_ROUNDING = 1e-14  # of the largest pivot: what rounding leaves of a pivot that should be 0


class Cholesky:
    """The factor of a symmetric positive definite matrix.

    Args:
        matrix: Shape (n, n); only its lower triangle is read.
        what: What to call it if it is not positive definite.
        well_posed: Also refuse a matrix whose rank is lost to rounding only.

    Raises:
        SingularityError: If it is not positive definite to working precision.
    """

    __slots__ = ("_factor",)

    def __init__(self, matrix: Array, what: str = "matrix", well_posed: bool = False) -> None:
        self._factor, info = dpotrf(matrix, lower=1)
        if info != 0:
            raise SingularityError(f"{what} is not positive definite (leading minor {info})")
        if well_posed:
            pivots = self._factor.diagonal()
            if pivots.min() ** 2 < _ROUNDING * pivots.max() ** 2:
                raise SingularityError(f"{what} is singular to working precision")

    def solve(self, right: Array) -> Array:
        """matrix^-1 right, for right of shape (n,) or (n, p)."""
        solution: Array = dpotrs(self._factor, right, lower=1)[0]
        return solution
