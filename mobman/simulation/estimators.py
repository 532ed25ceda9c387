"""Estimators of the acceleration z'."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from pydantic import Field, field_validator

from mobman.arrays import Array
from mobman.simulation.pieces import PACKAGE, Each, Piece, Setting, Types, entries

Estimate = Callable[[Array, Array], Array]
"""z' at a tick, a new array, from the measured z and the true z' under the torque held until now, shapes
(nz,); called once at every tick."""

estimators = Types("acceleration estimator", PACKAGE, "mobman.acceleration")
"""Types of estimators; each starts as an :data:`Estimate`."""


class Exact(Piece):
    """The true z' under the torque held until now: what an ideal sensor shows."""

    def start(self, setting: Setting) -> Estimate:
        """See :class:`Piece`."""
        return lambda z, true: true.copy()


class BackwardDifference(Piece):
    """(z_k - z_(k-1))/dt, 0 at the first tick."""

    def start(self, setting: Setting) -> Estimate:
        """See :class:`Piece`."""
        dt = setting.dt
        last: Array | None = None

        def difference(z: Array, true: Array) -> Array:
            nonlocal last
            before, last = last, z.copy()
            return np.zeros_like(z) if before is None else (z - before) / dt

        return difference


class FilteredDifference(Piece):
    """The backward difference behind a first-order low pass, sampled with its step response exact."""

    cutoff: float = Field(gt=0)
    """Frequency at which its gain is 1/sqrt(2) (Hz)."""

    def start(self, setting: Setting) -> Estimate:
        """See :class:`Piece`."""
        difference = BackwardDifference().start(setting)
        gain = -math.expm1(-2.0 * math.pi * self.cutoff * setting.dt)
        value: Array | float = 0.0

        def filtered(z: Array, true: Array) -> Array:
            nonlocal value
            value = value + gain * (difference(z, true) - value)
            return value.copy()

        return filtered


class RobustDifferentiator(Piece):
    r"""The first-order robust exact differentiator of each component of z.

    A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34(3), 1998:
    with :math:`\sigma = \zeta_0 - z`,
    :math:`\dot\zeta_0 = \zeta_1 - 1.5 \sqrt L\,|\sigma|^{1/2} \mathrm{sign}\,\sigma`,
    :math:`\dot\zeta_1 = -1.1 L\,\mathrm{sign}\,\sigma`; exact after a finite time if
    :math:`|\ddot z| \le L`, with an error of the order of :math:`\sqrt{L\varepsilon}` under noise
    below :math:`\varepsilon`. The discrete one is its implicit Euler form, which does not chatter
    (B. Brogliato, A. Polyakov, D. Efimov, "The implicit discretization of the supertwisting
    sliding-mode control algorithm", IEEE Trans. Automatic Control 65(8), 2020): on the sliding surface
    it is the backward difference, and off it, its value changes by 1.1 L dt in a tick.
    """

    lipschitz: Each
    """L, a bound of |z''| (rad/s^3, m/s^3): a number for all, or one for each component of z."""

    @field_validator("lipschitz")
    @classmethod
    def _positive(cls, value: float | list[float]) -> float | list[float]:
        if np.min(value) <= 0.0:
            raise ValueError("a bound must be above 0")
        return value

    def start(self, setting: Setting) -> Estimate:
        """See :class:`Piece`; 0 at the first tick, where it begins at the measurement."""
        names = list(setting.robot.velocity_names)
        bound, dt = entries(self.lipschitz, names, "lipschitz", "velocities"), setting.dt
        root, step = 1.5 * dt * np.sqrt(bound), 1.1 * dt * bound
        value: Array | None = None
        rate = np.zeros_like(bound)

        def levant(z: Array, true: Array) -> Array:
            nonlocal value, rate
            if value is None:
                value = z.copy()
                return rate.copy()
            # sigma = b - root |sigma|^(1/2) n - dt step n with n in the sign of sigma, solved for
            # sigma and n
            b = value + dt * rate - z
            beyond = np.maximum(np.abs(b) - dt * step, 0.0)
            half = 0.5 * (np.sqrt(root**2 + 4.0 * beyond) - root)
            value = z + np.sign(b) * half**2
            rate = rate - step * np.clip(b / (dt * step), -1.0, 1.0)
            return rate.copy()

        return levant


estimators.register("exact", Exact)
estimators.register("backward-difference", BackwardDifference)
estimators.register("filtered-difference", FilteredDifference)
estimators.register("robust-differentiator", RobustDifferentiator)
