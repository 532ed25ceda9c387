"""Friction in proportion to the rate."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import call
from mobman.simulation.friction.friction import Level, Resistance, frictions


class Viscous(Level):
    """The amplitude is that at 1 rad/s (1 m/s)."""

    def start(
        self, inertia: Array, random: np.random.Generator, rate: Array, torque: Array
    ) -> Resistance:
        """See :class:`Friction`."""
        coefficient = self.torques(inertia)
        return Resistance(call(_resist, coefficient, rate, torque), coefficient)


@kernel
def _resist(coefficient: Vector, rate: Vector, torque: Vector) -> None:
    for i in range(rate.shape[0]):
        torque[i] -= coefficient[i] * rate[i]


frictions.register("viscous", Viscous)
