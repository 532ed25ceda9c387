"""Kernels of the extended Jacobian; the symbols are those of :mod:`.extended_jacobian`.

Sizes: s = m + k rows of j, nq coordinates, nz velocities, nz - m auxiliary coordinates.
"""

from __future__ import annotations

from mobman.arrays import Index, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.kernels import cholesky
from mobman.kernels.dense import apply, apply_transpose, dot, gram, multiply

SINGULAR = 1
"""Status: j has lost its rank."""
GAUGE_LOST = 2
"""Status: the complement is too far from ker j to be carried there."""

_NEWTON_SCHULZ = 1e-2  # |X X^T - I| below which the polar factor is found by iteration
_ROUNDING = 1e-15  # |X X^T - I| of an orthonormal complement
_QUADRATIC = 1e-8  # below it one iteration more leaves rounding only

_factor, _solve, _well_posed = cholesky.factor, cholesky.solve, cholesky.well_posed


@kernel
def stack(tip_rows: Matrix, A: Matrix, j: Matrix, m: int) -> None:
    """j = [J_f; A 0] under (11), or the rate of it."""
    for row in range(m):
        for i in range(j.shape[1]):
            j[row, i] = tip_rows[row, i]
    for row in range(A.shape[0]):
        for i in range(j.shape[1]):
            j[m + row, i] = A[row, i]


@kernel
def factorise(j: Matrix, lower: Matrix) -> int:
    """The Cholesky factor of j j^T, shape (s, s)."""
    gram(j, lower)
    if _factor(lower, lower) != 0 or not _well_posed(lower):
        return SINGULAR
    return 0


@kernel
def carry(
    j: Matrix, lower: Matrix, complement: Matrix, projected: Matrix, defect: Matrix, row: Vector
) -> int:
    r"""The orthonormal rows of ker j nearest to ``complement``: polar(N Proj_ker j), in its place.

    Near the last configuration N N^T is I to second order in the step, and a few Newton-Schulz
    iterations give the polar factor to working precision.

    Args:
        j: Shape (s, nq).
        lower: Factor of j j^T.
        complement: N at the last configuration, overwritten, shape (nz - m, nq).
        projected: Work space, shape (nz - m, nq); N Proj_ker j where the gauge is lost.
        defect: Work space, shape (nz - m, nz - m).
        row: Work space, shape (s,).
    """
    rows, nq = complement.shape
    for i in range(rows):
        apply(j, complement[i], row)
        _solve(lower, row, row)
        apply_transpose(j, row, projected[i])
        for c in range(nq):
            projected[i, c] = complement[i, c] - projected[i, c]
    for _ in range(4):
        gram(projected, defect)
        size = 0.0
        for i in range(rows):
            defect[i, i] -= 1.0
            for k in range(rows):
                size = max(size, abs(defect[i, k]))
        if not size <= _NEWTON_SCHULZ:
            return GAUGE_LOST
        if size < _ROUNDING:
            break
        # X - (X X^T - I) X / 2
        multiply(defect, projected, complement)
        for i in range(rows):
            for c in range(nq):
                projected[i, c] -= 0.5 * complement[i, c]
        if size < _QUADRATIC:
            break
    for i in range(rows):
        for c in range(nq):
            complement[i, c] = projected[i, c]
    return 0


@kernel
def coordinates(position: Vector, complement: Matrix, g: Vector, f: Vector, m: int) -> None:
    """f = (f_e, f_a) of (13), with f_a = N g (11)."""
    for i in range(m):
        f[i] = position[i]
    for i in range(complement.shape[0]):
        f[m + i] = dot(complement[i], g)


@kernel
def multipliers(lower: Matrix, j: Matrix, g: Vector, multiplier: Vector) -> None:
    """lam = -(j^+)^T g = -(j j^T)^-1 j g, shape (s,)."""
    apply(j, g, multiplier)
    _solve(lower, multiplier, multiplier)
    for i in range(multiplier.shape[0]):
        multiplier[i] = -multiplier[i]


@kernel
def add_task_hessian(jacobian: Matrix, multiplier: Vector, m: int, hessian: Matrix) -> None:
    r"""Add d(J_f^T lam)/dq at fixed lam, shape (nq, nq), for a task of m tip coordinates.

    Moving joint i turns everything behind it by w_i, so :math:`\partial v_j/\partial q_i = w_i \times
    v_j` for i before j along the chain, and the Hessian is symmetric.

    Args:
        jacobian: Of the tip, columns (v, w), shape (6, nq).
        multiplier: lam, at least m entries.
        m: 3 or 2.
        hessian: Shape (nq, nq).
    """
    a, b = multiplier[0], multiplier[1]
    c = multiplier[2] if m > 2 else 0.0
    for i in range(jacobian.shape[1]):
        w0, w1, w2 = jacobian[3, i], jacobian[4, i], jacobian[5, i]
        # lam . (w x v) = v . (lam x w)
        u0, u1, u2 = b * w2 - c * w1, c * w0 - a * w2, a * w1 - b * w0
        if u0 == 0.0 and u1 == 0.0 and u2 == 0.0:
            continue
        for j in range(i, jacobian.shape[1]):
            entry = jacobian[0, j] * u0 + jacobian[1, j] * u1 + jacobian[2, j] * u2
            hessian[i, j] += entry
            if j > i:
                hessian[j, i] += entry


@kernel
def add_task_hessian_rate(
    jacobian: Matrix, rate: Matrix, multiplier: Vector, m: int, hessian_rate: Matrix
) -> None:
    """Add the rate of :func:`add_task_hessian` along q' at fixed lam; ``rate`` is the Jacobian's."""
    a, b = multiplier[0], multiplier[1]
    c = multiplier[2] if m > 2 else 0.0
    for i in range(jacobian.shape[1]):
        w0, w1, w2 = jacobian[3, i], jacobian[4, i], jacobian[5, i]
        r0, r1, r2 = rate[3, i], rate[4, i], rate[5, i]
        u0, u1, u2 = b * w2 - c * w1, c * w0 - a * w2, a * w1 - b * w0
        d0, d1, d2 = b * r2 - c * r1, c * r0 - a * r2, a * r1 - b * r0
        for j in range(i, jacobian.shape[1]):
            entry = (
                rate[0, j] * u0
                + rate[1, j] * u1
                + rate[2, j] * u2
                + jacobian[0, j] * d0
                + jacobian[1, j] * d1
                + jacobian[2, j] * d2
            )
            hessian_rate[i, j] += entry
            if j > i:
                hessian_rate[j, i] += entry


@kernel
def curvature(
    H: Matrix,
    tip_jacobian: Matrix,
    platform_index: Index,
    A_x: Tensor,
    multiplier: Vector,
    m: int,
    total: Matrix,
) -> None:
    """H + D(lam), shape (nq, nq), with D(lam) = d(j^T lam)/dq at fixed lam."""
    nq = H.shape[0]
    for i in range(nq):
        for c in range(nq):
            total[i, c] = H[i, c]
    add_task_hessian(tip_jacobian, multiplier, m, total)
    _add_constraint_hessian(platform_index, A_x, multiplier, m, total)


@kernel
def curvature_rate(
    H_rate: Matrix,
    tip_jacobian: Matrix,
    tip_jacobian_rate: Matrix,
    platform_index: Index,
    A_x_rate: Tensor,
    multiplier: Vector,
    m: int,
    total: Matrix,
) -> None:
    """H' + D'(lam) at fixed lam, shape (nq, nq)."""
    nq = H_rate.shape[0]
    for i in range(nq):
        for c in range(nq):
            total[i, c] = H_rate[i, c]
    add_task_hessian_rate(tip_jacobian, tip_jacobian_rate, multiplier, m, total)
    _add_constraint_hessian(platform_index, A_x_rate, multiplier, m, total)


@kernel
def _add_constraint_hessian(
    platform_index: Index, A_x: Tensor, multiplier: Vector, m: int, hessian: Matrix
) -> None:
    """Add d([A 0]^T lam_A)/dq, or its rate."""
    k, l, _ = A_x.shape
    for row in range(k):
        for i in range(l):
            for c in range(l):
                hessian[platform_index[i], platform_index[c]] += (
                    multiplier[m + row] * A_x[row, i, c]
                )


@kernel
def reduce(
    rows: Matrix, platform_index: Index, arm_index: Index, N: Matrix, reduced: Matrix
) -> None:
    """rows C, for C = blkdiag(N, I) of (9)."""
    l, p = N.shape
    for i in range(rows.shape[0]):
        for a in range(p):
            entry = 0.0
            for c in range(l):
                entry += rows[i, platform_index[c]] * N[c, a]
            reduced[i, a] = entry
        for c in range(arm_index.shape[0]):
            reduced[i, p + c] = rows[i, arm_index[c]]


@kernel
def task_rates(
    j: Matrix,
    j_rate: Matrix,
    platform_index: Index,
    arm_index: Index,
    N: Matrix,
    q_dot: Vector,
    C_dot_z: Vector,
    m: int,
    J: Matrix,
    J_dot_z: Vector,
) -> None:
    """j_e = J_f C of (43) and J' z = J_f' q' + J_f C' z: the first m rows of J and J' z."""
    reduce(j[:m], platform_index, arm_index, N, J)
    for i in range(m):
        J_dot_z[i] = dot(j_rate[i], q_dot) + dot(j[i], C_dot_z)


@kernel
def auxiliary_rates(
    lower: Matrix,
    j: Matrix,
    j_rate: Matrix,
    complement: Matrix,
    g: Vector,
    multiplier: Vector,
    total: Matrix,
    total_rate: Matrix,
    platform_index: Index,
    arm_index: Index,
    N: Matrix,
    q_dot: Vector,
    C_dot_z: Vector,
    m: int,
    J: Matrix,
    J_dot_z: Vector,
    rows: Matrix,
    column: Vector,
    other: Vector,
    transport: Vector,
    multiplier_rate: Vector,
) -> None:
    """The rows of J and J' z that belong to f_a: J_a = N (H + D) C, and the rate of J_a z.

    The last five are work space: shapes (nz - m, nq), (nq,), (nq,), (s,), (s,).
    """
    nq = j.shape[1]
    s = j.shape[0]
    multiply(complement, total, rows)
    reduce(rows, platform_index, arm_index, N, J[m:])
    # N' (H + D) q' = -N j'^T transport, since N' = -N j'^T (j^+)^T
    apply(total, q_dot, column)
    apply(j, column, transport)
    _solve(lower, transport, transport)
    # lam' = -(j j^T)^-1 (j' (g + j^T lam) + j (H + D) q')
    apply_transpose(j, multiplier, column)
    for c in range(nq):
        column[c] += g[c]
    apply(j_rate, column, multiplier_rate)
    _solve(lower, multiplier_rate, multiplier_rate)
    for i in range(s):
        # D(lam') q' = j'^T lam'; with the transport above, both through j'^T
        multiplier_rate[i] = -multiplier_rate[i] - 2.0 * transport[i]
    apply_transpose(j_rate, multiplier_rate, column)
    apply(total_rate, q_dot, other)
    for c in range(nq):
        column[c] += other[c]
    apply(total, C_dot_z, other)
    for c in range(nq):
        column[c] += other[c]
    for i in range(complement.shape[0]):
        J_dot_z[m + i] = dot(complement[i], column)
