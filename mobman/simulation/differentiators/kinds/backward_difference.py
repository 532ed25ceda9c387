"""z' as the difference of two measurements."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.simulation.differentiators.differentiator import Estimate, differentiators
from mobman.simulation.pieces import Piece


class BackwardDifference(Piece):
    """(z_k - z_(k-1))/dt, 0 at the first tick."""

    def start(self, names: list[str], dt: float) -> Estimate:
        """See :class:`Differentiator`."""
        return Difference(dt)


class Difference:
    """The difference of two ticks over the time between them.

    Args:
        dt: Sampling period (s).
    """

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._last: Array | None = None

    def __call__(self, z: Array, true: Array) -> Array:
        """See :class:`Estimate`."""
        last, self._last = self._last, z.copy()
        return np.zeros_like(z) if last is None else (z - last) / self._dt


differentiators.register("backward-difference", BackwardDifference)
