"""Task errors and Jacobians at (q, z), as the laws need them."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from mobman.arrays import Array
from mobman.model.criterion import Criterion
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.mobile_manipulator import MobileManipulator, Velocity
from mobman.tasks.task import Task, desired_at, task_map_of


class TaskErrors(NamedTuple):
    """Errors of p tasks and what moves them: e' = J z - p_d', e'' = J z' + J' z - p_d''."""

    e: Array
    """e = f - p_d, shape (p,)."""
    e_dot: Array
    """e' of (26), shape (p,)."""
    J: Array
    """Shape (p, nz)."""
    J_dot_z: Array
    """J' z, shape (p,)."""
    p_ddot: Array
    """p_d'', shape (p,)."""
    p_dddot: Array
    """p_d''', shape (p,)."""


class TaskSpace(Protocol):
    """Something that a law can drive to zero."""

    p: int
    """Number of task errors."""

    def errors(self, t: float, q: Array, z: Array, velocity: Velocity) -> TaskErrors:
        """The errors at time t and state (q, z), of which ``velocity`` is C, C z and C' z."""
        ...


class TipTaskSpace:
    """The tip's errors alone, p = m: e^e with j_e = df_e/dq C of (43)."""

    def __init__(self, robot: MobileManipulator, task: Task) -> None:
        self._robot = robot
        self._task = task
        self._map = task_map_of(task)
        self.p = self._map.m

    def errors(self, t: float, q: Array, z: Array, velocity: Velocity) -> TaskErrors:
        """The errors at time t and state (q, z); see :class:`TaskSpace`."""
        desired = desired_at(self._task, t)
        tip = self._robot.tip_kinematics(q, z, velocity)
        j = self._map.jacobian(tip)
        jacobian = j @ velocity.C
        return TaskErrors(
            e=self._map.position(tip) - desired.p,
            e_dot=jacobian @ z - desired.p_dot,
            J=jacobian,
            J_dot_z=self._map.jacobian_rate(tip) @ velocity.q_dot + j @ velocity.C_dot_z,
            p_ddot=desired.p_ddot,
            p_dddot=desired.p_dddot,
        )


class ExtendedTaskSpace:
    """The tip's errors and the auxiliary ones, p = nz: e = (e^e, e^a), p_d^a = 0, (13)."""

    def __init__(self, robot: MobileManipulator, task: Task, criterion: Criterion) -> None:
        self._robot = robot
        self._task = task
        self._criterion = criterion
        self._map = task_map_of(task)
        self._complement: Array | None = None
        self.p = robot.nz

    def errors(self, t: float, q: Array, z: Array, velocity: Velocity) -> TaskErrors:
        """The errors at time t and state (q, z); see :class:`TaskSpace`.

        The axes of e^a are carried from call to call.
        """
        desired = desired_at(self._task, t)
        kinematics = extended_kinematics(
            self._robot, self._map, self._criterion, q, z, self._complement, velocity
        )
        self._complement = kinematics.complement
        none = np.zeros(self.p - self._map.m)
        return TaskErrors(
            e=np.concatenate((kinematics.f_e - desired.p, kinematics.f_a)),
            e_dot=kinematics.J @ z - np.concatenate((desired.p_dot, none)),
            J=kinematics.J,
            J_dot_z=kinematics.J_dot_z,
            p_ddot=np.concatenate((desired.p_ddot, none)),
            p_dddot=np.concatenate((desired.p_dddot, none)),
        )
