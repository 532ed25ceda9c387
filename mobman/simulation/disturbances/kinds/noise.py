"""A disturbance torque that is noise of a limited band."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Amplitude, Torque, disturbances

_TONES = 64


class Noise(Amplitude):
    """The sum of 64 sinusoids, one at random in each 64th of the ``band``, phases at random: the
    amplitude is its root mean square, on every motor's axis its own noise.

    By the central limit theorem nearly Gaussian; a function of time alone, so that the steps within an
    integration see one and the same noise.
    """

    band: Annotated[list[float], Field(min_length=2, max_length=2)]
    """Lowest and highest frequency (Hz)."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not 0.0 <= self.band[0] < self.band[1]:
            raise ValueError("'band' is the lowest and the highest frequency (Hz), 0 <= low < high")
        return self

    def start(self, inertia: Array, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        n, (low, high) = len(inertia), self.band
        tone = self.torques(inertia) * math.sqrt(2.0 / _TONES)
        where = np.arange(_TONES) + random.uniform(0.0, 1.0, (n, _TONES))
        rate = 2.0 * math.pi * (low + (high - low) / _TONES * where)
        phase = random.uniform(0.0, 2.0 * math.pi, (n, _TONES))

        def at(t: float) -> Array:
            value: Array = tone * np.sin(rate * t + phase).sum(axis=1)
            return value

        return at


disturbances.register("noise", Noise)
