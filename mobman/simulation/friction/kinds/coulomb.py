"""Dry friction."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import call
from mobman.simulation.friction.friction import Level, Resistance, frictions


class Coulomb(Level):
    """The amplitude against the motion, as amplitude x tanh(rate / ``velocity``).

    The sign function has no solution that an integrator could follow through 0; this has, and an axis
    under less than the amplitude creeps where a real one would stick.
    """

    velocity: float = Field(0.05, gt=0)
    """Rate at which 76 % of the amplitude is reached (rad/s, m/s)."""

    def start(
        self, inertia: Array, random: np.random.Generator, rate: Array, torque: Array
    ) -> Resistance:
        """See :class:`Friction`."""
        level = self.torques(inertia)
        step = call(_resist, level, self.velocity, rate, torque)
        return Resistance(step, level / self.velocity)


@kernel
def _resist(level: Vector, velocity: float, rate: Vector, torque: Vector) -> None:
    for i in range(rate.shape[0]):
        torque[i] -= level[i] * math.tanh(rate[i] / velocity)


frictions.register("coulomb", Coulomb)
