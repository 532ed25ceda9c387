"""Disturbance torques on the motors' axes; D = -B d in (17)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.simulation.pieces import PACKAGE, Each, Piece, Setting, Types

Torque = Callable[[float], Array]
"""Disturbance torque on the motors' axes at time t (N m, N), shape (nz,)."""

disturbances = Types("disturbance type", PACKAGE, "mobman.disturbances")
"""Types of disturbances; each starts as a :data:`Torque`."""

_TONES = 64


class Amplitude(Piece):
    """Strength of a torque: exactly one of the two, a number for all motors or one for each."""

    torque: Each | None = None
    """N m, N."""
    acceleration: Each | None = None
    """rad/s^2, m/s^2: the torque is what gives each motor's axis this acceleration at rest, so that
    a scenario means the same to a light wrist and to a heavy base."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.torque is None) == (self.acceleration is None):
            raise ValueError("give either 'torque' or 'acceleration'")
        return self

    def torques(self, inertia: Array) -> Array:
        """The amplitude on every motor's axis (N m, N), shape (nz,).

        Args:
            inertia: Effective inertia at each motor (kg m^2, kg), shape (nz,).

        Raises:
            SpecError: If a list has not one entry for each motor.
        """
        value = self.acceleration if self.torque is None else self.torque
        if isinstance(value, list) and len(value) != len(inertia):
            raise SpecError(
                f"the amplitude has {len(value)} entries; the robot has {len(inertia)} "
                "motors: give one number, or one for each"
            )
        scale = inertia if self.torque is None else np.ones_like(inertia)
        return np.asarray(value, dtype=float) * scale


class Constant(Amplitude):
    """The amplitude on every motor's axis, from the start on."""

    def start(self, setting: Setting) -> Torque:
        """See :class:`Piece`."""
        torque = self.torques(setting.inertia)
        return lambda t: torque


class Growing(Amplitude):
    """Amplitude times (t / ``time``)^``power`` on every motor's axis, its sign at random.

    The bounds of D and D' in (18) may depend on time and need be finite at each time only: this is a
    D that no constant bounds.
    """

    time: float = Field(gt=0)
    """Time at which the amplitude is reached (s)."""
    power: float = Field(1.0, ge=1)
    """At least 1, since D' has to be bounded at the start too."""

    def start(self, setting: Setting) -> Torque:
        """See :class:`Piece`."""
        amplitude = self.torques(setting.inertia)
        torque = amplitude * setting.random.choice([-1.0, 1.0], len(amplitude))
        # NumPy's power is infinite where Python's is an error
        return lambda t: torque * np.float64(t / self.time) ** self.power


class BandNoise(Amplitude):
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

    def start(self, setting: Setting) -> Torque:
        """See :class:`Piece`."""
        random, (low, high) = setting.random, self.band
        tone = self.torques(setting.inertia) * math.sqrt(2.0 / _TONES)
        where = np.arange(_TONES) + random.uniform(0.0, 1.0, (len(tone), _TONES))
        rate = 2.0 * math.pi * (low + (high - low) / _TONES * where)
        phase = random.uniform(0.0, 2.0 * math.pi, (len(tone), _TONES))
        return lambda t: np.asarray(tone * np.sin(rate * t + phase).sum(axis=1))


class Sinusoid(Amplitude):
    """Amplitude times sin(2 pi ``frequency`` t + phase) on every motor's axis, phases at random."""

    frequency: float = Field(gt=0)
    """Hz."""

    def start(self, setting: Setting) -> Torque:
        """See :class:`Piece`."""
        torque = self.torques(setting.inertia)
        phase = setting.random.uniform(0.0, 2.0 * math.pi, len(torque))
        rate = 2.0 * math.pi * self.frequency
        return lambda t: np.asarray(torque * np.sin(rate * t + phase))


class RandomSteps(Amplitude):
    """Levels at random between minus and plus the amplitude, a new one on every motor's axis at each
    ``interval``; 0 before the first."""

    interval: float = Field(ge=1e-3)
    """s."""

    def start(self, setting: Setting) -> Torque:
        """See :class:`Piece`."""
        torque, random = self.torques(setting.inertia), setting.random
        levels = [np.zeros(len(torque))]

        def at(t: float) -> Array:
            index = int(t / self.interval + 1e-9)
            while len(levels) <= index:  # drawn in order, so the sequence depends on the seed alone
                levels.append(torque * random.uniform(-1.0, 1.0, len(torque)))
            return levels[index]

        return at


disturbances.register("constant", Constant)
disturbances.register("growing", Growing)
disturbances.register("noise", BandNoise)
disturbances.register("sinusoid", Sinusoid)
disturbances.register("steps", RandomSteps)
