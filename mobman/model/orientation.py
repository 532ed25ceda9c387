r"""Orientation errors of pose and pointing tasks, and their rates; world axes.

**Pose.** With the tip's rotation R, the desired one R_d, and :math:`Q = R R_d^T` as a unit quaternion
:math:`(\eta, \epsilon)`, the error is :math:`e_o = 2\epsilon`, three rows.

**Pointing.** With the tip's axis a, the desired one d, and unit vectors b_1, b_2 across d that are
carried along without spin, :math:`e_i = \langle b_i, a\rangle \sqrt{2/(1 + \langle a, d\rangle)}`.

In both :math:`|e_o| = 2 \sin(\theta/2)` for an angle :math:`\theta`, and
:math:`\dot e_o = T(\omega - \omega_d)`, with :math:`\omega_d` the desired angular velocity (of a pose: Q
times that of the task). The least singular value of T is :math:`\cos(\theta/2)`: at half a turn no law
can tell which way to go.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.linalg import dot
from mobman.model.dynamics import Buffers
from mobman.model.task_map import TaskMap

HALF_TURN = 3  # status: the tip is half a turn from where it should be
NOT_UNIT = 4  # status: the desired quaternion, or axis, is not of length 1
REASONS = {
    HALF_TURN: "the orientation error has reached half a turn, where its rate's map T is singular: "
    "there is no nearest way back",
    NOT_UNIT: "the desired quaternion, or axis, is not of length 1",
}
UNIT = 1e-6  # deviation from 1 that the squared length of a desired quaternion or axis may have

Four = tuple[float, float, float, float]
_NEAR_HALF_TURN = 1e-3  # least singular value of T
_JUMP = 0.7  # |<Q, Q>| of one tick and the next below which one does not follow from the other
_FAR = 3.6  # |e_o|^2 beyond which the opposite side is that of half a turn


class Turn(NamedTuple):
    """Orientation of the tip against the desired one, and work space."""

    R: Matrix  # orientation of the tip frame, shape (3, 3)
    tip: Vector  # the same as a unit quaternion (w, x, y, z), for a pose, shape (4,)
    omega: Matrix
    """Angular velocity, then work space; of a pointing task a and d, too: shape (8, 3)."""
    tip_axis: Vector  # the axis that points, in the tip frame, shape (3,)
    V: Matrix
    """Axes of the task map's orientation rows: world axes, or the tip's across ``tip_axis``; (r, 3)."""
    Q: Vector  # (eta, eps) of a pose, shape (4,); 0 before the first tick
    across: Matrix  # b_1 and b_2 of a pointing task, shape (2, 3); 0 before the first tick
    e: Vector  # e_o, shape (r,)
    T: Matrix  # shape (r, 3)
    T_rate: Matrix  # shape (r, 3)
    omega_d: Matrix
    """omega_d, its rate, and what stands for the second one in the place of p_d''', shape (3, 3)."""


class OrientationError:
    """e_o and its rates along a motion, in memory that stays where it is; see the module.

    Of the two quaternions of a rotation the first tick takes that of the shorter way, and later ones
    that which is nearer to the last: e_o does not jump.

    Args:
        task_map: The task's coordinates, of a pose or a pointing task.
        now: The robot's matrices at the state; ``task_map.entries(now)`` are called before.
        desired: The task's p_d and its derivatives as :func:`mobman.tasks.task.task_entry` gives them.

    Attributes:
        turn: Arrays of the error, among them e_o.
    """

    def __init__(self, task_map: TaskMap, now: Buffers, desired: Array) -> None:
        r = task_map.m - 3
        axes = np.eye(3) if task_map.axis is None else now.tip_axes[:2]
        axis = np.array(task_map.axis or (0.0, 0.0, 1.0), dtype=float)
        self._desired, self._now = desired, now
        self.turn = Turn(
            *(now.tip_rotation, np.zeros(4), np.zeros((8, 3)), axis / np.linalg.norm(axis), axes),
            *(np.zeros(4), np.zeros((2, 3)), np.zeros(r), np.zeros((r, 3)), np.zeros((r, 3))),
            np.zeros((3, 3)),
        )
        self._value = pose_error if r == 3 else pointing_error

    def value(self) -> Callable[[], int]:
        """Entry that fills e_o: 0, HALF_TURN or NOT_UNIT."""
        return bind(self._value, self.turn, self._desired)

    def rates(
        self, f: Array, J: Array, J_dot_z: Array, p_d: Array
    ) -> tuple[Callable[[], int], ...]:
        """Entries that fill e_o, then make of the task map's rows those of e, e' and e''.

        Args:
            f: For the tip's position and e_o, its first rows.
            J: Rows 3 on, the task map's, are multiplied by T.
            J_dot_z: J' z, likewise.
            p_d: For values in the place of p_d and its derivatives, shape (4, m): with them
                e' = J z - p_d', e'' = J z' + J' z - p_d'', and p_d''' is the part of e''' that does not
                depend on the state's rates.
        """
        turn, now = self.turn, self._now
        rates = pose_rates if len(turn.e) == 3 else pointing_rates
        return (
            self.value(),
            bind(rates, turn, self._desired, now.tip_jacobian, now.q_dot),
            bind(rows_of_error, turn, self._desired, now.tip, f, J, J_dot_z, p_d),
        )


@kernel
def cross(a: Vector, b: Vector, c: Vector) -> None:
    """c = a x b; not in the place of either."""
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def rotated(q: Vector, v: Vector, out: Vector) -> None:
    """out = Q v for a unit quaternion (w, x, y, z): v + 2 w (eps x v) + 2 eps x (eps x v)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    a, b, c = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    out[0] = v[0] + w * a + y * c - z * b
    out[1] = v[1] + w * b + z * a - x * c
    out[2] = v[2] + w * c + x * b - y * a


@kernel
def product(p: Four, q: Four) -> Four:
    """p q of quaternions (w, x, y, z)."""
    w, x, y, z = p
    a, b, c, d = q
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


@kernel
def quaternion(R: Matrix, q: Vector) -> None:
    """The unit quaternion (w, x, y, z) of a rotation matrix, by its largest component (Shepperd); of its
    two signs the one nearer to what ``q`` is."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    largest, index = trace, 3
    for i in range(3):
        if R[i, i] > largest:
            largest, index = R[i, i], i
    if index == 3:
        s = 2.0 * math.sqrt(1.0 + trace)
        w, x = 0.25 * s, (R[2, 1] - R[1, 2]) / s
        y, z = (R[0, 2] - R[2, 0]) / s, (R[1, 0] - R[0, 1]) / s
    else:
        i, j, k = index, (index + 1) % 3, (index + 2) % 3
        s = 2.0 * math.sqrt(1.0 + R[i, i] - R[j, j] - R[k, k])
        w = (R[k, j] - R[j, k]) / s
        a, b, c = 0.25 * s, (R[j, i] + R[i, j]) / s, (R[k, i] + R[i, k]) / s
        x, y, z = (a, b, c) if i == 0 else ((c, a, b) if i == 1 else (b, c, a))
    sign = -1.0 if q[0] * w + q[1] * x + q[2] * y + q[3] * z < 0.0 else 1.0
    q[0], q[1], q[2], q[3] = sign * w, sign * x, sign * y, sign * z


@kernel
def pose_error(turn: Turn, desired: Matrix) -> int:
    """Q = R R_d^T as a quaternion, and e_o = 2 eps."""
    Q, q, q_d = turn.Q, turn.tip, desired[0, 3:7]
    size = dot(q_d, q_d)
    if not abs(size - 1.0) <= UNIT:
        return NOT_UNIT
    quaternion(turn.R, q)
    conjugate = (q_d[0], -q_d[1], -q_d[2], -q_d[3])  # that of R_d^T
    eta, e_1, e_2, e_3 = product((q[0], q[1], q[2], q[3]), conjugate)
    nearer = Q[0] * eta + Q[1] * e_1 + Q[2] * e_2 + Q[3] * e_3
    before = Q[0]
    if abs(nearer) < _JUMP:  # the first tick, or another state
        nearer, before = eta, 0.0
    scale = (-1.0 if nearer < 0.0 else 1.0) / math.sqrt(size)
    Q[0], Q[1], Q[2], Q[3] = scale * eta, scale * e_1, scale * e_2, scale * e_3
    for i in range(3):
        turn.e[i] = 2.0 * Q[1 + i]
    return HALF_TURN if abs(Q[0]) < _NEAR_HALF_TURN or before * Q[0] < 0.0 else 0


@kernel
def pose_rates(turn: Turn, desired: Matrix, jacobian: Matrix, q_dot: Vector) -> None:
    """T = eta I - [eps]x, T', and Q Omega_d with its rates."""
    omega, omega_d, w_e, work = turn.omega[0], turn.omega_d, turn.omega[4], turn.omega[5]
    for i in range(3):
        omega[i] = dot(jacobian[3 + i], q_dot)
    for order in range(3):
        rotated(turn.Q, desired[1 + order, 3:6], omega_d[order])
    for i in range(3):
        w_e[i] = omega[i] - omega_d[0, i]  # omega_e
    # omega_e' = omega' - (omega_e x Q Omega_d + Q Omega_d')
    cross(w_e, omega_d[0], work)
    for i in range(3):
        omega_d[1, i] += work[i]
    eta, eps = turn.Q[0], turn.Q[1:]
    # eps' = (eta omega_e + omega_e x eps)/2, eta' = -omega_e . eps/2
    cross(w_e, eps, work)
    for i in range(3):
        work[i] = 0.5 * (eta * w_e[i] + work[i])
    _turning(eta, eps, turn.T)
    _turning(-0.5 * dot(w_e, eps), work, turn.T_rate)


@kernel
def _turning(eta: float, eps: Vector, T: Matrix) -> None:
    """T = eta I - [eps]x."""
    T[0, 0] = T[1, 1] = T[2, 2] = eta
    T[0, 1], T[1, 2], T[2, 0] = eps[2], eps[0], eps[1]
    T[1, 0], T[2, 1], T[0, 2] = -eps[2], -eps[0], -eps[1]


@kernel
def pointing_error(turn: Turn, desired: Matrix) -> int:
    """e_i = h b_i . a with h = sqrt(2/(1 + a . d))."""
    a, d, across = turn.omega[1], turn.omega[2], turn.across
    size = dot(desired[0, 3:6], desired[0, 3:6])
    if not abs(size - 1.0) <= UNIT:
        return NOT_UNIT
    for i in range(3):
        a[i] = dot(turn.R[i], turn.tip_axis)
        d[i] = desired[0, 3 + i] / math.sqrt(size)
    last = turn.omega[3]
    cross(across[0], across[1], last)
    if not dot(last, d) > 0.5:  # the first tick, or a jump: any two
        least = 0
        for i in range(1, 3):
            if abs(d[i]) < abs(d[least]):
                least = i
        for i in range(3):
            across[0, i], last[i] = (1.0 if i == least else 0.0), d[i]
    # turned with d from the last one, by the least rotation: without spin to the third order of a step
    along = dot(across[0], d) / (1.0 + dot(last, d))
    for i in range(3):
        across[0, i] -= along * (last[i] + d[i])
    along = dot(across[0], d)
    for i in range(3):
        across[0, i] -= along * d[i]
    length = math.sqrt(dot(across[0], across[0]))
    for i in range(3):
        across[0, i] /= length
    cross(d, across[0], across[1])
    cosine = dot(a, d)
    if not 0.5 * (1.0 + cosine) > _NEAR_HALF_TURN**2:
        return HALF_TURN
    h = math.sqrt(2.0 / (1.0 + cosine))
    one, two = turn.e[0], turn.e[1]
    for i in range(2):
        turn.e[i] = h * dot(across[i], a)
    beyond = one * turn.e[0] + two * turn.e[1] < 0.0
    far = min(one**2 + two**2, dot(turn.e, turn.e)) > _FAR
    return HALF_TURN if beyond and far else 0


@kernel
def pointing_rates(turn: Turn, desired: Matrix, jacobian: Matrix, q_dot: Vector) -> None:
    """t_i = h a x b_i - h^3/4 (b_i . a) a x d, the rows of T; T'; omega_d = d x d' and its rates."""
    omega, a, d, a_dot = turn.omega[0], turn.omega[1], turn.omega[2], turn.omega[3]
    work, a_d, a_d_rate = turn.omega[4], turn.omega[5], turn.omega[6]
    d_1, d_2, d_3 = desired[1, 3:6], desired[2, 3:6], desired[3, 3:6]
    for i in range(3):
        omega[i] = dot(jacobian[3 + i], q_dot)
    cross(omega, a, a_dot)
    cross(d, d_1, turn.omega_d[0])
    cross(d, d_2, turn.omega_d[1])
    cross(d, d_3, turn.omega_d[2])
    cross(d_1, d_2, work)
    for i in range(3):
        turn.omega_d[2, i] += work[i]
    cross(a, d, a_d)
    cross(a_dot, d, a_d_rate)
    cross(a, d_1, work)
    for i in range(3):
        a_d_rate[i] += work[i]
    h = math.sqrt(2.0 / (1.0 + dot(a, d)))
    g = 0.25 * h**3
    h_rate = -g * (dot(d_1, a) + dot(d, a_dot))
    g_rate = 0.75 * h**2 * h_rate
    for row in range(2):
        b, T, T_rate = turn.across[row], turn.T[row], turn.T_rate[row]
        slip = -dot(d_1, b)  # b' = -(d' . b) d
        x, x_rate = dot(b, a), slip * dot(d, a) + dot(b, a_dot)
        cross(a, b, T)
        cross(a_dot, b, T_rate)
        for i in range(3):
            T_rate[i] = h_rate * T[i] + h * (T_rate[i] + slip * a_d[i])
            T_rate[i] -= (g_rate * x + g * x_rate) * a_d[i] + g * x * a_d_rate[i]
            T[i] = h * T[i] - g * x * a_d[i]


@kernel
def rows_of_error(
    turn: Turn, desired: Matrix, tip: Vector, f: Vector, J: Matrix, J_dot_z: Vector, p_d: Matrix
) -> None:
    """The rows of e_o from those of the task map; see :meth:`OrientationError.rates`."""
    T, V, old = turn.T, turn.V, turn.omega[7]
    r = T.shape[0]
    for i in range(3):
        f[i] = tip[i]
        for order in range(4):
            p_d[order, i] = desired[order, i]
    # V T^T in the place of work space that is not needed any more: the rows are in the axes V
    turned = turn.omega[4:7]
    for i in range(r):
        for k in range(r):
            turned[i, k] = dot(T[i], V[k])
    for column in range(J.shape[1] + 1):
        last = column == J.shape[1]
        for k in range(r):
            old[k] = J_dot_z[3 + k] if last else J[3 + k, column]
        for i in range(r):
            entry = 0.0
            for k in range(r):
                entry += turned[i, k] * old[k]
            if last:  # J' z = T (J_w' q' + J_w C' z) + T' omega
                J_dot_z[3 + i] = entry + dot(turn.T_rate[i], turn.omega[0])
            else:
                J[3 + i, column] = entry
    for i in range(r):
        f[3 + i] = turn.e[i]
        p_d[0, 3 + i] = 0.0
        p_d[1, 3 + i] = dot(T[i], turn.omega_d[0])
        p_d[2, 3 + i] = dot(turn.T_rate[i], turn.omega_d[0]) + dot(T[i], turn.omega_d[1])
        p_d[3, 3 + i] = dot(T[i], turn.omega_d[2])
