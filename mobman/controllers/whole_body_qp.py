"""Whole-body control by a quadratic program with all limits, ``whole-body-qp``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.compiled import bind, sequence
from mobman.controllers.baselines import (
    ResolvedAcceleration,
    SecondaryGains,
    tracking_acceleration,
)
from mobman.controllers.gains import gain, require_positive
from mobman.controllers.limits import (
    LimitedMotors,
    TorqueLimits,
    plain_limits,
    require_torque_limits,
)
from mobman.controllers.protocol import controllers
from mobman.controllers.quadratic_program import solver
from mobman.controllers.task_errors import TaskSpace
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


@dataclass(frozen=True, kw_only=True)
class WholeBodyGains(SecondaryGains):
    """Gains of the tip's task, of what it leaves free, and of the approach to limits."""

    rho: float = gain(1e-5, "1", "weight of that, against the tip's task")
    kappa: float = gain(10.0, "s^-1", "rate at which a velocity or a joint may approach its limit")
    torque_limits: TorqueLimits = gain(None, "N m, N", "limits of |v|, by default those that act")

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "rho", "kappa")
        require_torque_limits(self.torque_limits)


class WholeBodyQP(LimitedMotors, ResolvedAcceleration):
    r"""The acceleration that is nearest to the tip's task within the limits, by a quadratic program:

    .. math:: \min_{\dot z}\ |J\dot z - (\ddot p_d - K_v \dot e - K_p e - \dot J z)|^2
        + \rho\,(\dot z - \dot z_0)^T\Omega^{-1}(\dot z - \dot z_0), \quad
        \dot z_0 = -k_d\Big(z + \frac{k_0}{\lambda_{max}}\Omega C^T\frac{\partial F}{\partial q}\Big)

    subject to :math:`|v| \le v_{max}` with :math:`B v = M \dot z + Pz + G`, and, of all joints with
    limits, with :math:`\ddot q = C\dot z + \dot C z`,

    .. math:: -\kappa(\dot q_{max} + \dot q) \le \ddot q \le \kappa(\dot q_{max} - \dot q), \quad
        -2\kappa\dot q - \kappa^2(q - q_{min}) \le \ddot q \le -2\kappa\dot q + \kappa^2(q_{max} - q).

    The torques' limits are hard: B has an inverse, so that some acceleration always keeps to them. Those
    of velocities and positions are soft, with a large weight, so that there is always a solution; where
    the two contradict each other, that of the velocity counts.

    L. Sentis, O. Khatib, "Synthesis of whole-body behaviors through hierarchical control of behavioral
    primitives", International Journal of Humanoid Robotics 2(4), 2005; A. Escande, N. Mansard,
    P.-B. Wieber, "Hierarchical quadratic programming: fast online humanoid-robot motion generation",
    International Journal of Robotics Research 33(7), 2014; A. Del Prete, "Joint position and velocity
    bounds in discrete-time acceleration/torque control of robot manipulators", IEEE Robotics and
    Automation Letters 3(1), 2018; D. Arnstrom, A. Bemporad, D. Axehill, "A dual active-set solver for
    embedded quadratic programming using recursive LDL^T updates", IEEE Transactions on Automatic
    Control 67(8), 2022, which is the solver.

    Raises:
        MobmanError: If the solver, of the extra ``qp``, is not installed.
    """

    name = "whole-body-qp"
    Gains = WholeBodyGains
    uses = ("M", "bias", "J'", "limits")

    def __init__(self, gains: Any) -> None:
        super().__init__(gains)
        self._solve = solver(self.name, "qp")

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again, with the limits that act."""
        self._limits = self.torque_limits(robot, self.gains.torque_limits)
        super().reset(robot, task, dt)
        self._settings |= {"torque_limits": plain_limits(self._limits)}

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits, shape (nz,)."""
        v = super().step(t, q, z, z_dot)
        return np.clip(v, -self._limits, self._limits)  # the solver's tolerance

    def acceleration(
        self, robot: MobileManipulator, space: TaskSpace, z_dot: Array
    ) -> Callable[[], int]:
        """See :class:`ResolvedAcceleration`."""
        gains, now, wanted = self.gains, space.now, np.zeros(space.p)
        root, rho, solve = np.sqrt(base_metric(robot)), float(gains.rho), self._solve
        k_d, k_0 = float(gains.k_d), float(gains.k_0) * unit_stiffness(robot, self.criterion)
        bounds = JointBounds(robot, float(gains.kappa))
        limited = np.flatnonzero(np.isfinite(self._limits))
        limit, motors = self._limits[limited], len(limited)
        soft = np.arange(motors + len(bounds.joints)) >= motors

        def minimise() -> int:
            # in zeta' = Omega^-1/2 z'
            J = space.J * root
            z_0 = -k_0 * root**2 * (now.C.T @ self.criterion.gradient(now.q))
            H = J.T @ J + rho * np.eye(len(root))
            f = -J.T @ wanted - rho * k_d * (z_0 - now.z) / root
            actuated = np.linalg.solve(now.B, np.column_stack([now.M * root, now.bias]))[limited]
            least, largest = bounds.of(now.q, now.q_dot)
            drift = now.C_dot_z[bounds.joints]
            A = np.concatenate([actuated[:, :-1], now.C[bounds.joints] * root])
            lower = np.concatenate([-limit - actuated[:, -1], least - drift])
            upper = np.concatenate([limit - actuated[:, -1], largest - drift])
            z_dot[:] = root * solve(H, f, A, lower, upper, soft)
            return 0

        given = (space.f, space.J, space.J_dot_z, space.p_d, now.z)
        track = bind(tracking_acceleration, *given, float(gains.K_p), float(gains.K_v), wanted)
        return sequence(track, minimise)


class JointBounds:
    """Bounds of q'' that keep joints within their limits of velocity and position.

    Args:
        robot: Has the limits.
        kappa: Rate at which either may be approached (1/s).

    Attributes:
        joints: Where the joints with a limit are in q.
    """

    def __init__(self, robot: MobileManipulator, kappa: float) -> None:
        limits, self._kappa = robot.limits, kappa
        ends = np.isfinite(limits.lower) | np.isfinite(limits.upper)
        self.joints = np.flatnonzero(ends | np.isfinite(limits.joint_velocity))
        self._lower, self._upper = limits.lower[self.joints], limits.upper[self.joints]
        self._velocity = limits.joint_velocity[self.joints]

    def of(self, q: Array, q_dot: Array) -> tuple[Array, Array]:
        """The least and the largest q'' (rad/s^2, m/s^2) of these joints at (q, q')."""
        q, q_dot, kappa = q[self.joints], q_dot[self.joints], self._kappa
        slowest, fastest = (kappa * (end * self._velocity - q_dot) for end in (-1.0, 1.0))
        ends = (kappa**2 * (end - q) - 2.0 * kappa * q_dot for end in (self._lower, self._upper))
        least, largest = (np.clip(end, slowest, fastest) for end in ends)
        return least, largest


controllers.register(WholeBodyQP.name, WholeBodyQP)
