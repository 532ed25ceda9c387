"""A disturbance torque that does not change."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Amplitude, Torque, disturbances


class Constant(Amplitude):
    """The amplitude on every motor's axis, from the start on."""

    def start(self, inertia: Array, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = self.torques(inertia)
        return lambda t: torque


disturbances.register("constant", Constant)
