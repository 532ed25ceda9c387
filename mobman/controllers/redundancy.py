"""Redundancy resolution with a secondary task: singularity-robust task priority that avoids the joints'
limits, ``task-priority``, and a quadratic program with all limits, ``whole-body-qp``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array
from mobman.controllers.baselines import (
    ResolvedAcceleration,
    TrackingGains,
    computed_torque,
    tracking_acceleration,
)
from mobman.controllers.gains import NotNegative, Positive, condition, gain
from mobman.controllers.motors import LimitedMotors, TorqueLimits, plain_limits
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Stop
from mobman.errors import MobmanError, SingularityError
from mobman.model.joint_limits import LimitZones
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.tasks.task import Task

_POSTURES, _NEAR = 20, 0.5  # how many, within how much of the rest posture (rad, m)
_SOFT, _HARD = 8, 0  # DAQP's kinds of constraints
_SOLVED = (1, 2)  # its exit flags: optimal; optimal with soft bounds that do not hold
_LIMIT = 1000  # iterations
_TOLERANCE = 1e-9  # of the bounds


@dataclass(frozen=True, kw_only=True)
class SecondaryGains(TrackingGains):
    """Gains of a secondary task, z = z_0, which the tip does not see."""

    k_d: Positive = gain(10.0, "s^-1", "rate at which z reaches z_0 where the tip does not see it")
    k_0: NotNegative = gain(
        2.0, "s^-1", "descent of the criterion in z_0, that of the stiffest motion"
    )


_APART = condition("be at most 0.5, where both zones meet", lambda zone: zone <= 0.5)


@dataclass(frozen=True, kw_only=True)
class PriorityGains(SecondaryGains):
    """Gains of the tip's task, of the secondary one, and of the inverse near singularities."""

    k_l: NotNegative = gain(
        5.0, "s^-1", "speed away from a joint's limit in z_0, per depth in its zone"
    )
    zone: Annotated[NotNegative, _APART] = gain(
        0.1, "1", "share of a joint's range, at each end, that is avoided"
    )
    epsilon: Positive = gain(
        0.3, "1", "the inverse is damped below so many times sigma_min(J) near the rest posture"
    )


@controllers.register("task-priority")
class TaskPriority(ResolvedAcceleration):
    r"""Resolved acceleration of the tip, and below it a secondary task in its null space:

    .. math:: \dot z = J^\#(\ddot p_d - K_v \dot e - K_p e - \dot J z) + k_d (I - J^+ J) z_0
        - k_d (I - J^\# J) z, \quad
        z_0 = k_l d - \frac{k_0}{\lambda_{max}}\Omega C^T\frac{\partial F}{\partial q},
        \quad B v = M \dot z + Pz + G.

    d is how deep each joint of the arm is in the zone before its limit. All inverses are in the metric
    :math:`\Omega` of the base. With the singular values :math:`\sigma_i` of
    :math:`J\Omega^{1/2}`, those of :math:`J^\#` are :math:`\sigma_i/\max(\sigma_i, \epsilon)^2`: the
    damping :math:`\lambda_i^2 = \epsilon^2 - \sigma_i^2` below :math:`\epsilon`, 0 above. The
    projector of the secondary task is that of the exact :math:`J^+`, so that it never moves the tip, nor
    is it inverted: there are no algorithmic singularities.

    Chiaverini 1997; the damping: Maciejewski and Klein 1988; the limits: Liegeois 1977.
    """

    name = "task-priority"
    Gains = PriorityGains
    uses = ("M", "bias", "J'", "limits")

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        space, k, root = self._space, self.values, np.sqrt(base_metric(robot))
        now, wanted, z_dot, k_d, k_l = space.now, k["wanted"], k["z_dot"], k["k_d"], k["k_l"]
        k_0 = k["k_0"] * unit_stiffness(robot, self.criterion)
        epsilon = k["epsilon"] * usual_singular_value(robot, space.task_map, root)
        zones, back = LimitZones(robot, k["zone"]), np.zeros(robot.nz)

        def prioritise() -> int:
            # J Omega^1/2 = U S V^T, in the coordinates zeta = Omega^-1/2 z
            try:
                U, sigma, Vt = np.linalg.svd(space.J * root, full_matrices=False)
            except np.linalg.LinAlgError:  # J is not finite
                return Stop.NO_ACCELERATION
            damped = np.maximum(sigma, epsilon) ** 2
            back[robot.n_alpha :] = -k_l * zones.depth(now.q)
            secondary = back - k_0 * root**2 * (now.C.T @ self.criterion.gradient(now.q))
            zeta_0, zeta = secondary / root, now.z / root
            # k_d (I - V V^T) zeta_0 - k_d (I - V S^2/damped V^T) zeta
            along = sigma * (U.T @ wanted) / damped
            along += k_d * (sigma**2 / damped * (Vt @ zeta) - Vt @ zeta_0)
            z_dot[:] = root * (k_d * (zeta_0 - zeta) + along @ Vt)
            return 0

        return [self.entry(tracking_acceleration), prioritise, self.entry(computed_torque)]


def usual_singular_value(robot: MobileManipulator, task_map: TaskMap, root: Array) -> float:
    """The median of sigma_min(J Omega^1/2) over postures near the rest posture, which may be singular
    itself; ``root`` is the diagonal of Omega^1/2."""
    random, found = np.random.default_rng(0), []
    for _ in range(_POSTURES):
        q = robot.q_rest.copy()
        q[robot.arm_index] += random.uniform(-_NEAR, _NEAR, robot.n)
        q = robot.consistent(q)
        J = task_map.jacobian(robot.tip_kinematics(q, np.zeros(robot.nz))) @ robot.velocity_map(q)
        found.append(np.linalg.svd(J * root, compute_uv=False)[-1])
    return float(np.median(found))


# Quadratic programs -----------------------------------------------------------------------------------


class LimitedProgram(LimitedMotors, ResolvedAcceleration):
    """Base of laws whose acceleration is the solution of a quadratic program, by DAQP, with torques
    within the gain ``torque_limits``.

    Raises:
        MobmanError: If DAQP is not installed, which the extra named ``extra`` brings.
    """

    extra: str

    def __init__(self, gains: Any) -> None:
        super().__init__(gains)
        try:
            import daqp
        except ImportError as error:
            raise MobmanError(
                f"controller {self.name!r} needs daqp, which is not installed; install it with: "
                f"pip install 'mobman[{self.extra}]'"
            ) from error
        self._daqp: Any = daqp.solve

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again, with the limits that act."""
        self._limits = self.torque_limits(robot, self.gains.torque_limits)
        super().reset(robot, task, dt)
        self._settings |= {"torque_limits": plain_limits(self._limits)}

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits, shape (nz,)."""
        v = super().step(t, q, z, z_dot)
        return np.clip(v, -self._limits, self._limits)  # the solver's tolerance

    def solve(
        self, H: Array, f: Array, A: Array, lower: Array, upper: Array, soft: NDArray[np.bool_]
    ) -> Array:
        """The x with the least x^T H x/2 + f^T x for which lower <= A x <= upper where ``soft``, shape
        (rows,), is False; elsewhere as far as it can, a violation costing half a million times its
        square. H is positive definite, and bounds may be inf.

        Raises:
            SingularityError: If the hard bounds have no solution, or numbers are not finite.
        """
        kind = np.where(soft, _SOFT, _HARD).astype(np.int32)
        given: tuple[Any, ...] = (H, f, A, upper, lower, kind)
        x, _, flag, _ = self._daqp(*given, iter_limit=_LIMIT, primal_tol=_TOLERANCE)
        if flag not in _SOLVED or not np.isfinite(x).all():
            raise SingularityError(
                f"the quadratic program of {self.name!r} has no finite solution (DAQP's exit flag: "
                f"{flag})"
            )
        return np.array(x)


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

    Sentis and Khatib 2005; Escande, Mansard and Wieber 2014; the bounds: Del Prete 2018; the solver:
    Arnstrom, Bemporad and Axehill 2022.
    """

    name = "whole-body-qp"
    extra = "qp"
    Gains = WholeBodyGains
    uses = ("M", "bias", "J'", "limits")

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        space, k = self._space, self.values
        now, wanted, z_dot, rho, k_d = space.now, k["wanted"], k["z_dot"], k["rho"], k["k_d"]
        root, k_0 = np.sqrt(base_metric(robot)), k["k_0"] * unit_stiffness(robot, self.criterion)
        bounds = JointBounds(robot, k["kappa"])
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
            z_dot[:] = root * self.solve(H, f, A, lower, upper, soft)
            return 0

        return [self.entry(tracking_acceleration), minimise, self.entry(computed_torque)]


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
