"""The task map f_e(q): which of the tip's coordinates the task is about, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import TipKinematics


@dataclass(frozen=True)
class TaskMap:
    r"""Tip position, or some of its components: :math:`f_e(q)` of (8).

    Second derivatives come from the columns :math:`v_i, w_i` of the tip's Jacobian alone: moving
    joint i turns everything behind it by :math:`w_i`, so
    :math:`\partial v_j/\partial q_i = w_i \times v_j` for i before j along the chain, and the
    Hessian is symmetric.

    Args:
        rows: Components of the world position: (0, 1, 2), m = 3, or (0, 1), planar, m = 2.
    """

    rows: tuple[int, ...] = (0, 1, 2)

    @property
    def m(self) -> int:
        """Dimension of the task space."""
        return len(self.rows)

    def position(self, tip: TipKinematics) -> Array:
        """f_e (m), shape (m,)."""
        return tip.position[list(self.rows)]

    def jacobian(self, tip: TipKinematics) -> Array:
        """df_e/dq, shape (m, nq)."""
        return tip.jacobian[list(self.rows)]

    def jacobian_rate(self, tip: TipKinematics) -> Array:
        """d/dt of df_e/dq along q', shape (m, nq)."""
        return tip.jacobian_rate[list(self.rows)]

    def hessian(self, tip: TipKinematics, multiplier: Array) -> Array:
        """d((df_e/dq)^T lam)/dq at fixed lam of shape (m,), shape (nq, nq), symmetric."""
        hessian = np.zeros((tip.jacobian.shape[1],) * 2)
        add_task_hessian(tip.jacobian, multiplier, self.m, hessian)
        return hessian

    def hessian_rate(self, tip: TipKinematics, multiplier: Array) -> Array:
        """d/dt of :meth:`hessian` along q' at fixed lam, shape (nq, nq)."""
        rate = np.zeros((tip.jacobian.shape[1],) * 2)
        add_task_hessian_rate(tip.jacobian, tip.jacobian_rate, multiplier, self.m, rate)
        return rate


def task_map_for(dimension: int) -> TaskMap:
    """The map for a desired trajectory of that many components.

    Raises:
        UsageError: If the dimension is neither 3 nor 2.
    """
    if dimension not in (2, 3):
        raise UsageError(
            f"a task's p_d has {dimension} components; allowed: 3 (tip position), 2 (its x and y)"
        )
    return TaskMap(tuple(range(dimension)))


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
