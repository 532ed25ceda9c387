"""A sinusoidal disturbance torque."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Amplitude, Torque, disturbances


class Sinusoid(Amplitude):
    """Amplitude times sin(2 pi ``frequency`` t + phase) on every motor's axis, phases at random."""

    frequency: float = Field(gt=0)
    """Hz."""

    def start(self, inertia: Array, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = self.torques(inertia)
        phase = random.uniform(0.0, 2.0 * math.pi, len(inertia))
        rate = 2.0 * math.pi * self.frequency

        def at(t: float) -> Array:
            value: Array = torque * np.sin(rate * t + phase)
            return value

        return at


disturbances.register("sinusoid", Sinusoid)
