"""A disturbance torque that does not change."""

from __future__ import annotations

import numpy as np

from mobman.simulation.disturbances.disturbance import Torque, disturbances, per_motor
from mobman.toml_model import Strict


class Constant(Strict):
    """``torque`` (N m, N) on every motor's axis, from the start on."""

    torque: float | list[float]

    def start(self, nz: int, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = per_motor(self.torque, nz)
        return lambda t: torque


disturbances.register("constant", Constant)
