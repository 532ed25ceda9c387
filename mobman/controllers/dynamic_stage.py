"""The dynamic stage: torque rates that make z' follow v_ref, (45)-(56) and (65)-(66)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from mobman.arrays import Array, Matrix, Vector
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
from mobman.controllers.unit_vector import (
    Discretization,
    end_without_control,
    integrate,
    signed_power,
    transpose_gram,
    transpose_rate,
    unit_vector_steps,
)
from mobman.kernels import lu
from mobman.kernels.dense import norm
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call

NO_INVERSE = 4
"""Status: B has no inverse."""

_solve = lu.solve


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
        discretization: See :func:`unit_vector_steps`.
        boundary_layer: Width, 0 for none.
        metric_scale: Factor of the nominal inertia in the implicit form's metric.

    Attributes:
        S: (51), shape (nz,).
        v: The torque, shape (nz,); it is v' integrated over the ticks.
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
        self._gains, self._bound, self._dt = gains, float(bound), float(dt)
        self._inverse = inverse
        self._discretization, self._boundary_layer = discretization, boundary_layer
        self._metric_scale = float(metric_scale)
        self._integral_g = np.zeros(nz)
        self.S = np.zeros(nz)
        self.v = np.zeros(nz)

    def steps(
        self,
        z: Array,
        z_dot: Array,
        integral_v_ref: Array,
        v_ref: Array,
        v_ref_dot: Array,
        M: Array,
        B: Array,
    ) -> list[Call]:
        """The torque v for a tick.

        Args:
            z: Reduced velocity, shape (nz,).
            z_dot: Reduced acceleration under the torque held until now, shape (nz,).
            integral_v_ref: Integral of the reference acceleration, shape (nz,).
            v_ref: Reference acceleration, shape (nz,).
            v_ref_dot: Its rate, J^T u_ref, shape (nz,).
            M: The nominal inertia, shape (nz, nz).
            B: The actuation, shape (nz, nz).
        """
        gains, dt, nz = self._gains, self._dt, len(self.v)
        alpha_1 = float(Fraction(gains.alpha_1))
        w_7, w_8 = (1.0, 0.0) if self._inverse else (float(gains.w_7), float(gains.w_8))
        g, residual, b, n = np.zeros(nz), np.zeros(nz), np.zeros(nz), np.zeros(nz)
        k, gram, metric, v_dot = np.zeros(1), np.zeros((nz, nz)), np.zeros((nz, nz)), np.zeros(nz)
        return [
            call(
                sliding_variable,
                *(z, z_dot, integral_v_ref, v_ref),
                diagonal("Lambda_0", gains.Lambda_0, nz),
                diagonal("Lambda_1", gains.Lambda_1, nz),
                *(alpha_1, 2.0 * alpha_1 / (1.0 + alpha_1)),
                *(self._integral_g, g, self.S),
            ),
            call(
                gain_k,
                *(g, v_ref_dot, self.v, z, z_dot, self.S),
                *(float(gains.C), self._bound, float(gains.C_0)),
                *(float(gains.w_3), float(gains.w_4), float(gains.w_5), float(gains.w_6)),
                *(w_7, w_8, float(gains.w_9), float(gains.beta_0), float(gains.beta_1)),
                *(residual, k),
            ),
            call(end_without_control, self.S, residual, dt, b),
            call(scaled, M, self._metric_scale, metric),
            call(identity_gram if self._inverse else transpose_gram, B, k, dt, gram),
            *unit_vector_steps(
                self._discretization, self._boundary_layer, self.S, b, metric, gram, n
            ),
            *self._rate_steps(B, k, n, v_dot),
            call(integrate, g, dt, self._integral_g),
            call(integrate, v_dot, dt, self.v),
        ]

    def _rate_steps(self, B: Array, k: Array, n: Array, v_dot: Array) -> list[Call]:
        if self._inverse:
            return [call(inverse_rate, B, k, n, v_dot, np.zeros_like(B))]
        return [call(transpose_rate, B, k, n, v_dot)]


@kernel
def sliding_variable(
    z: Vector,
    z_dot: Vector,
    integral_v_ref: Vector,
    v_ref: Vector,
    Lambda_0: Vector,
    Lambda_1: Vector,
    alpha_1: float,
    alpha_2: float,
    integral_g: Vector,
    g: Vector,
    S: Vector,
) -> None:
    """S of (51) and the integrand g in it, with E and E' of (45)."""
    for i in range(S.shape[0]):
        E = z[i] - integral_v_ref[i]
        E_dot = z_dot[i] - v_ref[i]
        g[i] = Lambda_0[i] * signed_power(E, alpha_1) + Lambda_1[i] * signed_power(E_dot, alpha_2)
        S[i] = E_dot + integral_g[i]


@kernel
def gain_k(
    g: Vector,
    v_ref_dot: Vector,
    v: Vector,
    z: Vector,
    z_dot: Vector,
    S: Vector,
    C: float,
    A: float,
    C_0: float,
    w_3: float,
    w_4: float,
    w_5: float,
    w_6: float,
    w_7: float,
    w_8: float,
    w_9: float,
    beta_0: float,
    beta_1: float,
    residual: Vector,
    k: Vector,
) -> None:
    """k = C/A (chi + C_0) of (55), with chi under (53); residual = g - v_ref'."""
    for i in range(g.shape[0]):
        residual[i] = g[i] - v_ref_dot[i]
    size_z = norm(z)
    chi = (
        w_3 * norm(v) * size_z
        + w_4 * size_z**3
        + w_5 * (size_z + size_z * beta_0)
        + w_6 * beta_1
        + w_7 * norm(residual)
        + w_8 * size_z * norm(S)
        + w_9 * size_z * norm(z_dot)
    )
    k[0] = C / A * (chi + C_0)


@kernel
def scaled(matrix: Matrix, factor: float, result: Matrix) -> None:
    """factor times a matrix."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            result[i, j] = factor * matrix[i, j]


@kernel
def identity_gram(B: Matrix, k: Vector, dt: float, matrix: Matrix) -> None:
    """dt k I: what n takes away from M S over the tick when v' = B^-1 u."""
    matrix[:, :] = 0.0
    for i in range(matrix.shape[0]):
        matrix[i, i] = dt * k[0]


@kernel
def inverse_rate(B: Matrix, k: Vector, n: Vector, v_dot: Vector, work: Matrix) -> int:
    """v' = B^-1 u (65) with u = -k n (66)."""
    if _solve(B, n, v_dot, work) != 0:
        return NO_INVERSE
    for i in range(v_dot.shape[0]):
        v_dot[i] *= -k[0]
    return 0
