"""Adaptive control of Slotine and Li, ``adaptive``, with Pinocchio's regressor reduced by C."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Columns, Index, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.controllers.baselines import (
    TrackingGains,
    inverse_acceleration,
    tracking_acceleration,
)
from mobman.controllers.bounds import sampled_states
from mobman.controllers.gains import Positive, gain
from mobman.controllers.protocol import controllers
from mobman.controllers.robust import StillAtLimits
from mobman.controllers.task_errors import Entry, Stop
from mobman.linalg import dot, solve
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

PER_BODY = 10  # mass, first moments, and xx, xy, yy, xz, yz, zz of the inertia about the joint
_SAMPLES = 20


@dataclass(frozen=True, kw_only=True)
class AdaptiveGains(TrackingGains):
    """Gains of the outer loop, of the velocity's error, and of the adaptation."""

    k_d: Positive = gain(40.0, "s^-1", "damping of the velocity's error, -k_d M s")
    omega: Positive = gain(20.0, "s^-1", "bandwidth of the adaptation, which scales Gamma")


@controllers.register("adaptive")
class Adaptive(StillAtLimits):
    r"""Adaptive control of the inertial parameters :math:`\theta` of all bodies, from the nominal ones:

    .. math:: B v = Y(q, z, z_r, \dot z_r)\,\theta - k_d \bar M s, \quad
        \dot\theta = -\Gamma\,Y^T s, \quad s = z - z_r, \quad
        \dot z_r = J^{-1}(\ddot p_d - K_v \dot e - K_p e - \dot J z),

    .. math:: Y \theta = M \dot z_r + P z_r + G
        = C^T\left(M'\,(C \dot z_r + \dot C z_r) + C'(q, \dot q)\,C z_r + g\right),

    with the Coriolis matrix C' of Christoffel's symbols, so that :math:`\dot M - 2P` is skew-symmetric,
    and :math:`V = (s^T M s + \tilde\theta^T \Gamma^{-1} \tilde\theta)/2` has the rate
    :math:`-k_d\,s^T \bar M s` with the nominal :math:`\bar M` of the damping. The reference
    velocity z_r is the integral of the acceleration that the other baselines ask for, so that J' along z
    is all that is needed of J'.

    Pinocchio's regressor gives :math:`M' a + Q(u) + g`, with the Coriolis forces Q quadratic in u. As
    :math:`C'(q, a) b = Q((a + b)/2) - Q((a - b)/2)`, it is evaluated at two velocities, and weighted 2
    and -1 so that gravity is counted once.

    :math:`\Gamma = \gamma\,\mathrm{diag}(1, l^2, l^4)` for masses, first and second moments, with l the
    radius of gyration of the arm's bodies about their joints, and :math:`\gamma` such that
    :math:`\lambda_{max}(M^{-1} Y \Gamma Y^T) = \omega^2` over sampled states: no mode of the adaptation
    is faster than ``omega``, whatever the robot's size. Bodies without mass have no parameters.

    While a torque is beyond a limit that acts, theta stands still and z_r is z.

    Slotine and Li 1987 and 1988.

    Attributes:
        theta: Estimate, ten parameters a body in Pinocchio's order, shape (10 bodies,).
        Gamma: Diagonal of the adaptation's gain, of the same shape.
    """

    name = "adaptive"
    Gains = AdaptiveGains
    signals_in_place = True

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        regressor = Regressor(robot, self._space.now, self.values["z_dot"])
        self.theta, self.s = nominal_parameters(robot), np.zeros(robot.nz)
        self.Gamma = adaptation_gain(robot, task, self.values["omega"])
        self._state, self._z_r, self._z = self.theta, regressor.z_r, self._space.now.z
        self.values |= {"Y": regressor.Y, "Gamma": self.Gamma, "theta": self.theta}
        self.values |= {"z_r": regressor.z_r, "s": self.s}
        resolved = [self.entry(tracking_acceleration), self.entry(inverse_acceleration)]
        return [*resolved, regressor.evaluate, self.entry(adaptive_torque)]

    def stand_still(self, before: Array) -> None:
        """Forget what a tick whose torque does not act said of theta, and start from z again."""
        super().stand_still(before)
        self._z_r[:] = self._z

    def signals(self) -> dict[str, Array]:
        """The velocity's error s and the estimate theta."""
        return {"adaptation/s": self.s, "adaptation/theta": self.theta}


class Regressor:
    """Y of the reduced dynamics, shape (nz, 10 bodies), along a reference velocity and acceleration.

    Args:
        robot: The nominal robot.
        now: Its buffers, filled with the state.
        z_r_dot: Acceleration, shape (nz,).

    Attributes:
        Y: The regressor.
        z_r: Reference velocity, shape (nz,); not a number until its first use, when it becomes z.
        evaluate: Fills Y.
    """

    def __init__(self, robot: MobileManipulator, now: Buffers, z_r_dot: Array) -> None:
        model, nq, q = robot.model, robot.nq, now.q
        first, second = model.createData(), model.createData()
        self.Y = np.zeros((robot.nz, PER_BODY * (model.njoints - 1)))
        self.z_r = np.full(robot.nz, math.nan)
        mean, half, difference, none = np.zeros((4, nq))
        compute = pin.computeJointTorqueRegressor

        def run_regressors() -> int:
            compute(model, first, q, mean, half)
            compute(model, second, q, difference, none)
            return 0

        reference = (now.C, now.N_rate, robot.platform_index, now.q_dot, now.z, self.z_r, z_r_dot)
        regressors = (first.jointTorqueRegressor, second.jointTorqueRegressor)
        self.evaluate = sequence(
            bind(reference_motion, *reference, mean, half, difference),
            run_regressors,
            bind(reduced_regressor, now.C, *regressors, self.Y),
        )


@kernel
def reference_motion(
    C: Matrix,
    N_rate: Matrix,
    platform_index: Index,
    q_dot: Vector,
    z: Vector,
    z_r: Vector,
    z_r_dot: Vector,
    mean: Vector,
    half: Vector,
    difference: Vector,
) -> None:
    """Velocities and half of the acceleration of q that Pinocchio's regressor is evaluated at."""
    if not math.isfinite(z_r[0]):
        for i in range(z.shape[0]):
            z_r[i] = z[i]
    for i in range(q_dot.shape[0]):
        q_r_dot = dot(C[i], z_r)
        mean[i] = (q_dot[i] + q_r_dot) / math.sqrt(8.0)
        difference[i] = 0.5 * (q_dot[i] - q_r_dot)
        half[i] = 0.5 * dot(C[i], z_r_dot)
    for i in range(platform_index.shape[0]):
        for j in range(N_rate.shape[1]):
            half[platform_index[i]] += 0.5 * N_rate[i, j] * z_r[j]


@kernel
def reduced_regressor(C: Matrix, first: Columns, second: Columns, Y: Matrix) -> None:
    """Y = C^T (2 first - second)."""
    for k in range(Y.shape[1]):
        for i in range(Y.shape[0]):
            Y[i, k] = 0.0
        for j in range(C.shape[0]):
            entry = 2.0 * first[j, k] - second[j, k]
            if entry != 0.0:
                for i in range(Y.shape[0]):
                    Y[i, k] += C[j, i] * entry


@kernel
def adaptive_torque(
    M: Matrix,
    B: Matrix,
    Y: Matrix,
    z: Vector,
    z_dot: Vector,
    k_d: float,
    dt: float,
    Gamma: Vector,
    theta: Vector,
    z_r: Vector,
    s: Vector,
    force: Vector,
    work: Matrix,
    v: Vector,
) -> int:
    """B v = Y theta - k_d M s; then theta and z_r of the next tick, z_r' being ``z_dot``."""
    nz = z.shape[0]
    for i in range(nz):
        s[i] = z[i] - z_r[i]
    for i in range(nz):
        force[i] = dot(Y[i], theta) - k_d * dot(M[i], s)
    for k in range(theta.shape[0]):
        for i in range(nz):
            theta[k] -= dt * Gamma[k] * Y[i, k] * s[i]
    for i in range(nz):
        z_r[i] += dt * z_dot[i]
    return Stop.NO_INVERSE if solve(B, force, v, work) != 0 else 0


def nominal_parameters(robot: MobileManipulator) -> Array:
    """Inertial parameters of all bodies, ten each in Pinocchio's order, shape (10 bodies,)."""
    bodies = list(robot.model.inertias)[1:]
    return np.concatenate([body.toDynamicParameters() for body in bodies])


def adaptation_gain(robot: MobileManipulator, task: Task, omega: float) -> Array:
    """Diagonal of Gamma, shape (10 bodies,); see :class:`Adaptive`."""
    by_body = nominal_parameters(robot).reshape(-1, PER_BODY)
    masses = by_body[:, 0]
    arm = np.isin(np.arange(len(masses)), robot.arm.joints) & (masses > 0.0)
    second_moments = by_body[:, [4, 6, 9]].sum(axis=1)  # trace: twice the polar second moment
    l2 = float(0.5 * second_moments[arm].sum() / masses[arm].sum())
    scale = np.repeat([1.0, l2, l2**2], [1, 3, 6])
    diagonal = np.where((masses > 0.0)[:, None], scale, 0.0).ravel()
    random = np.random.default_rng(0)
    now, z_r_dot = Buffers(robot), np.zeros(robot.nz)
    regressor, greatest = Regressor(robot, now, z_r_dot), 0.0
    for _, q in sampled_states(robot, task)[:_SAMPLES]:
        now.q[:], z_r_dot[:] = q, random.standard_normal(robot.nz)
        now.velocity()
        regressor.evaluate()
        stiffness = (regressor.Y * diagonal) @ regressor.Y.T
        inertia = robot.reduced_inertia(q)
        greatest = max(
            greatest, float(np.linalg.eigvals(np.linalg.solve(inertia, stiffness)).real.max())
        )
    return diagonal * (omega**2 / greatest)
