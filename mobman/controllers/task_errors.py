"""Task errors and Jacobians at (q, z), and the criterion, as the laws need them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.gains import Diagonal, diagonal
from mobman.errors import SingularityError
from mobman.kernels.dense import dot
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call, program
from mobman.model.criterion import Criterion, Posture
from mobman.model.extended_kernels import stack, task_rates
from mobman.model.extended_steps import ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.workspace import Workspace
from mobman.tasks.task import Task, task_map_of, task_steps


class TaskErrors:
    """Errors of p tasks and what moves them: e' = J z - p_d', e'' = J z' + J' z - p_d''.

    Args:
        J: Shape (p, nz).
        J_dot_z: J' z, shape (p,).

    Attributes:
        e: e = f - p_d, shape (p,).
        e_dot: e' of (26), shape (p,).
        p_ddot, p_dddot: Derivatives of p_d, shape (p,).
    """

    def __init__(self, J: Array, J_dot_z: Array) -> None:
        p = len(J_dot_z)
        self.J, self.J_dot_z = J, J_dot_z
        self.e, self.e_dot = np.zeros(p), np.zeros(p)
        self.p_ddot, self.p_dddot = np.zeros(p), np.zeros(p)


class TaskSpace(Protocol):
    """Something that a law can drive to zero; its arrays stay where they are in memory."""

    p: int
    """Number of task errors."""
    workspace: Workspace
    """The nominal robot at the state."""
    t: Array
    """The time (s), shape (1,)."""
    errors: TaskErrors
    """The errors at the time and the state."""

    def steps(self) -> list[Call]:
        """Steps that compute ``errors``, after the workspace's velocity steps and ``run_jacobians``."""
        ...

    def resolve(self, status: int) -> None:
        """Do what the steps could not, so that they can be run again.

        Raises:
            SingularityError: If there is nothing to be done.
        """
        ...


class TipTaskSpace:
    """The tip's errors alone, p = m: e^e with j_e = df_e/dq C of (43)."""

    def __init__(self, robot: MobileManipulator, task: Task) -> None:
        self._robot = robot
        self.p = task_map_of(task).m
        self.workspace = Workspace(robot)
        self.t = np.zeros(1)
        self._task = task
        self.errors = TaskErrors(np.zeros((self.p, robot.nz)), np.zeros(self.p))

    def steps(self) -> list[Call]:
        """See :class:`TaskSpace`."""
        now, robot, m, errors = self.workspace, self._robot, self.p, self.errors
        j, j_rate, no_rows = np.zeros((m, robot.nq)), np.zeros((m, robot.nq)), now.A[:0]
        return [
            *now.tip_steps(),
            call(stack, now.tip_jacobian, no_rows, j, m),
            call(stack, now.tip_jacobian_rate, no_rows, j_rate, m),
            call(
                task_rates,
                j,
                j_rate,
                robot.platform_index,
                robot.arm_index,
                now.N,
                now.q_dot,
                now.C_dot_z,
                m,
                errors.J,
                errors.J_dot_z,
            ),
            *_error_steps(self._task, self.t, m, now.tip, now.z, errors),
        ]

    def resolve(self, status: int) -> None:
        """See :class:`TaskSpace`; these steps always succeed."""
        raise SingularityError(f"the task's errors cannot be computed (status {status})")


class ExtendedTaskSpace:
    """The tip's errors and the auxiliary ones, p = nz: e = (e^e, e^a), p_d^a = 0, (13).

    The axes of e^a are carried from state to state.
    """

    def __init__(self, robot: MobileManipulator, task: Task, criterion: Criterion) -> None:
        task_map = task_map_of(task)
        self._extended = ExtendedJacobian(robot, task_map, criterion)
        self.p = robot.nz
        self.workspace = self._extended.workspace
        self.t = np.zeros(1)
        self._task, self._m = task, task_map.m
        self.errors = TaskErrors(self._extended.J, self._extended.J_dot_z)

    def steps(self) -> list[Call]:
        """See :class:`TaskSpace`."""
        extended = self._extended
        return [
            *extended.steps(),
            *_error_steps(self._task, self.t, self._m, extended.f, self.workspace.z, self.errors),
        ]

    def resolve(self, status: int) -> None:
        """See :class:`TaskSpace`."""
        self._extended.resolve(status)


class ErrorsAlong:
    """The errors of a task space at states that are given one by one: what a law sees of them."""

    def __init__(self, space: TaskSpace) -> None:
        self._space = space
        self._velocity = program(space.workspace.velocity_steps())
        self._errors = program(space.steps())

    def at(self, t: float, q: Array, z: Array) -> TaskErrors:
        """The errors at time t and state (q, z); overwritten by the next.

        Raises:
            SingularityError: If they do not exist there.
        """
        space, now = self._space, self._space.workspace
        space.t[0] = t
        now.q[:] = q
        now.z[:] = z
        self._velocity()
        now.run_jacobians()
        while status := self._errors():
            space.resolve(status)
        return space.errors


def _error_steps(
    task: Task, t: Array, m: int, f: Array, z: Array, errors: TaskErrors
) -> list[Call]:
    p_d = np.zeros((4, m))
    return [
        *task_steps(task, t, p_d),
        call(_errors, f, p_d, z, errors.J, errors.e, errors.e_dot, errors.p_ddot, errors.p_dddot),
    ]


@kernel
def _errors(
    f: Vector,
    p_d: Matrix,
    z: Vector,
    J: Matrix,
    e: Vector,
    e_dot: Vector,
    p_ddot: Vector,
    p_dddot: Vector,
) -> None:
    """e = f - p_d and e' = J z - p_d' of (26); p_d of the auxiliary tasks is 0."""
    m = p_d.shape[1]
    for i in range(e.shape[0]):
        e[i] = f[i]
        e_dot[i] = dot(J[i], z)
        p_ddot[i] = p_dddot[i] = 0.0
        if i < m:
            e[i] -= p_d[0, i]
            e_dot[i] -= p_d[1, i]
            p_ddot[i] = p_d[2, i]
            p_dddot[i] = p_d[3, i]


def posture_criterion(robot: MobileManipulator, c_F: float, K_F: Diagonal | None) -> Posture:
    """The criterion (12) of a law.

    Args:
        robot: The nominal robot.
        c_F: Its factor.
        K_F: Diagonal of its weights; the robot's own if None. The robot's couplings stay.

    Raises:
        GainError: If K_F has not one weight for each coordinate of q.
    """
    if K_F is None:
        return Posture.of(robot, c_F)
    weights = diagonal("K_F", K_F, robot.nq)
    return Posture(weights, robot.q_rest, c_F, robot.criterion_couplings)
