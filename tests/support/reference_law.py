"""The paper's cascade written out once more, equation by equation, for comparison tick by tick."""

from __future__ import annotations

import numpy as np

from mobman.controllers.task_errors import TaskSpace
from mobman.model.criterion import Posture
from support.inclusions import inclusion
from support.task_errors import errors_at


def power(x, exponent):
    return np.sign(x) * np.abs(x) ** exponent


class ReferenceLaw:
    """(31)-(35) and (45)-(56), or (65)-(66), with a zero-order hold; gains by the paper's names.

    With ``omega``, the diagonal of a metric, (43)-(44) in it and a descent of F in the null space.
    The inclusion of the dynamic stage is that of ``gains["metric_scale"]`` times M, a number here.

    What it shares with the project is f, J and J' z, which have their own tests.
    """

    def __init__(self, robot, task, dt, gains, *, simplified=False, inverse=False, omega=None):
        self.robot, self.dt, self.inverse = robot, dt, inverse
        self.implicit = gains["discretization"] == "implicit"
        self.omega = None if omega is None else np.diag(omega)
        self.g = gains
        criterion = self.criterion = Posture.of(robot, gains["c_F"])
        space = self.space = TaskSpace(robot, task, None if simplified else criterion)
        self.v_ref, self.integral_v_ref = np.zeros(robot.nz), np.zeros(robot.nz)
        self.integral_31, self.integral_51 = np.zeros(space.p), np.zeros(robot.nz)
        self.v = np.zeros(robot.nz)

    def step(self, t, q, z, z_dot):
        g, dt, norm = self.g, self.dt, np.linalg.norm
        m, _, b = self.robot.dynamics(q, z)
        f = errors_at(self.space, t, q, z)
        # kinematic stage
        e_ddot = f.J @ self.v_ref + f.J_dot_z - f.p_ddot
        inner = power(f.e_dot, 9 / 7) + g["lambda_0"] ** (9 / 7) * f.e
        integrand = g["lambda_2"] * power(e_ddot, 3 / 5)
        integrand = integrand + g["lambda_2"] * g["lambda_1"] ** (3 / 5) * power(inner, 1 / 3)
        s = e_ddot + self.integral_31
        bound = g["w_1"] + g["w_2"] * norm(q - self.robot.q_rest)
        w = norm(integrand - f.p_dddot) + bound * (
            g["w_3k"] * norm(self.v_ref) * norm(z) + g["w_4k"] * norm(z) ** 3
        )
        k = g["c"] / g["a"] * (w + g["c_0"])
        omega = np.eye(len(z)) if self.omega is None else self.omega
        gram = f.J @ omega @ f.J.T
        n = self._unit(s, dt * (integrand - f.p_dddot), np.eye(len(s)), dt * k * gram)
        v_ref_dot = omega @ f.J.T @ (-k * n)
        if self.omega is not None:
            c, rest = self.robot.velocity_map(q), self.robot.velocity_map(self.robot.q_rest)
            stiffness = omega @ rest.T @ self.criterion.hessian(q) @ rest
            descent = omega @ c.T @ self.criterion.gradient(q)
            a_n = -g["k_v"] * z - g["k_0"] * descent / np.linalg.eigvals(stiffness).real.max()
            y = -g["kappa"] / (1 + g["kappa"] * dt) * (self.v_ref - a_n)
            damped = gram + 1e-8 * np.trace(gram) / len(s) * np.eye(len(s))
            v_ref_dot = v_ref_dot + y - omega @ f.J.T @ np.linalg.solve(damped, f.J @ y)
        # dynamic stage
        alpha_1 = g["alpha_1"]
        e, e_dot = z - self.integral_v_ref, z_dot - self.v_ref
        integrand_51 = g["Lambda_0"] * power(e, alpha_1)
        integrand_51 = integrand_51 + g["Lambda_1"] * power(e_dot, 2 * alpha_1 / (1 + alpha_1))
        big_s = e_dot + self.integral_51
        w_7, w_8 = (1.0, 0.0) if self.inverse else (g["w_7"], g["w_8"])
        chi = (
            g["w_3"] * norm(self.v) * norm(z)
            + g["w_4"] * norm(z) ** 3
            + g["w_5"] * (norm(z) + norm(z) * g["beta_0"])
            + g["w_6"] * g["beta_1"]
            + w_7 * norm(integrand_51 - v_ref_dot)
            + w_8 * norm(z) * norm(big_s)
            + g["w_9"] * norm(z) * norm(z_dot)
        )
        k = g["C"] / g["A"] * (chi + g["C_0"])
        gram = dt * k * (np.eye(len(z)) if self.inverse else b @ b.T)
        metric = g["metric_scale"] * m
        n = self._unit(big_s, dt * (integrand_51 - v_ref_dot), metric, gram)
        v_dot = np.linalg.inv(b) @ (-k * n) if self.inverse else b.T @ (-k * n)
        # the hold
        self.s, self.S = s, big_s
        self.integral_31 = self.integral_31 + dt * integrand
        self.integral_51 = self.integral_51 + dt * integrand_51
        self.integral_v_ref = self.integral_v_ref + dt * self.v_ref + dt**2 / 2 * v_ref_dot
        self.v_ref = self.v_ref + dt * v_ref_dot
        self.v = self.v + dt * v_dot
        return self.v

    def _unit(self, s, drift, metric, gram):
        if self.implicit:
            return inclusion(metric, gram, s + drift, self.g["boundary_layer"])
        return s / max(np.linalg.norm(s), self.g["boundary_layer"])
