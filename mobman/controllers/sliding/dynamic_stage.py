"""The dynamic stage: torque rates that make z' follow v_ref, (45)-(56) and (65)-(66)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from mobman.arrays import Array
from mobman.controllers.gains import (
    Auto,
    Diagonal,
    diagonal,
    gain,
    odd_ratio,
    require_at_least_one,
    require_bound,
    require_not_negative,
    require_positive,
    require_positive_diagonal,
)
from mobman.controllers.sliding.discretization import Discretization, sampled_unit_vector
from mobman.controllers.sliding.signed_power import signed_power
from mobman.model.mobile_manipulator import Dynamics


@dataclass(frozen=True, kw_only=True)
class DynamicGains:
    """Gains of (51)-(55); defaults are the paper's, section 4, but for ``A``."""

    Lambda_0: Diagonal = gain(11.0, "mixed, see docs/theory.md", "Lambda_0 of (51)")
    Lambda_1: Diagonal = gain(6.0, "mixed, see docs/theory.md", "Lambda_1 of (51)")
    alpha_1: Fraction | float | str = gain("3/5", "1", "n1/n2 of (51), both odd, n1 < n2 < 2 n1")
    C: float = gain(2.0, "1", "C of (55), at least 1")
    C_0: float = gain(1.0, "N m/s", "C_0 of (55)")
    A: float | Auto = gain("auto", "1", "lower bound of lambda_min(B B^T), (54), or A' of (64)")
    w_3: float = gain(3.0, "rad^-1", "factor of |v||z| in chi, (53)")
    w_4: float = gain(9.0, "kg m^2", "factor of |z|^3 in chi, (53)")
    w_5: float = gain(12.0, "N m/rad", "factor of |z| + |z| beta_0 in chi, (53)")
    w_6: float = gain(0.0, "1", "factor of beta_1 in chi, (53)")
    w_7: float = gain(
        6.0, "kg m^2", "factor of |Lambda_0 E^a1 + Lambda_1 E'^a2 - v_ref'| in chi, (53)"
    )
    w_8: float = gain(0.011, "kg m^2", "factor of |z||S| in chi, (53)")
    w_9: float = gain(6.0, "kg m^2", "factor of |z||z'| in chi, (53)")
    beta_0: float = gain(0.0, "N m", "bound of |D|, (18)")
    beta_1: float = gain(0.0, "N m/s", "bound of |D'|, (18)")

    def __post_init__(self) -> None:
        require_positive_diagonal(self, "Lambda_0", "Lambda_1")
        require_positive(self, "C_0")
        require_not_negative(self, "w_3", "w_4", "w_5", "w_6", "w_7", "w_8", "w_9")
        require_not_negative(self, "beta_0", "beta_1")
        require_at_least_one(self, "C", "Theorem 2")
        require_bound(self, "A", "0 < A <= lambda_min(B B^T) (54)")
        object.__setattr__(self, "alpha_1", odd_ratio("alpha_1", self.alpha_1))


class DynamicStage:
    r"""From :math:`v_{ref}` to :math:`\dot v`: on the actuation matrix's transpose,
    :math:`\dot v = B^T u` (55)-(56), or with its inverse, :math:`\dot v = B^{-1} u` (65)-(66).

    Args:
        gains: Gains.
        bound: A of (54), or A' of (64) for the inverse.
        nz: Length of z.
        dt: Sampling period (s).
        inverse: Whether to use (65)-(66), with chi' = chi at w7 = 1, w8 = 0.
        discretization: See :func:`sampled_unit_vector`.
        boundary_layer: Width, 0 for none.
        metric_scale: Factor of the nominal inertia in the implicit form's metric.
    """

    def __init__(
        self,
        gains: DynamicGains,
        bound: float,
        nz: int,
        dt: float,
        *,
        inverse: bool,
        discretization: Discretization,
        boundary_layer: float,
        metric_scale: float,
    ) -> None:
        self._gains = gains
        self._bound = bound
        self._dt = dt
        self._inverse = inverse
        self._discretization = discretization
        self._boundary_layer = boundary_layer
        self._metric_scale = metric_scale
        self._w_7, self._w_8 = (1.0, 0.0) if inverse else (gains.w_7, gains.w_8)
        self._lambda_0 = diagonal("Lambda_0", gains.Lambda_0, nz)
        self._lambda_1 = diagonal("Lambda_1", gains.Lambda_1, nz)
        self._alpha_1 = float(Fraction(gains.alpha_1))
        self._alpha_2 = 2.0 * self._alpha_1 / (1.0 + self._alpha_1)
        self._integral_g = np.zeros(nz)
        self.S = np.zeros(nz)
        self.v = np.zeros(nz)

    def step(
        self,
        z: Array,
        z_dot: Array,
        v_ref: Array,
        integral_v_ref: Array,
        v_ref_dot: Array,
        dynamics: Dynamics,
    ) -> Array:
        """The torque v for this tick, shape (nz,); it is v' integrated over the tick.

        Args:
            z: Reduced velocity, shape (nz,).
            z_dot: Reduced acceleration under the torque held until now, shape (nz,).
            v_ref: Reference acceleration now, shape (nz,).
            integral_v_ref: Its integral, shape (nz,).
            v_ref_dot: Its rate, J^T u_ref, shape (nz,).
            dynamics: The nominal M and B.
        """
        gains, dt = self._gains, self._dt
        e = z - integral_v_ref  # E of (45)
        e_dot = z_dot - v_ref  # E' of (45)
        # integrand of (51)
        g = self._lambda_0 * signed_power(e, self._alpha_1) + self._lambda_1 * signed_power(
            e_dot, self._alpha_2
        )
        self.S = e_dot + self._integral_g  # (51)
        residual = g - v_ref_dot
        size_z = math.sqrt(z @ z)
        # chi under (53)
        chi = (
            gains.w_3 * math.sqrt(self.v @ self.v) * size_z
            + gains.w_4 * size_z**3
            + gains.w_5 * (size_z + size_z * gains.beta_0)
            + gains.w_6 * gains.beta_1
            + self._w_7 * math.sqrt(residual @ residual)
            + self._w_8 * size_z * math.sqrt(self.S @ self.S)
            + gains.w_9 * size_z * math.sqrt(z_dot @ z_dot)
        )
        k = gains.C / self._bound * (chi + gains.C_0)
        b = dynamics.B
        n = sampled_unit_vector(
            self._discretization,
            self._boundary_layer,
            self.S,
            dt * residual,
            self._metric_scale * dynamics.M,
            dt * k * (np.eye(len(z)) if self._inverse else b @ b.T),
        )
        u = -k * n  # (55), (66)
        v_dot = np.linalg.solve(b, u) if self._inverse else b.T @ u  # (65), (56)
        self._integral_g += dt * g
        self.v = self.v + dt * v_dot
        return self.v
