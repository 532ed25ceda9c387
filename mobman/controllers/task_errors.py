"""Task coordinates, their Jacobian and the desired values at (t, q, z), and the criterion, as the
laws need them."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.errors import SingularityError, UsageError
from mobman.linalg import dot, multiply
from mobman.model.criterion import Criterion
from mobman.model.dynamics import Buffers
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import REASONS, OrientationError, Turn
from mobman.tasks.task import Task, task_entry, task_map_of

Entry = Callable[[], Any]
"""Function that a law calls at every tick: None, 0, or a :class:`Stop`."""


class Stop(IntEnum):
    """Reason why a law has no torque."""

    NOT_DEFINITE = 1
    NO_INVERSE = 2
    NO_ACCELERATION = 3

    def error(self, extended: bool) -> SingularityError:
        """The error of a law whose task is the extended one of (13), or the tip's alone."""
        reason, matrix = {
            Stop.NOT_DEFINITE: ("the nominal inertia M is not positive definite", "M"),
            Stop.NO_INVERSE: ("the actuation matrix B has no inverse", "B"),
            Stop.NO_ACCELERATION: ("the task's Jacobian is singular", "J" if extended else "J_e"),
        }[self]
        return SingularityError(reason, matrix)


class Tracking(NamedTuple):
    """Arguments that kernels of laws take of a :class:`TaskSpace`, and the state."""

    f: Vector
    J: Matrix
    J_dot_z: Vector
    p_d: Matrix
    q: Vector
    z: Vector


class TaskSpace:
    """Coordinates that a law drives to desired values, f and p_d, in memory that stays where it is.

    With a criterion these are (f_e, f_a) of (13), p = nz, whose last have the desired values 0 and axes
    that are carried from state to state; without one the tip's alone, p = m, with j_e of (43) for J.

    Whatever the task is about, e = f - p_d, e' = J z - p_d' and e'' = J z' + J' z - p_d''. In the rows
    of an orientation f is the error e_o of :mod:`mobman.model.orientation` and p_d is 0, J is T J_w C,
    and p_d' to p_d''' are what the desired motion adds to e_o' to e_o'''.

    Args:
        robot: The nominal robot.
        task: Gives p_d.
        criterion: F, or None.

    Attributes:
        p: Number of coordinates.
        now: The nominal robot at the state.
        f: Shape (p,).
        J: Shape (p, nz).
        J_dot_z: Shape (p,).
        p_d: p_d, p_d', p_d'' and p_d''', shape (4, m); see :func:`desired`.
        tracking: These four and the state.
        task_map: f_e.
    """

    def __init__(
        self, robot: MobileManipulator, task: Task, criterion: Criterion | None = None
    ) -> None:
        self.task_map = task_map = task_map_of(task)
        self.now = now = Buffers(robot)
        m, nz = task_map.m, robot.nz
        self._t, self.p_d = np.zeros(1), np.zeros((4, m))
        given = self.p_d if m <= 3 else np.zeros((4, task_map.width))
        self._J_f, rates, fill = task_map.rows_of(now)
        self._turn: Turn | None = None
        update: Callable[[], int | None]
        if criterion is None:
            self.f = now.tip[:m] if m <= 3 else np.zeros(m)
            self.J, self.J_dot_z = np.zeros((m, nz)), np.zeros(m)
            own = (now.C, now.q_dot, now.C_dot_z, self.J, self.J_dot_z)
            update = sequence(now.tip_kinematics, *fill, bind(tip_rates, self._J_f, rates, *own))
        else:
            extended = ExtendedJacobian(robot, task_map, criterion, now)
            self.f, self.J, self.J_dot_z = extended.f, extended.J, extended.J_dot_z
            update = extended.update
        aim = task_entry(task, self._t, given)
        self._steps = [sequence(now.velocity, aim), now.run_jacobians, update]
        if m > 3:
            orientation = OrientationError(task_map, now, given)
            self._turn = orientation.turn
            rates_of_error = orientation.rates(self.f, self.J, self.J_dot_z, self.p_d)
            self._steps.append(sequence(*rates_of_error))
        self.p = len(self.f)
        self.tracking = Tracking(self.f, self.J, self.J_dot_z, self.p_d, now.q, now.z)

    def aligned_jacobian(self) -> Array:
        """J at the last state as it is without an orientation error, up to the axes of its rows, shape
        (p, nz)."""
        J = self.J.copy()
        if self.task_map.m > 3:
            J[3 : self.task_map.m] = self._J_f[3:] @ self.now.C
        return J

    def gradient(self) -> Array:
        """df/dq of the task's own coordinates at the last state, shape (m, nq); times C it is J."""
        gradient = self._J_f.copy()
        if self._turn is not None:
            gradient[3:] = self._turn.T @ self._turn.V.T @ gradient[3:]
        return gradient

    def at(self, t: float, q: Array, z: Array) -> None:
        """Fill f, J, J' z and p_d at time t (s) and state (q, z).

        Raises:
            SingularityError: If they do not exist there.
            UsageError: If q or z has another shape than the robot's, or they are no numbers.
        """
        now = self.now
        try:
            if len(q) != len(now.q) or len(z) != len(now.z):  # one number would fill all of them
                raise ValueError
            self._t[0] = t
            now.q[...] = q  # takes two thirds of [:]
            now.z[...] = z
        except (TypeError, ValueError):
            raise UsageError(
                f"t = {t!r}: q has shape {np.shape(q)} and z {np.shape(z)}; expected {now.q.shape} "
                f"and {now.z.shape}, all of numbers"
            ) from None
        for step in self._steps:
            if status := step():
                raise SingularityError(REASONS[status])


@kernel
def tip_rates(
    J_f: Matrix, rate: Matrix, C: Matrix, q_dot: Vector, C_dot_z: Vector, J: Matrix, J_dot_z: Vector
) -> None:
    """j_e = J_f C of (43), and J' z = J_f' q' + J_f C' z."""
    multiply(J_f, C, J)
    for i in range(J_dot_z.shape[0]):
        J_dot_z[i] = dot(rate[i], q_dot) + dot(J_f[i], C_dot_z)


@kernel
def desired(p_d: Matrix, order: int, i: int) -> float:
    """Component i of a derivative of p_d; 0 for the auxiliary coordinates, p_d^a = 0 under (13)."""
    return p_d[order, i] if i < p_d.shape[1] else 0.0


@kernel
def error(at: Tracking, i: int) -> float:
    """Component i of e = f - p_d."""
    return float(at.f[i] - desired(at.p_d, 0, i))


@kernel
def error_rate(at: Tracking, i: int) -> float:
    """Component i of e' = J z - p_d'."""
    return float(dot(at.J[i], at.z) - desired(at.p_d, 1, i))
