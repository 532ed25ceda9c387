"""The task map f_e(q): which of the tip's coordinates the task is about, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mobman.arrays import Array
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
        cross = self._cross(multiplier)
        return _mirrored(tip.jacobian[:3].T @ cross @ tip.jacobian[3:])

    def hessian_rate(self, tip: TipKinematics, multiplier: Array) -> Array:
        """d/dt of :meth:`hessian` along q' at fixed lam, shape (nq, nq)."""
        cross = self._cross(multiplier)
        j, rate = tip.jacobian, tip.jacobian_rate
        return _mirrored(rate[:3].T @ cross @ j[3:] + j[:3].T @ cross @ rate[3:])

    def _cross(self, multiplier: Array) -> Array:
        """[lam]_x: lam . (w x v) = v^T [lam]_x w."""
        lam = np.zeros(3)
        lam[list(self.rows)] = multiplier
        x, y, z = lam
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


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


def _mirrored(matrix: Array) -> Array:
    """The symmetric matrix with the lower triangle of ``matrix``."""
    at_and_below, below = _triangles(len(matrix))
    mirrored: Array = matrix * at_and_below + (matrix * below).T
    return mirrored


@cache
def _triangles(n: int) -> tuple[Array, Array]:
    """Masks of the lower triangle with and without the diagonal."""
    return np.tri(n), np.tri(n, k=-1)
