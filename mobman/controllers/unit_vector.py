"""The unit vector s/|s| of (34), (44), (55) and (66): as printed, and discretised implicitly.

Evaluated at the tick's start (explicit), the unit vector chatters. Evaluated at the tick's **end**
(implicit, after Acary and Brogliato) it does not: with :math:`s^+ = b - P n`, where b is the value
that s would have without control and P n what the control takes away over the tick, n is the unit
vector of :math:`s^+` itself, or any vector of the unit ball that gives :math:`s^+ = 0`.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.kernels import cholesky
from mobman.kernels.dense import apply, apply_transpose, dot, gram, norm
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call

NOT_DEFINITE = 3
"""Status: the metric is not positive definite."""

_ITERATIONS = 60
_TOLERANCE = 1e-12

_factor, _solve = cholesky.factor, cholesky.solve


@kernel
def explicit_unit_vector(s: Vector, boundary_layer: float, n: Vector) -> None:
    """n = s/|s|, or s/boundary_layer where |s| is below it; 0 at s = 0."""
    size = max(norm(s), boundary_layer)
    for i in range(s.shape[0]):
        n[i] = s[i] / size if size > 0.0 else 0.0


@kernel
def implicit_unit_vector(
    metric: Matrix,
    gram: Matrix,
    b: Vector,
    boundary_layer: float,
    n: Vector,
    right: Vector,
    lower: Matrix,
    column: Vector,
) -> int:
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
        right: Work space, shape (p,).
        lower: Work space, shape (p, p).
        column: Work space, shape (p,).

    Returns:
        0, or NOT_DEFINITE.
    """
    apply(metric, b, right)
    sigma = boundary_layer
    if not _shifted_factor(metric, gram, sigma, lower):
        _solve(lower, right, n)
        if dot(n, n) <= 1.0:
            return 0
    # |n| = 1: s+ = sigma n, so sigma = |s+|, which lies between the boundary layer and 2|b| or more.
    # The same where K has lost its rank: the equivalent control does not exist.
    low, high = sigma, norm(b)
    if not high > 0.0:
        for i in range(n.shape[0]):
            n[i] = b[i]  # 0, or not a number
        return 0
    while True:
        if _shifted_factor(metric, gram, high, lower):
            return NOT_DEFINITE
        _solve(lower, right, n)
        if not norm(n) > 1.0:
            break
        low, high = high, 2.0 * high
    sigma = high
    for _ in range(_ITERATIONS):
        if _shifted_factor(metric, gram, sigma, lower):
            return NOT_DEFINITE
        _solve(lower, right, n)
        length = norm(n)
        if abs(length - 1.0) < _TOLERANCE:
            break
        if length > 1.0:
            low = sigma
        else:
            high = sigma
        # d|n|/dsigma = -n . (sigma M + K)^-1 M n / |n|
        apply(metric, n, column)
        _solve(lower, column, column)
        slope = -dot(n, column) / length
        newton = sigma - (length - 1.0) * length / slope if slope < 0.0 else math.inf
        sigma = newton if low < newton < high else 0.5 * (low + high)
    length = norm(n)
    for i in range(n.shape[0]):
        n[i] /= length
    return 0


@kernel
def _shifted_factor(metric: Matrix, gram: Matrix, sigma: float, lower: Matrix) -> int:
    """The Cholesky factor of sigma M + K; its status."""
    for i in range(metric.shape[0]):
        for j in range(i + 1):
            lower[i, j] = sigma * metric[i, j] + gram[i, j]
    return _factor(lower, lower)


Discretization = Literal["implicit", "explicit"]
DISCRETIZATIONS: tuple[Discretization, ...] = ("implicit", "explicit")


def unit_vector_steps(
    discretization: Discretization,
    boundary_layer: float,
    s: Array,
    b: Array,
    metric: Array,
    gram: Array,
    n: Array,
) -> list[Call]:
    """Steps that choose n for a tick that starts at s.

    Args:
        discretization: ``"implicit"``, the unit vector of s at the tick's end, or ``"explicit"``, as
            printed, at its start.
        boundary_layer: Width of the boundary layer, 0 for none.
        s: The sliding variable now, shape (p,).
        b: What it would be at the tick's end without control, shape (p,).
        metric: See :func:`implicit_unit_vector`.
        gram: See :func:`implicit_unit_vector`.
        n: For the result, shape (p,).
    """
    layer = float(boundary_layer)
    if discretization == "explicit":
        return [call(explicit_unit_vector, s, layer, n)]
    work = (np.zeros_like(s), np.zeros_like(gram), np.zeros_like(s))
    return [call(implicit_unit_vector, metric, gram, b, layer, n, *work)]


@kernel
def end_without_control(s: Vector, residual: Vector, dt: float, b: Vector) -> None:
    """The value that s would have at the tick's end without control."""
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


@kernel
def signed_power(x: float, exponent: float) -> float:
    """sign(x) |x|^exponent: what the paper's odd roots mean."""
    return math.copysign(math.pow(abs(x), exponent), x)
