"""Friction on the motors' axes: torques that depend on the axes' rates."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from pydantic import Field, field_validator

from mobman.arrays import Array, Vector
from mobman.compiled import bind, kernel
from mobman.simulation.disturbances import Amplitude
from mobman.simulation.pieces import PACKAGE, Setting, Types


class Resistance(NamedTuple):
    """Friction of one run."""

    entry: Callable[[Array, Array], Callable[[], None]]
    """Gives a function that subtracts the friction from the torques, both read in place: the axes'
    rates B^T z (rad/s, m/s), and torques on the axes (N m, N), shapes (nz,)."""
    slope: Array
    """The largest derivative of each axis' friction by its rate (N m s, N s/m), shape (nz,)."""


frictions = Types("friction type", PACKAGE, "mobman.friction")
"""Types of friction; each starts as a :class:`Resistance`."""


class FrictionLevel(Amplitude):
    """Strength of a friction: an amplitude that is not negative."""

    @field_validator("torque", "acceleration")
    @classmethod
    def _brakes(cls, value: float | list[float] | None) -> float | list[float] | None:
        if value is not None and np.min(value) < 0.0:
            raise ValueError("must not be negative: friction brakes")
        return value


class Coulomb(FrictionLevel):
    """The amplitude against the motion, as amplitude x tanh(rate / ``velocity``).

    The sign function has no solution that an integrator could follow through 0; this has, and an axis
    under less than the amplitude creeps where a real one would stick.
    """

    velocity: float = Field(0.05, gt=0)
    """Rate at which 76 % of the amplitude is reached (rad/s, m/s)."""

    def start(self, setting: Setting) -> Resistance:
        """See :class:`Piece`."""
        level, velocity = self.torques(setting.inertia), self.velocity
        return Resistance(
            lambda rate, torque: bind(_coulomb, level, velocity, rate, torque), level / velocity
        )


class Viscous(FrictionLevel):
    """The amplitude is that at 1 rad/s (1 m/s)."""

    def start(self, setting: Setting) -> Resistance:
        """See :class:`Piece`."""
        coefficient = self.torques(setting.inertia)
        return Resistance(
            lambda rate, torque: bind(_viscous, coefficient, rate, torque), coefficient
        )


@kernel
def _coulomb(level: Vector, velocity: float, rate: Vector, torque: Vector) -> None:
    for i in range(rate.shape[0]):
        torque[i] -= level[i] * math.tanh(rate[i] / velocity)


@kernel
def _viscous(coefficient: Vector, rate: Vector, torque: Vector) -> None:
    for i in range(rate.shape[0]):
        torque[i] -= coefficient[i] * rate[i]


frictions.register("coulomb", Coulomb)
frictions.register("viscous", Viscous)
