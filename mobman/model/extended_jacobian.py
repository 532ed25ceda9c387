r"""The extended Jacobian J of (13) and its rate, in closed form for any robot.

With :math:`j = [J_f; A\,0]`, :math:`g = \partial F/\partial q`, multipliers
:math:`\lambda = -(j^+)^T g` and :math:`D(\lambda) = \partial(j^T\lambda)/\partial q` at fixed
:math:`\lambda`, the auxiliary map :math:`f_a = \mathcal N g` (11) has the rate
:math:`\dot f_a = \mathcal N (H + D)\dot q` when the orthonormal rows of :math:`\mathcal N` are
carried along the motion by parallel transport,
:math:`\dot{\mathcal N} = -\mathcal N \dot j^T (j^+)^T`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from mobman.arrays import Array
from mobman.errors import SingularityError
from mobman.model.cholesky import Cholesky
from mobman.model.criterion import Criterion
from mobman.model.mobile_manipulator import MobileManipulator, Velocity
from mobman.model.task_map import TaskMap

_NEWTON_SCHULZ = 1e-2  # |X X^T - I| below which the polar factor is found by iteration


class ExtendedKinematics(NamedTuple):
    """f = (f_e, f_a) and its derivatives at one (q, z)."""

    f_e: Array
    """Tip coordinates of the task (m), shape (m,)."""
    f_a: Array
    """Auxiliary coordinates (11), shape (nz - m,); their axes are the rows of ``complement``."""
    J: Array
    """Extended Jacobian of (13), p' = J z, shape (nz, nz); its first m rows are j_e of (43)."""
    J_dot_z: Array
    """J' z, shape (nz,)."""
    complement: Array
    """Orthonormal rows of ker j, the N of (11), shape (nz - m, nq)."""


def orthonormal_complement(j: Array) -> Array:
    """Some orthonormal rows of ker j, shape (nq - rows, nq).

    Raises:
        SingularityError: If j has not full row rank.
    """
    complement: Array = null_space(j).T
    if len(complement) != j.shape[1] - j.shape[0]:
        raise SingularityError("j = [df_e/dq; A 0] has lost its rank: a kinematic singularity")
    return complement


def extended_kinematics(
    robot: MobileManipulator,
    task_map: TaskMap,
    criterion: Criterion,
    q: Array,
    z: Array,
    complement: Array | None = None,
    velocity: Velocity | None = None,
) -> ExtendedKinematics:
    r"""f, J and J' z at (q, z).

    Args:
        robot: The robot.
        task_map: f_e.
        criterion: F.
        q: Configuration, shape (nq,).
        z: Reduced velocity, shape (nz,).
        complement: :math:`\mathcal N` at a configuration nearby (the last tick's), which is carried
            over to this one; without it some orthonormal complement is chosen. The norm of f_a and
            the singular values of J do not depend on it.
        velocity: ``robot.velocity(q, z)``, if it is known already.

    Raises:
        SingularityError: If j has lost its rank.
    """
    m = task_map.m
    velocity = robot.velocity(q, z) if velocity is None else velocity
    c, q_dot, c_dot_z = velocity
    tip = robot.tip_kinematics(q, z, velocity)
    j = np.concatenate((task_map.jacobian(tip), robot.constraint_matrix(q)))
    j_dot = np.concatenate((task_map.jacobian_rate(tip), robot.constraint_matrix_rate(q, q_dot)))
    gram = _gram(j)
    n_perp = orthonormal_complement(j) if complement is None else _carried(complement, j, gram)

    g = criterion.gradient(q)
    multiplier = -gram.solve(j @ g)
    # H + D(lam), and its part of the rate at fixed lam
    d = task_map.hessian(tip, multiplier[:m]) + robot.constraint_hessian(q, multiplier[m:])
    d_rate = task_map.hessian_rate(tip, multiplier[:m]) + robot.constraint_hessian_rate(
        q, q_dot, multiplier[m:]
    )
    curvature = criterion.hessian(q) + d
    curved = curvature @ q_dot
    # N' = -N j'^T (j^+)^T; lam' = -(j j^T)^-1 (j' (g + j^T lam) + j (H + D) q'); D(lam') q' = j'^T lam'
    transport = gram.solve(j @ curved)
    multiplier_rate = -gram.solve(j_dot @ (g + j.T @ multiplier)) - transport
    a_rate = (
        j_dot.T @ (multiplier_rate - transport)
        + (d_rate + criterion.hessian_rate(q, q_dot)) @ q_dot
        + curvature @ c_dot_z
    )
    return ExtendedKinematics(
        f_e=task_map.position(tip),
        f_a=n_perp @ g,
        J=np.concatenate((j[:m] @ c, n_perp @ (curvature @ c))),
        J_dot_z=np.concatenate((j_dot[:m] @ q_dot + j[:m] @ c_dot_z, n_perp @ a_rate)),
        complement=n_perp,
    )


def auxiliary_coordinates(
    robot: MobileManipulator,
    task_map: TaskMap,
    criterion: Criterion,
    q: Array,
    complement: Array | None = None,
) -> tuple[Array, Array]:
    """f_a of (11) alone, shape (nz - m,), and the complement whose rows are its axes.

    Arguments and errors as for :func:`extended_kinematics`.
    """
    jacobian = robot.tip_jacobian(q)[list(task_map.rows)]
    j = np.concatenate((jacobian, robot.constraint_matrix(q)))
    n_perp = orthonormal_complement(j) if complement is None else _carried(complement, j, _gram(j))
    return n_perp @ criterion.gradient(q), n_perp


def _gram(j: Array) -> Cholesky:
    """The factor of j j^T.

    Raises:
        SingularityError: If j has lost its rank.
    """
    return Cholesky(j @ j.T, "j j^T (a kinematic singularity)", well_posed=True)


def _carried(complement: Array, j: Array, gram: Cholesky) -> Array:
    """The orthonormal rows of ker j nearest to ``complement``: polar(N Proj_ker j)."""
    if not len(complement):  # no redundancy: l + n = m + k
        return complement
    projected = complement - gram.solve(j @ complement.T).T @ j
    # Near the last configuration N N^T is I to second order in the step; a few Newton-Schulz
    # iterations give the polar factor to working precision. Far from it, the SVD does.
    for _ in range(4):
        defect = projected @ projected.T
        defect.flat[:: len(defect) + 1] -= 1.0
        size = np.abs(defect).max()
        if size < 1e-15:
            return projected
        if size > _NEWTON_SCHULZ:
            break
        projected = projected - 0.5 * (defect @ projected)
        if size < 1e-8:
            return projected
    left, singular, right = np.linalg.svd(projected, full_matrices=False)
    if singular[-1] < 1e-6:
        return orthonormal_complement(j)
    polar: Array = left @ right
    return polar
