"""A disturbance torque that jumps."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Amplitude, Torque, disturbances


class Steps(Amplitude):
    """Levels at random between minus and plus the amplitude, a new one on every motor's axis at each
    ``interval``; 0 before the first."""

    interval: float = Field(ge=1e-3)
    """s."""

    def start(self, inertia: Array, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = self.torques(inertia)
        levels = [np.zeros(len(inertia))]

        def at(t: float) -> Array:
            index = int(t / self.interval + 1e-9)
            while len(levels) <= index:  # drawn in order, so the sequence depends on the seed alone
                levels.append(torque * random.uniform(-1.0, 1.0, len(inertia)))
            return levels[index]

        return at


disturbances.register("steps", Steps)
