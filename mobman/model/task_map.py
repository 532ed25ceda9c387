"""The task map f_e(q): which of the tip's coordinates the task is about, with its derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel, plain
from mobman.errors import UsageError
from mobman.linalg import dot
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import TipKinematics

Z_AXIS = (0.0, 0.0, 1.0)
Three = tuple[float, float, float]


@dataclass(frozen=True)
class TaskMap:
    r"""The tip's position, or some of its components, :math:`f_e(q)` of (8), and its orientation.

    Second derivatives come from the columns :math:`v_i, w_i` of the tip's Jacobian alone: moving
    joint i turns everything behind it by :math:`w_i`, so
    :math:`\partial v_j/\partial q_i = w_i \times v_j` for i before j along the chain, and the
    Hessian of the position is symmetric.

    An orientation has no coordinates here, but rates: the angular velocity in world axes for a pose,
    and for a pointing task its two components across the tip's axis, in axes of the tip frame. Their
    rows in the "Jacobian" are those of the angular velocity. What laws drive to zero has rows that are
    regular combinations of these (:mod:`mobman.model.orientation`).

    Args:
        rows: Rows of the tip's Jacobian: (0, 1, 2), m = 3; (0, 1), planar, m = 2; (0, ..., 5), a pose,
            m = 6.
        axis: Of the tip frame, that of a pointing task, m = 5, which has the first three rows; None for
            other tasks.
    """

    rows: tuple[int, ...] = (0, 1, 2)
    axis: Three | None = None

    @property
    def m(self) -> int:
        """Dimension of the task space."""
        return len(self.rows) + (0 if self.axis is None else 2)

    @property
    def width(self) -> int:
        """Components of p_d: m, and one more for a unit quaternion or axis."""
        return self.m + (1 if self.m > 3 else 0)

    @property
    def tip_axes(self) -> Array:
        """Axes of the orientation rows of a pointing task in the tip frame, across its own; (2, 3)."""
        axis = np.array(self.axis or Z_AXIS, dtype=float)
        axis /= np.linalg.norm(axis)
        first = np.eye(3)[int(np.argmin(np.abs(axis)))]
        first = first - (first @ axis) * axis
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(axis, first)])

    def position(self, tip: TipKinematics) -> Array:
        """The tip's coordinates that the task is about (m), shape (min(m, 3),)."""
        return tip.position[list(self.rows[:3])]

    def jacobian(self, tip: TipKinematics) -> Array:
        """J_f = df_e/dq, shape (m, nq)."""
        rows = tip.jacobian[list(self.rows)]
        if self.axis is None:
            return rows
        return np.vstack([rows, self._axes(tip) @ tip.jacobian[3:]])

    def jacobian_rate(self, tip: TipKinematics) -> Array:
        """d/dt of J_f along q', shape (m, nq)."""
        rows = tip.jacobian_rate[list(self.rows)]
        if self.axis is None:
            return rows
        axes = self._axes(tip)
        turned = axes @ tip.jacobian_rate[3:] + np.cross(tip.omega, axes) @ tip.jacobian[3:]
        return np.vstack([rows, turned])

    def hessian(self, tip: TipKinematics, multiplier: Array) -> Array:
        """d(J_f^T lam)/dq at fixed lam of shape (m,), shape (nq, nq); symmetric up to m = 3."""
        hessian = np.zeros((tip.jacobian.shape[1],) * 2)
        add_task_hessian(tip.jacobian, multiplier, min(self.m, 3), hessian)
        if self.m > 3:
            axes = np.vstack([self._axes(tip), np.zeros((2, 3))])
            plain(add_turning_hessian)(tip.jacobian, multiplier[3:], axes, hessian)
        return hessian

    def hessian_rate(self, tip: TipKinematics, multiplier: Array) -> Array:
        """d/dt of :meth:`hessian` along q' at fixed lam, shape (nq, nq)."""
        rate = np.zeros((tip.jacobian.shape[1],) * 2)
        add_task_hessian_rate(tip.jacobian, tip.jacobian_rate, multiplier, min(self.m, 3), rate)
        if self.m > 3:
            axes = self._axes(tip)
            axes = np.vstack([axes, np.cross(tip.omega, axes)])
            given = (tip.jacobian, tip.jacobian_rate, multiplier[3:], axes, rate)
            plain(add_turning_hessian_rate)(*given)
        return rate

    def rows_of(self, now: Buffers) -> tuple[Array, Array, tuple[Callable[[], object], ...]]:
        """J_f and its rate at a state, shapes (m, nq), and entries that fill them, to be called after
        ``now.tip_kinematics``."""
        if self.m <= 3:
            return now.tip_jacobian[: self.m], now.tip_jacobian_rate[: self.m], ()
        if self.axis is None:
            return now.tip_jacobian, now.tip_jacobian_rate, (now.tip_orientation,)
        rows, rates = np.zeros((2, 5, now.q.size))
        given = (self.tip_axes, now.tip_rotation, now.tip_jacobian, now.tip_jacobian_rate)
        fill = bind(rows_in_tip_axes, *given, now.q_dot, now.tip_axes, rows, rates)
        return rows, rates, (now.tip_orientation, fill)

    def _axes(self, tip: TipKinematics) -> Array:
        """Axes of the two orientation rows of a pointing task in the world, shape (2, 3)."""
        axes: Array = self.tip_axes @ tip.rotation.T
        return axes


def task_map_for(width: int, rates: int | None = None, axis: Three | None = None) -> TaskMap:
    """The map for a desired trajectory, by the number of its components.

    Args:
        width: Components of p_d: 3 for a position, 2 for a planar one, 6 for a position and a unit
            axis, 7 for a position and a unit quaternion.
        rates: Components of its derivatives, 6 for the last; as many as those of p_d by default.
        axis: The axis of the tip frame that points; z by default.

    Raises:
        UsageError: If there is no such map.
    """
    rates = width if rates is None else rates
    if width == rates and width in (2, 3):
        return TaskMap(tuple(range(width)))
    if (width, rates) == (6, 6):
        return TaskMap(axis=Z_AXIS if axis is None else axis)
    if (width, rates) == (7, 6):
        return TaskMap(tuple(range(6)))
    raise UsageError(
        f"a task's p_d has {width} components and its derivatives {rates}; allowed: 3 (tip position), "
        "2 (its x and y), 6 (position and unit axis), or 7 (position and unit quaternion w, x, y, z) "
        "with derivatives of 6 (linear and angular velocity, ...)"
    )


@kernel
def add_task_hessian(jacobian: Matrix, multiplier: Vector, m: int, hessian: Matrix) -> None:
    """Add d(J_f^T lam)/dq at fixed lam, shape (nq, nq), for a task of m = 3 or 2 tip coordinates.

    ``jacobian`` is that of the tip, with columns (v, w), shape (6, nq).
    """
    l = (multiplier[0], multiplier[1], multiplier[2] if m > 2 else 0.0)
    for i in range(jacobian.shape[1]):
        u = _crossed(l, _turning(jacobian, i))  # lam . (w x v) = v . (lam x w)
        if u[0] == 0.0 and u[1] == 0.0 and u[2] == 0.0:
            continue
        for j in range(i, jacobian.shape[1]):
            entry = jacobian[0, j] * u[0] + jacobian[1, j] * u[1] + jacobian[2, j] * u[2]
            hessian[i, j] += entry
            if j > i:
                hessian[j, i] += entry


@kernel
def add_task_hessian_rate(
    jacobian: Matrix, rate: Matrix, multiplier: Vector, m: int, hessian_rate: Matrix
) -> None:
    """Add the rate of :func:`add_task_hessian` along q' at fixed lam; ``rate`` is the Jacobian's."""
    l = (multiplier[0], multiplier[1], multiplier[2] if m > 2 else 0.0)
    for i in range(jacobian.shape[1]):
        u, d = _crossed(l, _turning(jacobian, i)), _crossed(l, _turning(rate, i))
        for j in range(i, jacobian.shape[1]):
            entry = rate[0, j] * u[0] + rate[1, j] * u[1] + rate[2, j] * u[2]
            entry = entry + jacobian[0, j] * d[0] + jacobian[1, j] * d[1] + jacobian[2, j] * d[2]
            hessian_rate[i, j] += entry
            if j > i:
                hessian_rate[j, i] += entry


@kernel
def rows_in_tip_axes(
    tip_axes: Matrix,
    rotation: Matrix,
    jacobian: Matrix,
    rate: Matrix,
    q_dot: Vector,
    axes: Matrix,
    rows: Matrix,
    rows_rate: Matrix,
) -> None:
    """J_f and its rate, shape (5, nq), of a pointing task: position, and angular velocity along two axes
    of the tip; ``tip_axes`` in its frame, ``axes`` for them in the world and their rates omega x u."""
    a, b, c = dot(jacobian[3], q_dot), dot(jacobian[4], q_dot), dot(jacobian[5], q_dot)
    for i in range(2):
        for k in range(3):
            axes[i, k] = dot(rotation[k], tip_axes[i])
        axes[2 + i, 0] = b * axes[i, 2] - c * axes[i, 1]
        axes[2 + i, 1] = c * axes[i, 0] - a * axes[i, 2]
        axes[2 + i, 2] = a * axes[i, 1] - b * axes[i, 0]
    for j in range(q_dot.shape[0]):
        for i in range(3):
            rows[i, j] = jacobian[i, j]
            rows_rate[i, j] = rate[i, j]
        for i in range(2):
            rows[3 + i, j] = rows_rate[3 + i, j] = 0.0
            for k in range(3):
                rows[3 + i, j] += axes[i, k] * jacobian[3 + k, j]
                rows_rate[3 + i, j] += axes[i, k] * rate[3 + k, j]
                rows_rate[3 + i, j] += axes[2 + i, k] * jacobian[3 + k, j]


@kernel
def add_turning_hessian(
    jacobian: Matrix, multiplier: Vector, axes: Matrix, hessian: Matrix
) -> None:
    r"""Add the part of d(J_f^T lam)/dq at fixed lam that the orientation rows have, shape (nq, nq).

    In world axes :math:`\partial w_j/\partial q_i = w_i \times w_j` for i before j, else 0; in axes of
    the tip, which turn with all joints, it is the other way round, :math:`w_i \times w_j` for j before
    i in the components of both.

    Args:
        jacobian: Of the tip, shape (6, nq).
        multiplier: The orientation's part of lam: 3 entries in world axes, or 2 in those of the tip.
        axes: In its first rows those of the tip in the world, shape (4, 3).
        hessian: Entry (j, i) is d/dq_i of the j-th.
    """
    l = _in_world(multiplier, axes, 0)
    for i in range(jacobian.shape[1]):
        u = _crossed(l, _turning(jacobian, i))
        for j in range(i + 1, jacobian.shape[1]):
            # l . (w_i x w_j) = w_j . (l x w_i)
            entry = jacobian[3, j] * u[0] + jacobian[4, j] * u[1] + jacobian[5, j] * u[2]
            if multiplier.shape[0] == 3:
                hessian[j, i] += entry
            else:
                hessian[i, j] += entry


@kernel
def add_turning_hessian_rate(
    jacobian: Matrix, rate: Matrix, multiplier: Vector, axes: Matrix, hessian_rate: Matrix
) -> None:
    """Add the rate of :func:`add_turning_hessian` along q' at fixed lam; ``rate`` is the Jacobian's,
    and ``axes`` have their rates in the last two rows."""
    l, l_rate = _in_world(multiplier, axes, 0), _in_world(multiplier, axes, 2)
    for i in range(jacobian.shape[1]):
        w = _turning(jacobian, i)
        u, d = _crossed(l, w), _crossed(l, _turning(rate, i))
        if multiplier.shape[0] == 2:  # world axes do not turn
            more = _crossed(l_rate, w)
            d = (d[0] + more[0], d[1] + more[1], d[2] + more[2])
        for j in range(i + 1, jacobian.shape[1]):
            entry = rate[3, j] * u[0] + rate[4, j] * u[1] + rate[5, j] * u[2]
            entry += jacobian[3, j] * d[0] + jacobian[4, j] * d[1] + jacobian[5, j] * d[2]
            if multiplier.shape[0] == 3:
                hessian_rate[j, i] += entry
            else:
                hessian_rate[i, j] += entry


@kernel
def _turning(jacobian: Matrix, i: int) -> Three:
    return (jacobian[3, i], jacobian[4, i], jacobian[5, i])


@kernel
def _in_world(multiplier: Vector, axes: Matrix, first: int) -> Three:
    if multiplier.shape[0] == 3:
        return (multiplier[0], multiplier[1], multiplier[2])
    one, two, a, b = multiplier[0], multiplier[1], axes[first], axes[first + 1]
    return (one * a[0] + two * b[0], one * a[1] + two * b[1], one * a[2] + two * b[2])


@kernel
def _crossed(a: Three, b: Three) -> Three:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
