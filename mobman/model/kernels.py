"""Kernels of the model: what is done with Pinocchio's matrices and the platform's."""

from __future__ import annotations

from mobman.arrays import Columns, Index, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.kernels.dense import dot


@kernel
def gather(platform_index: Index, q: Vector, z: Vector, x: Vector, alpha: Vector) -> None:
    """x and alpha out of q and z."""
    for i in range(x.shape[0]):
        x[i] = q[platform_index[i]]
    for i in range(alpha.shape[0]):
        alpha[i] = z[i]


@kernel
def assemble_velocity(
    platform_index: Index,
    arm_index: Index,
    alpha: Vector,
    z: Vector,
    x_dot: Vector,
    N: Matrix,
    N_rate: Matrix,
    q_dot: Vector,
    C: Matrix,
    C_dot_z: Vector,
) -> None:
    """C = blkdiag(N, I) of (9), q' = C z and C' z, in q's order."""
    p = alpha.shape[0]
    for i in range(x_dot.shape[0]):
        row = platform_index[i]
        q_dot[row] = x_dot[i]
        C_dot_z[row] = 0.0
        for j in range(p):
            C[row, j] = N[i, j]
            C_dot_z[row] += N_rate[i, j] * alpha[j]
    for j in range(arm_index.shape[0]):
        q_dot[arm_index[j]] = z[p + j]
        C[arm_index[j], p + j] = 1.0


@kernel
def assemble_constraints(
    platform_index: Index,
    x_dot: Vector,
    platform_A: Matrix,
    A_x: Tensor,
    A: Matrix,
    A_rate: Matrix,
) -> None:
    """[A 0] of (16) and its rate, in q's order."""
    l = x_dot.shape[0]
    for i in range(platform_A.shape[0]):
        for j in range(l):
            A[i, platform_index[j]] = platform_A[i, j]
            A_rate[i, platform_index[j]] = dot(A_x[i, j], x_dot)


@kernel
def symmetric(matrix: Columns, i: int, j: int) -> float:
    """An entry of the symmetric matrix whose upper triangle is given: what crba writes."""
    return float(matrix[i, j]) if i <= j else float(matrix[j, i])


@kernel
def reduced_inertia(
    inertia: Columns,
    platform_index: Index,
    arm_index: Index,
    N: Matrix,
    actuation: Matrix,
    M: Matrix,
    B: Matrix,
) -> None:
    """M = C^T M' C and B = C^T B' of (17), by blocks of C = blkdiag(N, I).

    Args:
        inertia: M', its upper triangle, shape (nq, nq).
        platform_index: Where x is in q.
        arm_index: Where y is in q, increasing.
        N: Shape (l, l-k).
        actuation: B'' of the platform, shape (l, l-k).
        M: For the inertia, shape (nz, nz).
        B: For the actuation, shape (nz, nz); its platform's block is written, the rest is that of I.
    """
    l, p = N.shape
    n = arm_index.shape[0]
    for a in range(p):
        for b in range(p):
            M[a, b] = 0.0
            B[a, b] = 0.0
            for i in range(l):
                B[a, b] += N[i, a] * actuation[i, b]
        for j in range(n):
            M[a, p + j] = 0.0
    for i in range(l):
        row = platform_index[i]
        for j in range(i + 1):
            entry = symmetric(inertia, row, platform_index[j])
            for a in range(p):
                for b in range(p):
                    M[a, b] += N[i, a] * entry * N[j, b]
                    if i != j:
                        M[a, b] += N[j, a] * entry * N[i, b]
        for j in range(n):
            entry = symmetric(inertia, row, arm_index[j])
            for a in range(p):
                M[a, p + j] += N[i, a] * entry
    for j in range(n):
        column = arm_index[j]
        for a in range(p):
            M[p + j, a] = M[a, p + j]
        for i in range(j + 1):  # arm_index increases
            entry = inertia[arm_index[i], column]
            M[p + i, p + j] = entry
            M[p + j, p + i] = entry


@kernel
def reduced_bias(
    inertia: Columns,
    nonlinear: Vector,
    platform_index: Index,
    arm_index: Index,
    N: Matrix,
    C_dot_z: Vector,
    bias: Vector,
) -> None:
    """Pz + G = C^T (M' C' z + nonlinear) of (17); C' z has entries in the platform's rows only.

    Args:
        inertia: M', its upper triangle, shape (nq, nq).
        nonlinear: Coriolis, centrifugal and gravity terms in q, shape (nq,).
        platform_index: Where x is in q.
        arm_index: Where y is in q.
        N: Shape (l, l-k).
        C_dot_z: C' z, shape (nq,).
        bias: For the result, shape (nz,).
    """
    l, p = N.shape
    for a in range(p):
        bias[a] = 0.0
    for i in range(l):
        entry = nonlinear[platform_index[i]]
        for j in range(l):
            entry += (
                symmetric(inertia, platform_index[i], platform_index[j])
                * C_dot_z[platform_index[j]]
            )
        for a in range(p):
            bias[a] += N[i, a] * entry
    for i in range(arm_index.shape[0]):
        entry = nonlinear[arm_index[i]]
        for j in range(l):
            entry += (
                symmetric(inertia, arm_index[i], platform_index[j]) * C_dot_z[platform_index[j]]
            )
        bias[p + i] = entry


@kernel
def tip_position(rotation: Columns, translation: Vector, offset: Vector, position: Vector) -> None:
    """The tip in the world, from the placement of the joint that carries it."""
    for i in range(3):
        position[i] = translation[i]
        for j in range(3):
            position[i] += rotation[i, j] * offset[j]


@kernel
def tip_kinematics(
    jacobian_origin: Columns,
    rate_origin: Columns,
    chain: Vector,
    position: Vector,
    q_dot: Vector,
    jacobian: Matrix,
    rate: Matrix,
) -> None:
    """The tip's Jacobian and its rate in world axes, linear rows first.

    Pinocchio keeps the columns of all joints for a point at the world's origin: the tip's velocity is
    v + w x p, its rate v' + w' x p + w x p', for the joints that carry it.

    Args:
        jacobian_origin: Columns of all joints, shape (6, nq).
        rate_origin: Their rates, shape (6, nq).
        chain: 1 for the joints that move the tip, else 0, shape (nq,).
        position: p (m), shape (3,).
        q_dot: Shape (nq,).
        jacobian: For the result, shape (6, nq).
        rate: For the result, shape (6, nq).
    """
    x, y, z = position[0], position[1], position[2]
    x_dot = y_dot = z_dot = 0.0
    for j in range(chain.shape[0]):
        on = chain[j]
        w0, w1, w2 = jacobian_origin[3, j], jacobian_origin[4, j], jacobian_origin[5, j]
        jacobian[0, j] = on * (jacobian_origin[0, j] + w1 * z - w2 * y)
        jacobian[1, j] = on * (jacobian_origin[1, j] + w2 * x - w0 * z)
        jacobian[2, j] = on * (jacobian_origin[2, j] + w0 * y - w1 * x)
        jacobian[3, j], jacobian[4, j], jacobian[5, j] = on * w0, on * w1, on * w2
        x_dot += jacobian[0, j] * q_dot[j]
        y_dot += jacobian[1, j] * q_dot[j]
        z_dot += jacobian[2, j] * q_dot[j]
    for j in range(chain.shape[0]):
        on = chain[j]
        w0, w1, w2 = jacobian[3, j], jacobian[4, j], jacobian[5, j]
        r0, r1, r2 = rate_origin[3, j], rate_origin[4, j], rate_origin[5, j]
        rate[0, j] = on * (rate_origin[0, j] + r1 * z - r2 * y) + w1 * z_dot - w2 * y_dot
        rate[1, j] = on * (rate_origin[1, j] + r2 * x - r0 * z) + w2 * x_dot - w0 * z_dot
        rate[2, j] = on * (rate_origin[2, j] + r0 * y - r1 * x) + w0 * y_dot - w1 * x_dot
        rate[3, j], rate[4, j], rate[5, j] = on * r0, on * r1, on * r2
