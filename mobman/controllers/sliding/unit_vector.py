r"""The unit vector s/|s| of (34), (44), (55) and (66): as printed, and discretised implicitly.

Evaluated at the tick's start (explicit), the unit vector chatters. Evaluated at the tick's **end**
(implicit, after Acary and Brogliato) it does not: with :math:`s^+ = b - P n`, where b is the value
that s would have without control and P n what the control takes away over the tick, n is the unit
vector of :math:`s^+` itself, or any vector of the unit ball that gives :math:`s^+ = 0`.
"""

from __future__ import annotations

import math

from mobman.arrays import Array
from mobman.errors import SingularityError
from mobman.model.cholesky import Cholesky

_ITERATIONS = 60
_TOLERANCE = 1e-12


def unit_vector(s: Array, boundary_layer: float = 0.0) -> Array:
    """s/|s|, or s/boundary_layer where \\|s\\| is below it; 0 at s = 0."""
    size = max(math.sqrt(s @ s), boundary_layer)
    result: Array = s / size if size > 0.0 else 0.0 * s
    return result


def implicit_unit_vector(
    metric: Array, gram: Array, b: Array, boundary_layer: float = 0.0
) -> Array:
    r"""n in the unit ball with :math:`s^+ + P n = b` and :math:`n = s^+/|s^+|` where s+ is not 0.

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

    Returns:
        n, shape (p,), with norm at most 1.
    """
    right = metric @ b
    if not right.any():
        return right
    sigma = boundary_layer
    try:
        n = Cholesky(sigma * metric + gram).solve(right)
        if n @ n <= 1.0:
            return n
    except SingularityError:
        pass  # K has lost its rank: the equivalent control does not exist, n has length 1
    # |n| = 1: s+ = sigma n, so sigma = |s+|, which lies between the boundary layer and 2|b| or more.
    low, high = sigma, math.sqrt(b @ b)
    while _length(metric, gram, right, high) > 1.0:
        low, high = high, 2.0 * high
    sigma = high
    for _ in range(_ITERATIONS):
        factor = Cholesky(sigma * metric + gram)
        n = factor.solve(right)
        length = math.sqrt(n @ n)
        if abs(length - 1.0) < _TOLERANCE:
            break
        low, high = (sigma, high) if length > 1.0 else (low, sigma)
        # d|n|/dsigma = -n . (sigma M + K)^-1 M n / |n|
        slope = -(n @ factor.solve(metric @ n)) / length
        step = (length - 1.0) * length / float(slope) if slope < 0.0 else math.inf
        newton = sigma - step
        sigma = newton if low < newton < high else 0.5 * (low + high)
    result: Array = n / math.sqrt(n @ n)
    return result


def _length(metric: Array, gram: Array, right: Array, sigma: float) -> float:
    n = Cholesky(sigma * metric + gram).solve(right)
    return math.sqrt(n @ n)
