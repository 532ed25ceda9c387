"""The task map f_e(q): which of the tip's coordinates the task is about, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.extended_kernels import add_task_hessian, add_task_hessian_rate
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
