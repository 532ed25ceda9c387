"""The kinematic stage: a reference acceleration on the Jacobian's transpose, (31)-(35)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.gains import (
    Auto,
    Diagonal,
    diagonal,
    gain,
    require_at_least_one,
    require_bound,
    require_positive,
    require_positive_diagonal,
)
from mobman.controllers.task_errors import TaskErrors
from mobman.controllers.unit_vector import (
    Discretization,
    end_without_control,
    integrate,
    signed_power,
    transpose_gram,
    transpose_rate,
    unit_vector_steps,
)
from mobman.kernels.dense import dot, norm
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call


@dataclass(frozen=True, kw_only=True)
class KinematicGains:
    """Gains of (31)-(34); defaults are the paper's, section 4, but for ``a``."""

    lambda_0: Diagonal = gain(1.0, "mixed, see docs/theory.md", "lambda_0 of (31)")
    lambda_1: Diagonal = gain(11.0, "mixed, see docs/theory.md", "lambda_1 of (31)")
    lambda_2: Diagonal = gain(6.0, "mixed, see docs/theory.md", "lambda_2 of (31)")
    c: float = gain(2.0, "1", "c of (34), at least 1")
    c_0: float = gain(1.0, "m/s^3", "c_0 of (34)")
    a: float | Auto = gain("auto", "1", "lower bound of lambda_min(J J^T), (22)")
    w_1: float = gain(1.5, "1", "bound of |J|, |dJ/dq|, |d2J/dq2|, (21)")
    w_2: float = gain(0.001, "rad^-1", "growth of that bound with |q - q_rest|, (21)")
    w_3k: float = gain(2.0, "1", "factor of |v_ref||z| in W, (34)")
    w_4k: float = gain(3.0, "1", "factor of |z|^3 in W, (34)")

    def __post_init__(self) -> None:
        require_positive_diagonal(self, "lambda_0", "lambda_1", "lambda_2")
        require_positive(self, "c_0", "w_1", "w_2", "w_3k", "w_4k")
        require_at_least_one(self, "c", "Theorem 1")
        require_bound(self, "a", "0 < a <= lambda_min(J J^T) (22)")


class KinematicStage:
    r"""From task errors to :math:`\dot v_{ref} = J^T u_{ref}` (32)-(35).

    The same stage serves the extended Jacobian (34)-(35) and, fed with the tip's errors and Jacobian
    alone, the simplified law (43)-(44).

    Args:
        gains: Gains.
        a: The bound of (22) in force.
        errors: The task errors, which the steps below read.
        dt: Sampling period (s).
        discretization: See :func:`unit_vector_steps`.
        boundary_layer: Width (m/s^2), 0 for none.

    Attributes:
        s: (31), shape (p,).
        v_ref: Reference acceleration, shape (nz,).
        v_ref_dot: Its rate over the tick, shape (nz,).
        integral_v_ref: Its integral, shape (nz,).
    """

    def __init__(
        self,
        gains: KinematicGains,
        a: float,
        errors: TaskErrors,
        dt: float,
        discretization: Discretization,
        boundary_layer: float,
    ) -> None:
        self._gains, self._a, self._dt = gains, float(a), float(dt)
        self._errors = errors
        self._discretization, self._boundary_layer = discretization, boundary_layer
        p, nz = errors.J.shape
        self._integral_g = np.zeros(p)
        self.s = np.zeros(p)
        self.v_ref, self.v_ref_dot = np.zeros(nz), np.zeros(nz)
        self.integral_v_ref = np.zeros(nz)

    def steps(self, q: Array, q_rest: Array, z: Array) -> list[Call]:
        """v_ref' for a tick, once the errors at its start are known.

        Args:
            q: Configuration, shape (nq,).
            q_rest: Preferred posture, shape (nq,).
            z: Reduced velocity, shape (nz,).
        """
        gains, errors, dt = self._gains, self._errors, self._dt
        p = len(self.s)
        lambda_0 = diagonal("lambda_0", gains.lambda_0, p)
        lambda_1 = diagonal("lambda_1", gains.lambda_1, p)
        lambda_2 = diagonal("lambda_2", gains.lambda_2, p)
        g, residual, b, n = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
        k, gram = np.zeros(1), np.zeros((p, p))
        return [
            call(
                sliding_variable,
                *(errors.J, errors.J_dot_z, errors.e, errors.e_dot, errors.p_ddot, self.v_ref),
                *(lambda_0 ** (9 / 7), lambda_2, lambda_2 * lambda_1 ** (3 / 5)),
                *(self._integral_g, g, self.s),
            ),
            call(
                gain_k,
                *(g, errors.p_dddot, self.v_ref, q, q_rest, z),
                *(float(gains.c), self._a, float(gains.c_0)),
                *(float(gains.w_1), float(gains.w_2), float(gains.w_3k), float(gains.w_4k)),
                *(residual, k),
            ),
            call(end_without_control, self.s, residual, dt, b),
            call(transpose_gram, errors.J, k, dt, gram),
            *unit_vector_steps(
                self._discretization, self._boundary_layer, self.s, b, np.eye(p), gram, n
            ),
            call(transpose_rate, errors.J, k, n, self.v_ref_dot),
            call(integrate, g, dt, self._integral_g),
        ]

    def advance_steps(self) -> list[Call]:
        """v_ref and its integral at the tick's end; v_ref' is constant, so this is exact."""
        return [call(advance, self.v_ref_dot, self._dt, self.v_ref, self.integral_v_ref)]


@kernel
def sliding_variable(
    J: Matrix,
    J_dot_z: Vector,
    e: Vector,
    e_dot: Vector,
    p_ddot: Vector,
    v_ref: Vector,
    lambda_0_power: Vector,
    lambda_2: Vector,
    lambda_21: Vector,
    integral_g: Vector,
    g: Vector,
    s: Vector,
) -> None:
    """s of (31) and the integrand g in it; lambda_0_power is lambda_0^(9/7), lambda_21 is
    lambda_2 lambda_1^(3/5)."""
    for i in range(s.shape[0]):
        # e'' of (26) once differentiated, along the reference: J v_ref + J' z - p_d''
        e_ddot = dot(J[i], v_ref) + J_dot_z[i] - p_ddot[i]
        g[i] = lambda_2[i] * signed_power(e_ddot, 3 / 5) + lambda_21[i] * signed_power(
            signed_power(e_dot[i], 9 / 7) + lambda_0_power[i] * e[i], 1 / 3
        )
        s[i] = e_ddot + integral_g[i]


@kernel
def gain_k(
    g: Vector,
    p_dddot: Vector,
    v_ref: Vector,
    q: Vector,
    q_rest: Vector,
    z: Vector,
    c: float,
    a: float,
    c_0: float,
    w_1: float,
    w_2: float,
    w_3k: float,
    w_4k: float,
    residual: Vector,
    k: Vector,
) -> None:
    """k = c/a (W + c_0) of (34), with W under it in the parentheses of (21); residual = g - p_d'''."""
    deviation = 0.0
    for i in range(q.shape[0]):
        deviation += (q[i] - q_rest[i]) ** 2
    deviation = math.sqrt(deviation)
    for i in range(g.shape[0]):
        residual[i] = g[i] - p_dddot[i]
    size_z = norm(z)
    W = norm(residual) + (w_1 + w_2 * deviation) * (w_3k * norm(v_ref) * size_z + w_4k * size_z**3)
    k[0] = c / a * (W + c_0)


@kernel
def advance(v_ref_dot: Vector, dt: float, v_ref: Vector, integral_v_ref: Vector) -> None:
    """v_ref and its integral a tick later."""
    for i in range(v_ref.shape[0]):
        integral_v_ref[i] += dt * v_ref[i] + 0.5 * dt**2 * v_ref_dot[i]
        v_ref[i] += dt * v_ref_dot[i]
