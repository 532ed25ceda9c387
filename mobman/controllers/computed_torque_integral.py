"""Computed torque with an integral of the task error, ``computed-torque-integral``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.controllers.baselines import (
    ExtendedJacobianControl,
    TrackingGains,
    tracking_acceleration,
)
from mobman.controllers.gains import gain, require_not_negative
from mobman.controllers.limits import LimitedMotors
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import TaskSpace, desired
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


@dataclass(frozen=True, kw_only=True)
class IntegralGains(TrackingGains):
    """Gains of p_d'' - K_v e' - K_p e - K_i (integral of e); by default three poles at -5 /s."""

    K_p: float = gain(75.0, "s^-2", "stiffness of the task error")
    K_v: float = gain(15.0, "s^-1", "damping of the task error")
    K_i: float = gain(125.0, "s^-3", "factor of the task error's integral; stable below K_p K_v")

    def __post_init__(self) -> None:
        super().__post_init__()
        require_not_negative(self, "K_i")


class ComputedTorqueIntegral(LimitedMotors, ExtendedJacobianControl):
    r"""Law ``extended-jacobian`` with the integral of the error, and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - K_i \int e\,dt - \dot J z),
        \quad B v = M \dot z + Pz + G.

    F. L. Lewis, D. M. Dawson, C. T. Abdallah, "Robot Manipulator Control: Theory and Practice",
    Marcel Dekker 2004, section 4.4 (PID outer loop).

    The integral stands still while a torque is beyond a limit that acts, so that it does not wind up.
    """

    name = "computed-torque-integral"
    Gains = IntegralGains
    uses = ("M", "bias", "J'", "limits")

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again with an empty integral."""
        self._limits = np.full(robot.nz, np.inf) if self._acting is None else self._acting
        super().reset(robot, task, dt)

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, shape (nz,); see :class:`Controller`."""
        before = self._integral.copy()
        v = super().step(t, q, z, z_dot)
        if (np.abs(v) > self._limits).any():
            self._integral[:] = before
        return v

    def feedback(self, space: TaskSpace, wanted: Array) -> Callable[[], object]:
        """See :class:`ExtendedJacobianControl`."""
        gains, self._integral = self.gains, np.zeros(space.p)
        return bind(
            integral_acceleration,
            *(space.f, space.J, space.J_dot_z, space.p_d, space.now.z),
            *map(float, (gains.K_p, gains.K_v, gains.K_i, self._dt)),
            *(self._integral, wanted),
        )


@kernel
def integral_acceleration(
    f: Vector,
    J: Matrix,
    J_dot_z: Vector,
    p_d: Matrix,
    z: Vector,
    K_p: float,
    K_v: float,
    K_i: float,
    dt: float,
    integral: Vector,
    wanted: Vector,
) -> None:
    """The value wanted of J z': p_d'' - K_v e' - K_p e - K_i (integral of e) - J' z."""
    tracking_acceleration(f, J, J_dot_z, p_d, z, K_p, K_v, wanted)
    for i in range(wanted.shape[0]):
        wanted[i] -= K_i * integral[i]
        integral[i] += dt * (f[i] - desired(p_d, 0, i))


controllers.register(ComputedTorqueIntegral.name, ComputedTorqueIntegral)
