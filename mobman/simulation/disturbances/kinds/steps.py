"""A disturbance torque that jumps."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Torque, disturbances, per_motor
from mobman.toml_model import Strict


class Steps(Strict):
    """Levels at random in [-``torque``, ``torque``], a new one on every motor's axis at each
    ``interval``; 0 before the first."""

    torque: float | list[float]
    """Largest level (N m, N)."""
    interval: float = Field(gt=0)
    """s."""

    def start(self, nz: int, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = per_motor(self.torque, nz)
        levels = [np.zeros(nz)]

        def at(t: float) -> Array:
            index = int(t / self.interval + 1e-9)
            while len(levels) <= index:  # drawn in order, so the sequence depends on the seed alone
                levels.append(torque * random.uniform(-1.0, 1.0, nz))
            return levels[index]

        return at


disturbances.register("steps", Steps)
