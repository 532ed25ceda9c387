"""The unit vector s/|s| of (34), (44), (55) and (66): as printed, and discretised implicitly.

Evaluated at the tick's start (explicit), the unit vector chatters. Evaluated at the tick's **end**
(implicit, after Acary and Brogliato) it does not: with :math:`s^+ = b - P n`, where b is the value
that s would have without control and P n what the control takes away over the tick, n is the unit
vector of :math:`s^+` itself, or any vector of the unit ball that gives :math:`s^+ = 0`.
"""

from __future__ import annotations

import math

from mobman.arrays import Matrix, Vector
from mobman.compiled import kernel
from mobman.linalg import apply, cholesky, cholesky_solve, dot, norm

_ITERATIONS = 60
_TOLERANCE = 1e-12


@kernel
def explicit_unit_vector(s: Vector, boundary_layer: float, n: Vector) -> None:
    """n = s/|s|, or s/boundary_layer where |s| is below it; 0 at s = 0."""
    size = max(norm(s), boundary_layer)
    for i in range(s.shape[0]):
        n[i] = s[i] / size if size > 0.0 else 0.0


@kernel
def implicit_unit_vector(
    metric: Matrix, gram: Matrix, b: Vector, boundary_layer: float, n: Vector, work: Matrix
) -> bool:
    r"""n with :math:`s^+ + P n = b` and :math:`n = s^+/|s^+|` where s+ is not 0.

    P is given as :math:`M^{-1} K` with M and K symmetric, M positive definite and K positive
    semi-definite, so that :math:`(\sigma M + K) n = M b` with :math:`\sigma = |s^+|` is a symmetric
    system. With :math:`\sigma = 0` it is solved by the equivalent control, which is n if it lies in
    the unit ball: the usual case, one Cholesky factorisation. Else :math:`\sigma > 0` is found with
    :math:`|n| = 1` by a safeguarded Newton iteration on :math:`1/|n(\sigma)|`, which is nearly
    linear. A boundary layer of width w replaces :math:`s^+/|s^+|` by :math:`s^+/w` inside it, that
    is, it bounds :math:`\sigma` from below.

    Args:
        metric: M, shape (p, p): I for the kinematic stage, the nominal inertia for the dynamic one.
        gram: K, shape (p, p): dt times gain times J J^T, or B B^T.
        b: Shape (p,).
        boundary_layer: w, 0 for none.
        n: For the result, shape (p,), of norm at most 1.
        work: Work space, shape (p + 2, p).

    Returns:
        False if the metric is not positive definite.
    """
    right, column, lower = work[0], work[1], work[2:]
    apply(metric, b, right)
    sigma = boundary_layer
    if _shifted_factor(metric, gram, sigma, lower):
        cholesky_solve(lower, right, n)
        if dot(n, n) <= 1.0:
            return True
    # |n| = 1: s+ = sigma n, so sigma = |s+|, which lies between the boundary layer and 2|b| or more.
    # The same where K has lost its rank: the equivalent control does not exist.
    low, high = sigma, norm(b)
    if not high > 0.0:
        for i in range(n.shape[0]):
            n[i] = b[i]  # 0, or not a number
        return True
    while True:
        if not _shifted_factor(metric, gram, high, lower):
            return False
        cholesky_solve(lower, right, n)
        if not norm(n) > 1.0:
            break
        low, high = high, 2.0 * high
    sigma = high
    for _ in range(_ITERATIONS):
        if not _shifted_factor(metric, gram, sigma, lower):
            return False
        cholesky_solve(lower, right, n)
        length = norm(n)
        if abs(length - 1.0) < _TOLERANCE:
            break
        if length > 1.0:
            low = sigma
        else:
            high = sigma
        # d|n|/dsigma = -n . (sigma M + K)^-1 M n / |n|
        apply(metric, n, column)
        cholesky_solve(lower, column, column)
        slope = -dot(n, column) / length
        newton = sigma - (length - 1.0) * length / slope if slope < 0.0 else math.inf
        sigma = newton if low < newton < high else 0.5 * (low + high)
    length = norm(n)
    for i in range(n.shape[0]):
        n[i] /= length
    return True


@kernel
def _shifted_factor(metric: Matrix, gram: Matrix, sigma: float, lower: Matrix) -> bool:
    """The Cholesky factor of sigma M + K; False if there is none."""
    for i in range(metric.shape[0]):
        for j in range(i + 1):
            lower[i, j] = sigma * metric[i, j] + gram[i, j]
    return cholesky(lower, lower) == 0
