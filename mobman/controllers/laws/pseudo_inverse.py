"""``pseudo-inverse``: resolved acceleration on the Jacobian's pseudo-inverse."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.computed_torque import RedundancyGains, computed_torque
from mobman.controllers.criterion import posture_criterion
from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import controllers
from mobman.controllers.task_space import TipTaskSpace
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


class PseudoInverse:
    r"""Resolved acceleration with null-space descent of the criterion, and computed torque:

    .. math:: \dot z = j_e^+ (\ddot p_d - K_v \dot e - K_p e - \dot j_e z)
        + (I - j_e^+ j_e)(-k_0 C^T \partial F/\partial q - k_d z),
        \quad B v = M \dot z + Pz + G.

    The usual baseline of the paper's second group (its references 12-18): it needs the dynamic
    model, and the (pseudo-)inverse of the Jacobian at every tick.
    """

    name = "pseudo-inverse"
    Gains = RedundancyGains

    def __init__(self, gains: RedundancyGains) -> None:
        self.gains = gains

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start anew; the law has no state."""
        self._robot = robot
        self._space = TipTaskSpace(robot, task)
        self.criterion = posture_criterion(robot, self.gains.c_F, self.gains.K_F)

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, shape (nz,)."""
        gains, robot = self.gains, self._robot
        velocity = robot.velocity(q, z)
        errors = self._space.errors(t, q, z, velocity)
        pseudo_inverse = np.asarray(np.linalg.pinv(errors.J), dtype=float)
        inverse = self.task_inverse(errors.J, pseudo_inverse)
        wanted = errors.p_ddot - gains.K_v * errors.e_dot - gains.K_p * errors.e - errors.J_dot_z
        descent = -gains.k_0 * (velocity.C.T @ self.criterion.gradient(q)) - gains.k_d * z
        internal = descent - pseudo_inverse @ (errors.J @ descent)
        return computed_torque(robot, q, z, inverse @ wanted + internal, velocity)

    def task_inverse(self, jacobian: Array, pseudo_inverse: Array) -> Array:
        """What resolves the task's acceleration, shape (nz, m): j_e^+ itself."""
        return pseudo_inverse

    def settings(self) -> dict[str, Any]:
        """The gains."""
        return as_settings(self.gains)


controllers.register(PseudoInverse.name, PseudoInverse)
