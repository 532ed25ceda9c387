"""The kinematic stage: a reference acceleration on the Jacobian's transpose, (31)-(35)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
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
from mobman.controllers.sliding.discretization import Discretization, sampled_unit_vector
from mobman.controllers.sliding.signed_power import signed_power
from mobman.controllers.task_space import TaskErrors


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
        p: Number of task errors.
        nz: Length of z.
        dt: Sampling period (s).
        discretization: See :func:`sampled_unit_vector`.
        boundary_layer: Width (m/s^2), 0 for none.
    """

    def __init__(
        self,
        gains: KinematicGains,
        a: float,
        p: int,
        nz: int,
        dt: float,
        discretization: Discretization,
        boundary_layer: float,
    ) -> None:
        self._gains = gains
        self._a = a
        self._dt = dt
        self._discretization = discretization
        self._boundary_layer = boundary_layer
        lambda_0 = diagonal("lambda_0", gains.lambda_0, p)
        lambda_1 = diagonal("lambda_1", gains.lambda_1, p)
        self._lambda_0_power = lambda_0 ** (9 / 7)
        self._lambda_2 = diagonal("lambda_2", gains.lambda_2, p)
        self._lambda_21 = self._lambda_2 * lambda_1 ** (3 / 5)
        self._identity = np.eye(p)
        self._integral_g = np.zeros(p)
        self.s = np.zeros(p)
        self.v_ref = np.zeros(nz)
        self.integral_v_ref = np.zeros(nz)
        self._v_ref_dot = np.zeros(nz)

    def step(self, errors: TaskErrors, deviation: float, z: Array) -> Array:
        """v_ref' for this tick, shape (nz,).

        Args:
            errors: e, e', J, J' z and the desired derivatives now.
            deviation: \\|q - q_rest\\|.
            z: Reduced velocity, shape (nz,).
        """
        gains, dt = self._gains, self._dt
        # e'' of (26) once differentiated, along the reference: J v_ref + J' z - p_d''
        e_ddot = errors.J @ self.v_ref + errors.J_dot_z - errors.p_ddot
        # integrand of (31)
        g = self._lambda_2 * signed_power(e_ddot, 3 / 5) + self._lambda_21 * signed_power(
            signed_power(errors.e_dot, 9 / 7) + self._lambda_0_power * errors.e, 1 / 3
        )
        self.s = e_ddot + self._integral_g  # (31)
        # W under (34), with the parentheses of (21)
        size_z = math.sqrt(z @ z)
        size_v_ref = math.sqrt(self.v_ref @ self.v_ref)
        residual = g - errors.p_dddot
        w = math.sqrt(residual @ residual) + (gains.w_1 + gains.w_2 * deviation) * (
            gains.w_3k * size_v_ref * size_z + gains.w_4k * size_z**3
        )
        k = gains.c / self._a * (w + gains.c_0)
        n = sampled_unit_vector(
            self._discretization,
            self._boundary_layer,
            self.s,
            dt * residual,
            self._identity,
            dt * k * (errors.J @ errors.J.T),
        )
        u_ref = -k * n  # (34), (44)
        self._v_ref_dot = errors.J.T @ u_ref  # (35), (43)
        self._integral_g += dt * g
        return self._v_ref_dot

    def advance(self) -> None:
        """Integrate v_ref' over the tick; it is constant there, so this is exact."""
        dt = self._dt
        self.integral_v_ref += dt * self.v_ref + 0.5 * dt**2 * self._v_ref_dot
        self.v_ref += dt * self._v_ref_dot
