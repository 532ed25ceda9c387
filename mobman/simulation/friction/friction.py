"""What friction is, and the registry of kinds."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from pydantic import field_validator

from mobman.arrays import Array
from mobman.kernels.dense import apply_transpose
from mobman.kernels.program import Call, call
from mobman.registry import Registry
from mobman.simulation.disturbances.disturbance import Amplitude


class Resistance(NamedTuple):
    """Friction of one run."""

    step: Call
    """Subtracts the friction from the torques at the rates that it was made with."""
    slope: Array
    """The largest derivative of each axis' friction by its rate (N m s, N s/m), shape (nz,)."""


class Friction(Protocol):
    """A kind of friction with its parameters: a torque that depends on the axes' rates."""

    def start(
        self, inertia: Array, random: np.random.Generator, rate: Array, torque: Array
    ) -> Resistance:
        """The friction of one run.

        Args:
            inertia: What each motor's axis feels at rest (kg m^2, kg), shape (nz,).
            random: Generator of this piece alone.
            rate: The axes' rates B^T z (rad/s, m/s), shape (nz,), read in place by the step.
            torque: Torques on the axes (N m, N), shape (nz,), from which the step subtracts.
        """
        ...


class Level(Amplitude):
    """How strong friction is: an amplitude that is not negative."""

    @field_validator("torque", "acceleration")
    @classmethod
    def _brakes(cls, value: float | list[float] | None) -> float | list[float] | None:
        if value is not None and np.min(value) < 0.0:
            raise ValueError("must not be negative: friction brakes")
        return value


frictions: Registry[type[Friction]] = Registry("friction type", "mobman.simulation.friction.kinds")
"""The kinds of friction; each module registers its own."""


def rate_step(B: Array, z: Array, rate: Array) -> Call:
    """The axes' rates B^T z: by them the motors' torques v have the power z^T B v."""
    return call(apply_transpose, B, z, rate)
