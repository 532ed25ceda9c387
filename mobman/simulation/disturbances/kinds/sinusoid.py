"""A sinusoidal disturbance torque."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Torque, disturbances, per_motor
from mobman.toml_model import Strict


class Sinusoid(Strict):
    """``torque`` sin(2 pi ``frequency`` t + phase) on every motor's axis, phases at random."""

    torque: float | list[float]
    """Amplitude (N m, N)."""
    frequency: float = Field(gt=0)
    """Hz."""

    def start(self, nz: int, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = per_motor(self.torque, nz)
        phase = random.uniform(0.0, 2.0 * math.pi, nz)
        rate = 2.0 * math.pi * self.frequency

        def at(t: float) -> Array:
            value: Array = torque * np.sin(rate * t + phase)
            return value

        return at


disturbances.register("sinusoid", Sinusoid)
