"""``extended-jacobian``: resolved acceleration on the inverse of the extended Jacobian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.computed_torque import (
    NO_ACCELERATION,
    ResolvedAcceleration,
    TrackingGains,
    tracking_acceleration,
)
from mobman.controllers.gains import Diagonal, gain, require_positive, require_positive_diagonal
from mobman.controllers.protocol import controllers
from mobman.controllers.task_space import ExtendedTaskSpace, TaskSpace
from mobman.kernels import lu
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_solve = lu.solve


@dataclass(frozen=True, kw_only=True)
class ExtendedGains(TrackingGains):
    """Gains of the resolved acceleration, and the criterion that extends the task."""

    c_F: float = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "c_F")
        if self.K_F is not None:
            require_positive_diagonal(self, "K_F")


class ExtendedJacobian(ResolvedAcceleration):
    r"""Input-output linearisation of the extended task (13), and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - \dot J z),
        \quad B v = M \dot z + Pz + G.

    The usual baseline of the paper's first group (its references 5-9): it needs the dynamic model,
    and the inverse of the extended Jacobian, which fails at algorithmic singularities.
    """

    name = "extended-jacobian"
    Gains = ExtendedGains

    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """e = (e^e, e^a) of (13)."""
        return ExtendedTaskSpace(robot, task, self.criterion)

    def acceleration_steps(
        self, robot: MobileManipulator, space: TaskSpace, z_dot: Array
    ) -> list[Call]:
        """See :class:`ResolvedAcceleration`."""
        gains, errors, nz = self.gains, space.errors, robot.nz
        wanted = np.zeros(nz)
        return [
            call(
                tracking_acceleration,
                *(errors.p_ddot, errors.e, errors.e_dot, errors.J_dot_z),
                *(float(gains.K_p), float(gains.K_v), wanted),
            ),
            call(_resolve, errors.J, wanted, z_dot, np.zeros((nz, nz))),
        ]


@kernel
def _resolve(J: Matrix, wanted: Vector, z_dot: Vector, work: Matrix) -> int:
    """z' = J^-1 wanted."""
    return NO_ACCELERATION if _solve(J, wanted, z_dot, work) != 0 else 0


controllers.register(ExtendedJacobian.name, ExtendedJacobian)
