"""``extended-jacobian``: resolved acceleration on the inverse of the extended Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.computed_torque import TrackingGains, computed_torque
from mobman.controllers.criterion import posture_criterion
from mobman.controllers.gains import (
    Diagonal,
    as_settings,
    gain,
    require_positive,
    require_positive_diagonal,
)
from mobman.controllers.protocol import controllers
from mobman.controllers.task_space import ExtendedTaskSpace
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


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


class ExtendedJacobian:
    r"""Input-output linearisation of the extended task (13), and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - \dot J z),
        \quad B v = M \dot z + Pz + G.

    The usual baseline of the paper's first group (its references 5-9): it needs the dynamic model,
    and the inverse of the extended Jacobian, which fails at algorithmic singularities.
    """

    name = "extended-jacobian"
    Gains = ExtendedGains

    def __init__(self, gains: ExtendedGains) -> None:
        self.gains = gains

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start anew; the law's only state is the axes of e^a."""
        self._robot = robot
        self.criterion = posture_criterion(robot, self.gains.c_F, self.gains.K_F)
        self._space = ExtendedTaskSpace(robot, task, self.criterion)

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, shape (nz,)."""
        gains = self.gains
        velocity = self._robot.velocity(q, z)
        errors = self._space.errors(t, q, z, velocity)
        wanted = errors.p_ddot - gains.K_v * errors.e_dot - gains.K_p * errors.e - errors.J_dot_z
        z_dot_wanted = np.asarray(np.linalg.solve(errors.J, wanted), dtype=float)
        return computed_torque(self._robot, q, z, z_dot_wanted, velocity)

    def settings(self) -> dict[str, Any]:
        """The gains."""
        return as_settings(self.gains)


controllers.register(ExtendedJacobian.name, ExtendedJacobian)
