"""Laws that solve quadratic programs with hard and soft bounds, by DAQP, which extras bring; of these
whole-body control with all limits, ``whole-body-qp``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing

from mobman.arrays import Array
from mobman.controllers.baselines import (
    ResolvedAcceleration,
    SecondaryGains,
    computed_torque,
    tracking_acceleration,
)
from mobman.controllers.gains import Positive, gain
from mobman.controllers.motors import LimitedMotors, TorqueLimits, plain_limits
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry
from mobman.errors import MobmanError, SingularityError
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_SOFT, _HARD = 8, 0  # DAQP's kinds of constraints
_SOLVED = (1, 2)  # its exit flags: optimal; optimal with soft bounds that do not hold
_LIMIT = 1000  # iterations
_TOLERANCE = 1e-9  # of the bounds
Flags = np.typing.NDArray[np.bool_]
Solve = Callable[[Array, Array, Array, Array, Array, Flags], Array]


class LimitedProgram(LimitedMotors, ResolvedAcceleration):
    """Base of laws whose acceleration is a program's solution, with torques within ``torque_limits``.

    Raises:
        MobmanError: If the solver, of the extra named ``extra``, is not installed.
    """

    extra: str

    def __init__(self, gains: Any) -> None:
        super().__init__(gains)
        self._solve = solver(self.name, self.extra)

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again, with the limits that act."""
        self._limits = self.torque_limits(robot, self.gains.torque_limits)
        super().reset(robot, task, dt)
        self._settings |= {"torque_limits": plain_limits(self._limits)}

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits, shape (nz,)."""
        v = super().step(t, q, z, z_dot)
        return np.clip(v, -self._limits, self._limits)  # the solver's tolerance


def solver(law: str, extra: str) -> Solve:
    """A function of (H, f, A, lower, upper, soft) that gives the x with the least x^T H x/2 + f^T x.

    lower <= A x <= upper holds where ``soft`` is False, shape (rows,); elsewhere as far as it can, a
    violation costing half a million times its square. H is positive definite, and bounds may be inf.
    The function raises SingularityError where no solution is found: the hard bounds have none, or
    numbers are not finite.

    Args:
        law: Name of the law that needs it, for the message.
        extra: What to install for it.

    Raises:
        MobmanError: If DAQP is not installed.
    """
    try:
        import daqp
    except ImportError as error:
        raise MobmanError(
            f"controller {law!r} needs daqp, which is not installed; install it with: "
            f"pip install 'mobman[{extra}]'"
        ) from error

    def solve(H: Array, f: Array, A: Array, lower: Array, upper: Array, soft: Flags) -> Array:
        kind = np.where(soft, _SOFT, _HARD).astype(np.int32)
        given: tuple[Any, ...] = (H, f, A, upper, lower, kind)
        x, _, flag, _ = daqp.solve(*given, iter_limit=_LIMIT, primal_tol=_TOLERANCE)
        if flag not in _SOLVED or not np.isfinite(x).all():
            raise SingularityError(
                f"the quadratic program of {law!r} has no finite solution (DAQP's exit flag: {flag})"
            )
        return np.array(x)

    return solve


# Whole-body control ---------------------------------------------------------------------------------


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
        space, k, solve = self._space, self.values, self._solve
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
            z_dot[:] = root * solve(H, f, A, lower, upper, soft)
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
