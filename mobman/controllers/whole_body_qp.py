"""Whole-body control by a quadratic program with all limits, ``whole-body-qp``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.compiled import sequence
from mobman.controllers.baselines import SecondaryGains
from mobman.controllers.gains import Positive, gain
from mobman.controllers.limits import TorqueLimits
from mobman.controllers.protocol import controllers
from mobman.controllers.quadratic_program import LimitedProgram
from mobman.controllers.task_errors import Entry, TaskSpace
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator


@dataclass(frozen=True, kw_only=True)
class WholeBodyGains(SecondaryGains):
    """Gains of the tip's task, of what it leaves free, and of the approach to limits."""

    rho: Positive = gain(1e-5, "1", "weight of that, against the tip's task")
    kappa: Positive = gain(
        10.0, "s^-1", "rate at which a velocity or a joint may approach its limit"
    )
    torque_limits: TorqueLimits = gain(None, "N m, N", "limits of |v|, by default those that act")


@controllers.register("whole-body-qp")
class WholeBodyQP(LimitedProgram):
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
    """

    name = "whole-body-qp"
    extra = "qp"
    Gains = WholeBodyGains
    uses = ("M", "bias", "J'", "limits")

    def acceleration(self, robot: MobileManipulator, space: TaskSpace, z_dot: Array) -> Entry:
        now, wanted, solve = space.now, np.zeros(space.p), self._solve
        rho, kappa, k_d, k_0 = self.numbers("rho", "kappa", "k_d", "k_0")
        root, k_0 = np.sqrt(base_metric(robot)), k_0 * unit_stiffness(robot, self.criterion)
        bounds = JointBounds(robot, kappa)
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

        return sequence(self.resolved(space, wanted), minimise)


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
