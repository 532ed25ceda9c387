"""z' from Levant's robust exact differentiator."""

from __future__ import annotations

import numpy as np
from pydantic import field_validator

from mobman.arrays import Array
from mobman.simulation.differentiators.differentiator import Estimate, differentiators
from mobman.simulation.pieces import Each, Piece, entries


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

    def start(self, names: list[str], dt: float) -> Estimate:
        """See :class:`Differentiator`."""
        return Levant(entries(self.lipschitz, names, "lipschitz", "velocities"), dt)


class Levant:
    """The differentiator at work.

    Args:
        bound: L, shape (nz,).
        dt: Sampling period (s).
    """

    def __init__(self, bound: Array, dt: float) -> None:
        self._dt = dt
        self._root = 1.5 * dt * np.sqrt(bound)
        self._step = 1.1 * dt * bound
        self._value: Array | None = None
        self._rate = np.zeros_like(bound)

    def __call__(self, z: Array, true: Array) -> Array:
        """See :class:`Estimate`; 0 at the first tick, where it begins at the measurement."""
        if self._value is None:
            self._value = z.copy()
            return self._rate.copy()
        dt, root, step = self._dt, self._root, self._step
        # sigma = b - root |sigma|^(1/2) n - dt step n with n in the sign of sigma, solved for sigma, n
        b = self._value + dt * self._rate - z
        beyond = np.maximum(np.abs(b) - dt * step, 0.0)
        half = 0.5 * (np.sqrt(root**2 + 4.0 * beyond) - root)
        n = np.clip(b / (dt * step), -1.0, 1.0)
        self._value = z + np.sign(b) * half**2
        self._rate = self._rate - step * n
        return self._rate.copy()


differentiators.register("robust-differentiator", RobustDifferentiator)
