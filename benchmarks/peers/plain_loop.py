"""The closed loop of ``tsm`` as one would write it by hand, with numpy, Pinocchio and scipy.

One file, for a differential-drive robot: the law (34)-(35) and (55)-(56) in the implicit
discretisation, on the extended Jacobian (13), and the plant (17) under a held torque. It is what a
closed loop costs without mobman, and an independent check of it: of the robot it takes the Pinocchio
model and some numbers, none of mobman's code. SI units.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg import null_space, polar
from scipy.optimize import brentq

PAPER_GAINS: dict[str, float] = {
    # kinematic stage
    "lambda_0": 1.0,
    "lambda_1": 11.0,
    "lambda_2": 6.0,
    "c": 2.0,
    "c_0": 1.0,
    "w_1": 1.5,
    "w_2": 0.001,
    "w_3k": 2.0,
    "w_4k": 3.0,
    # dynamic stage
    "Lambda_0": 11.0,
    "Lambda_1": 6.0,
    "alpha_1": 3 / 5,
    "C": 2.0,
    "C_0": 1.0,
    "w_3": 3.0,
    "w_4": 9.0,
    "w_5": 12.0,
    "w_7": 6.0,
    "w_8": 0.011,
    "w_9": 6.0,
}
LARGEST_STEP = 1e-3  # s: the plant's integration step is at most this


def plain_loop(
    robot: Any,
    task: Any,
    gains: dict[str, float],
    duration: float,
    dt: float = 1e-3,
    axes: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """Run the closed loop from rest at ``robot.q_rest``.

    Args:
        robot: A loaded robot on a differential platform, for its model and numbers.
        task: Anything with ``desired(t) -> (p_d, p_d', p_d'', p_d''')``, each of shape (3,).
        gains: ``a`` of (22) and ``A`` of (54), and whatever shall differ from the paper's gains.
        duration: s.
        dt: Sampling period (s).
        axes: Rows that the first axes of ker j are to be near to; any axes by default.

    Returns:
        ``t``, ``q``, ``z``, ``torque`` and ``error`` (of the tip), one row a tick, the last included.
    """
    equations = Equations(robot)
    equations.complement = axes
    law = Law(equations, task, {**PAPER_GAINS, **gains}, dt)
    ticks = round(duration / dt)
    substeps = max(1, math.ceil(dt / LARGEST_STEP - 1e-9))
    n = ticks + 1
    record = {
        "t": np.arange(n) * dt,
        "q": np.empty((n, equations.nq)),
        "z": np.empty((n, equations.nz)),
        "torque": np.empty((n, equations.nz)),
        "error": np.empty((n, 3)),
    }
    q, z, torque = robot.q_rest.copy(), np.zeros(equations.nz), np.zeros(equations.nz)
    for tick in range(n):
        M, h, B = equations.dynamics(q, z)
        z_dot = np.linalg.solve(M, B @ torque - h)  # exact, under the torque held until now
        torque, error = law.step(tick * dt, q, z, z_dot, M, B)
        record["q"][tick], record["z"][tick] = q, z
        record["torque"][tick], record["error"][tick] = torque, error
        if tick < ticks:
            for _ in range(substeps):
                q, z = rk4(equations, q, z, torque, dt / substeps)
    return record


def rk4(
    equations: Equations, q: np.ndarray, z: np.ndarray, torque: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """(q, z) a step of h later, under a held torque."""

    def slopes(q: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        M, bias, B = equations.dynamics(q, z)
        return equations.velocity_map(q) @ z, np.linalg.solve(M, B @ torque - bias)

    q1, z1 = slopes(q, z)
    q2, z2 = slopes(q + h / 2 * q1, z + h / 2 * z1)
    q3, z3 = slopes(q + h / 2 * q2, z + h / 2 * z2)
    q4, z4 = slopes(q + h * q3, z + h * z3)
    return q + h / 6 * (q1 + 2 * q2 + 2 * q3 + q4), z + h / 6 * (z1 + 2 * z2 + 2 * z3 + z4)


class Equations:
    """The robot: constraints (6), velocity map (7), reduced dynamics (17), extended Jacobian (13)."""

    def __init__(self, robot: Any) -> None:
        self.model = robot.model
        self.data = robot.model.createData()
        self.frame = robot.tip_frame
        self.q_rest = robot.q_rest
        self.weights = robot.criterion_weights
        self.nq, self.nz = robot.nq, robot.nz
        self.platform, self.arm = robot.platform_index, robot.arm_index
        self.heading = self.platform[2]
        base = robot.platform
        self.R, self.W, self.a, self.kappa = base.radius, base.half_track, base.offset, base.kappa
        self.right, self.left = base.signs
        # the motors drive the wheels and the arm's joints
        self.motors = np.zeros((self.nq, self.nz))
        self.motors[self.platform[3:], [0, 1]] = 1.0
        self.motors[self.arm, np.arange(2, self.nz)] = 1.0
        self.complement: np.ndarray | None = None

    def constraints(self, q: np.ndarray) -> np.ndarray:
        """A of (6): no lateral slip, no slip of the right and of the left wheel, shape (3, nq)."""
        c, s = np.cos(q[self.heading]), np.sin(q[self.heading])
        A = np.zeros((3, self.nq))
        A[:, self.platform] = [
            [s, -c, self.a, 0, 0],
            [c, s, self.W, -self.R * self.right, 0],
            [c, s, -self.W, 0, -self.R * self.left],
        ]
        return A

    def constraints_rate(self, q: np.ndarray, q_dot: np.ndarray) -> np.ndarray:
        """dA/dt, shape (3, nq)."""
        c, s = np.cos(q[self.heading]), np.sin(q[self.heading])
        rate = np.zeros((3, self.nq))
        rate[:, self.platform[:2]] = [[c, s], [-s, c], [-s, c]]
        return rate * q_dot[self.heading]

    def velocity_map(self, q: np.ndarray) -> np.ndarray:
        """C of (9), with N of (7) times kappa for the platform, shape (nq, nz)."""
        c, s = np.cos(q[self.heading]), np.sin(q[self.heading])
        y = self.kappa * self.R / (2 * self.W) * np.array([self.right, self.left])
        C = np.zeros((self.nq, self.nz))
        C[self.platform, :2] = [
            [y[0] * (self.W * c - self.a * s), y[1] * (self.W * c + self.a * s)],
            [y[0] * (self.W * s + self.a * c), y[1] * (self.W * s - self.a * c)],
            [y[0], -y[1]],
            [self.kappa, 0],
            [0, self.kappa],
        ]
        C[self.arm, np.arange(2, self.nz)] = 1.0
        return C

    def drift(self, q: np.ndarray, z: np.ndarray) -> np.ndarray:
        """C' z, shape (nq,): the velocity of (x1, x2) turns with the heading."""
        q_dot = self.velocity_map(q) @ z
        x, y = self.platform[:2]
        drift = np.zeros(self.nq)
        drift[x] = -q_dot[y] * q_dot[self.heading]
        drift[y] = q_dot[x] * q_dot[self.heading]
        return drift

    def dynamics(self, q: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M (nz, nz), bias (nz,) and B (nz, nz) of M z' + bias = B v."""
        C = self.velocity_map(q)
        inertia = pin.crba(self.model, self.data, q)
        nonlinear = pin.nonLinearEffects(self.model, self.data, q, C @ z)
        M = C.T @ inertia @ C
        return M, C.T @ (inertia @ self.drift(q, z) + nonlinear), C.T @ self.motors

    def extended(
        self, q: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The tip (3,), f_a (nz - 3,), the extended Jacobian (nz, nz) and its rate times z (nz,)."""
        model, data, frame, axes = self.model, self.data, self.frame, pin.LOCAL_WORLD_ALIGNED
        C = self.velocity_map(q)
        q_dot, drift = C @ z, self.drift(q, z)
        pin.computeJointJacobiansTimeVariation(model, data, q, q_dot)
        tip = pin.updateFramePlacement(model, data, frame).translation.copy()
        J = pin.getFrameJacobian(model, data, frame, axes)
        J_dot = pin.getFrameJacobianTimeVariation(model, data, frame, axes)
        j = np.vstack((J[:3], self.constraints(q)))
        j_dot = np.vstack((J_dot[:3], self.constraints_rate(q, q_dot)))
        j_plus = np.linalg.pinv(j)

        # orthonormal rows of ker j, carried along the motion
        if self.complement is None:
            self.complement = null_space(j).T
        else:
            self.complement = polar(self.complement @ (np.eye(self.nq) - j_plus @ j))[0]
        N = self.complement

        gradient = self.weights * (q - self.q_rest)
        multiplier = -j_plus.T @ gradient
        curvature = np.diag(self.weights) + self.hessian(J, multiplier[:3])
        curvature_rate = self.hessian_rate(J, J_dot, multiplier[:3])
        # the constraints depend on the heading alone
        c, s = np.cos(q[self.heading]), np.sin(q[self.heading])
        lateral, forward = multiplier[3], multiplier[4] + multiplier[5]
        column = np.array([c * lateral - s * forward, s * lateral + c * forward])
        curvature[self.platform[:2], self.heading] += column
        curvature_rate[self.platform[:2], self.heading] += (
            np.array([-column[1], column[0]]) * q_dot[self.heading]
        )
        # N' = -N j'^T (j^+)^T and the multiplier's own rate
        transport = j_plus.T @ (curvature @ q_dot)
        multiplier_rate = (
            -np.linalg.solve(j @ j.T, j_dot @ (gradient + j.T @ multiplier)) - transport
        )
        auxiliary_rate = N @ (
            j_dot.T @ (multiplier_rate - transport) + curvature_rate @ q_dot + curvature @ drift
        )
        return (
            tip,
            N @ gradient,
            np.vstack((J[:3] @ C, N @ curvature @ C)),
            np.concatenate((J_dot[:3] @ q_dot + J[:3] @ drift, auxiliary_rate)),
        )

    @staticmethod
    def hessian(J: np.ndarray, multiplier: np.ndarray) -> np.ndarray:
        """d(J_v^T lam)/dq, shape (nq, nq): lam . (w_i x v_j) for i before j, and symmetric."""
        product = J[:3].T @ pin.skew(multiplier) @ J[3:]
        return np.tril(product) + np.tril(product, -1).T

    @staticmethod
    def hessian_rate(
        J: np.ndarray,
        J_dot: np.ndarray,
        multiplier: np.ndarray,
    ) -> np.ndarray:
        """d/dt of the same at fixed lam, shape (nq, nq)."""
        cross = pin.skew(multiplier)
        product = J_dot[:3].T @ cross @ J[3:] + J[:3].T @ cross @ J_dot[3:]
        return np.tril(product) + np.tril(product, -1).T


class Law:
    """``tsm``: from (t, q, z, z') to the torque of a tick."""

    def __init__(self, equations: Equations, task: Any, gains: dict[str, float], dt: float) -> None:
        nz = equations.nz
        self.equations, self.task, self.gains, self.dt = equations, task, gains, dt
        self.v_ref = np.zeros(nz)
        self.integral_v_ref = np.zeros(nz)
        self.integral_g = np.zeros(nz)
        self.integral_G = np.zeros(nz)
        self.v = np.zeros(nz)

    def step(
        self,
        t: float,
        q: np.ndarray,
        z: np.ndarray,
        z_dot: np.ndarray,
        M: np.ndarray,
        B: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The torque (nz,) to hold for a period, and the tip's error (3,)."""
        k, dt, norm = self.gains, self.dt, np.linalg.norm
        tip, f_a, J, J_dot_z = self.equations.extended(q, z)
        p, p_dot, p_ddot, p_dddot = self.task.desired(t)
        none = np.zeros(len(f_a))

        # kinematic stage, (31)-(35)
        e = np.concatenate((tip - p, f_a))
        e_dot = J @ z - np.concatenate((p_dot, none))
        e_ddot = J @ self.v_ref + J_dot_z - np.concatenate((p_ddot, none))
        g = k["lambda_2"] * power(e_ddot, 3 / 5) + k["lambda_2"] * k["lambda_1"] ** (3 / 5) * power(
            power(e_dot, 9 / 7) + k["lambda_0"] ** (9 / 7) * e, 1 / 3
        )
        s = e_ddot + self.integral_g
        residual = g - np.concatenate((p_dddot, none))
        W = norm(residual) + (k["w_1"] + k["w_2"] * norm(q - self.equations.q_rest)) * (
            k["w_3k"] * norm(self.v_ref) * norm(z) + k["w_4k"] * norm(z) ** 3
        )
        gain = k["c"] / k["a"] * (W + k["c_0"])
        n = implicit_unit_vector(np.eye(len(e)), dt * gain * J @ J.T, s + dt * residual)
        v_ref_dot = -gain * J.T @ n

        # dynamic stage, (45)-(56)
        E = z - self.integral_v_ref
        E_dot = z_dot - self.v_ref
        alpha_2 = 2 * k["alpha_1"] / (1 + k["alpha_1"])
        G = k["Lambda_0"] * power(E, k["alpha_1"]) + k["Lambda_1"] * power(E_dot, alpha_2)
        S = E_dot + self.integral_G
        residual = G - v_ref_dot
        chi = (
            k["w_3"] * norm(self.v) * norm(z)
            + k["w_4"] * norm(z) ** 3
            + k["w_5"] * norm(z)
            + k["w_7"] * norm(residual)
            + k["w_8"] * norm(z) * norm(S)
            + k["w_9"] * norm(z) * norm(z_dot)
        )
        gain = k["C"] / k["A"] * (chi + k["C_0"])
        n = implicit_unit_vector(M, dt * gain * B @ B.T, S + dt * residual)
        v_dot = -gain * B.T @ n

        # over the tick, v' and v_ref' are constant
        self.integral_v_ref += dt * self.v_ref + dt**2 / 2 * v_ref_dot
        self.v_ref += dt * v_ref_dot
        self.integral_g += dt * g
        self.integral_G += dt * G
        self.v = self.v + dt * v_dot
        return self.v, e[:3]


def power(x: np.ndarray, exponent: float) -> np.ndarray:
    """sign(x) |x|^exponent, component by component."""
    return np.sign(x) * np.abs(x) ** exponent


def implicit_unit_vector(metric: np.ndarray, gram: np.ndarray, b: np.ndarray) -> np.ndarray:
    """n of s+ + metric^-1 gram n = b with n = s+/|s+|, or any |n| <= 1 that gives s+ = 0."""
    right = metric @ b
    n = np.linalg.solve(gram, right)
    if np.linalg.norm(n) <= 1:
        return n

    def excess(sigma: float) -> float:
        return float(np.linalg.norm(np.linalg.solve(sigma * metric + gram, right))) - 1

    high = float(np.linalg.norm(b))
    while excess(high) > 0:
        high *= 2
    sigma = brentq(excess, 0.0, high, xtol=1e-15, rtol=1e-14)
    n = np.linalg.solve(sigma * metric + gram, right)
    return n / np.linalg.norm(n)
