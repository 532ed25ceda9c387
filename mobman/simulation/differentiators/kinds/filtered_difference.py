"""z' as a difference behind a low pass."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.differentiators.differentiator import Estimate, differentiators
from mobman.simulation.differentiators.kinds.backward_difference import Difference
from mobman.simulation.pieces import Piece


class FilteredDifference(Piece):
    """The backward difference behind a first-order low pass, sampled with its step response exact."""

    cutoff: float = Field(gt=0)
    """Where its gain is 1/sqrt(2) (Hz)."""

    def start(self, names: list[str], dt: float) -> Estimate:
        """See :class:`Differentiator`."""
        return _Filtered(dt, -math.expm1(-2.0 * math.pi * self.cutoff * dt))


class _Filtered:
    def __init__(self, dt: float, gain: float) -> None:
        self._difference, self._gain = Difference(dt), gain
        self._value: Array | None = None

    def __call__(self, z: Array, true: Array) -> Array:
        difference = self._difference(z, true)
        value = np.zeros_like(z) if self._value is None else self._value
        self._value = value + self._gain * (difference - value)
        return self._value.copy()


differentiators.register("filtered-difference", FilteredDifference)
