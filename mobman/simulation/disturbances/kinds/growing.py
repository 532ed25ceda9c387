"""A disturbance torque that grows without bound."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.disturbances.disturbance import Amplitude, Torque, disturbances


class Growing(Amplitude):
    """Amplitude times (t / ``time``)^``power`` on every motor's axis, its sign at random.

    The bounds of D and D' in (18) may depend on time and need be finite at each time only: this is a
    D that no constant bounds.
    """

    time: float = Field(gt=0)
    """When the amplitude is reached (s)."""
    power: float = Field(1.0, ge=1)
    """At least 1, since D' has to be bounded at the start too."""

    def start(self, inertia: Array, random: np.random.Generator) -> Torque:
        """See :class:`Disturbance`."""
        torque = self.torques(inertia) * random.choice([-1.0, 1.0], len(inertia))
        # NumPy's power is infinite where Python's is an error
        return lambda t: torque * np.float64(t / self.time) ** self.power


disturbances.register("growing", Growing)
