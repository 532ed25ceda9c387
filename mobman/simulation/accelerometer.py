"""How z' is measured."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array


class Accelerometer:
    """z' as a scenario lets the controller know it.

    Args:
        mode: ``"exact"``, the true z' under the torque held until now, or
            ``"backward-difference"``, (z_k - z_(k-1))/dt, 0 at the first tick.
        dt: Sampling period (s).
    """

    def __init__(self, mode: str, dt: float) -> None:
        self._exact = mode == "exact"
        self._dt = dt
        self._last: Array | None = None

    def measure(self, z: Array, true: Array) -> Array:
        """z' at a tick, shape (nz,).

        Args:
            z: Measured reduced velocity, shape (nz,).
            true: The true z', shape (nz,).
        """
        if self._exact:
            return true.copy()
        last, self._last = self._last, z.copy()
        return np.zeros_like(z) if last is None else (z - last) / self._dt
