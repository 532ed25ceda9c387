"""Full-model computed torque: what the baselines turn an acceleration into a torque with."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.criterion import posture_criterion
from mobman.controllers.gains import (
    Diagonal,
    as_settings,
    gain,
    require_not_negative,
    require_positive,
    require_positive_diagonal,
)
from mobman.controllers.task_space import TaskSpace
from mobman.errors import SingularityError
from mobman.kernels import lu
from mobman.kernels.dense import apply
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call, program
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

NO_INVERSE = 4
"""Status: B has no inverse."""
NO_ACCELERATION = 5
"""Status: no acceleration does what the task asks for."""

_REASONS = {
    NO_INVERSE: "the actuation matrix B has no inverse",
    NO_ACCELERATION: "the task's Jacobian is singular",
}

_solve = lu.solve


@dataclass(frozen=True, kw_only=True)
class TrackingGains:
    """Gains of the resolved acceleration p_d'' - K_v e' - K_p e."""

    K_p: float = gain(25.0, "s^-2", "stiffness of the task error")
    K_v: float = gain(10.0, "s^-1", "damping of the task error; 2 sqrt(K_p) is critical")

    def __post_init__(self) -> None:
        require_positive(self, "K_p", "K_v")


@dataclass(frozen=True, kw_only=True)
class RedundancyGains(TrackingGains):
    """Gains of a descent of the criterion F in the null space of the task."""

    k_0: float = gain(20.0, "s^-2", "null-space descent of the criterion, -k_0 C^T dF/dq")
    k_d: float = gain(4.0, "s^-1", "null-space damping, -k_d z")
    c_F: float = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_not_negative(self, "k_0", "k_d")
        require_positive(self, "c_F")
        if self.K_F is not None:
            require_positive_diagonal(self, "K_F")


class ResolvedAcceleration:
    """A law that chooses an acceleration z' and gives it to the nominal robot.

    Subclasses say what errors it looks at (:meth:`task_space`) and what acceleration it wants
    (:meth:`acceleration_steps`).
    """

    def __init__(self, gains: Any) -> None:
        self.gains = gains

    @abstractmethod
    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """The errors that the law drives to zero."""

    @abstractmethod
    def acceleration_steps(
        self, robot: MobileManipulator, space: TaskSpace, z_dot: Array
    ) -> list[Call]:
        """The steps that write the wanted acceleration, shape (nz,), once the errors are known."""

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start anew; the law's only state is the axes of e^a, where it has them."""
        self.criterion = posture_criterion(robot, self.gains.c_F, self.gains.K_F)
        space = self.task_space(robot, task)
        now, nz = space.workspace, robot.nz
        wanted, force, work = np.zeros(nz), np.zeros(nz), np.zeros((nz, nz))
        self._space, self._v = space, np.zeros(nz)
        self._velocity = program(now.velocity_steps())
        self._law = program(
            [
                *space.steps(),
                *now.inertia_steps(),
                *now.bias_steps(),
                *self.acceleration_steps(robot, space, wanted),
                call(computed_torque, now.M, now.bias, now.B, wanted, force, self._v, work),
            ]
        )

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, shape (nz,); see :class:`Controller`."""
        space = self._space
        now = space.workspace
        now.q[:] = q
        now.z[:] = z
        space.t[0] = t
        self._velocity()
        now.run_jacobians()
        now.run_dynamics()
        while status := self._law():
            if reason := _REASONS.get(status):
                raise SingularityError(reason)
            space.resolve(status)
        return self._v.copy()

    def settings(self) -> dict[str, Any]:
        """The gains."""
        return as_settings(self.gains)


@kernel
def tracking_acceleration(
    p_ddot: Vector,
    e: Vector,
    e_dot: Vector,
    J_dot_z: Vector,
    K_p: float,
    K_v: float,
    wanted: Vector,
) -> None:
    """What J z' is to be: p_d'' - K_v e' - K_p e - J' z."""
    for i in range(wanted.shape[0]):
        wanted[i] = p_ddot[i] - K_v * e_dot[i] - K_p * e[i] - J_dot_z[i]


@kernel
def computed_torque(
    M: Matrix, bias: Vector, B: Matrix, z_dot: Vector, force: Vector, v: Vector, work: Matrix
) -> int:
    """v that gives the nominal robot the acceleration z': B v = M z' + Pz + G, (17)."""
    apply(M, z_dot, force)
    for i in range(force.shape[0]):
        force[i] += bias[i]
    return NO_INVERSE if _solve(B, force, v, work) != 0 else 0
