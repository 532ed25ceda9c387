"""What a disturbance torque is, and the registry of kinds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

import numpy as np
from pydantic import model_validator

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.registry import Registry
from mobman.simulation.pieces import Each, Piece

Torque = Callable[[float], Array]
"""Disturbance torque on the motors' axes at time t (N m, N), shape (nz,)."""


class Disturbance(Protocol):
    """A kind of disturbance with its parameters."""

    def start(self, inertia: Array, random: np.random.Generator) -> Torque:
        """The disturbance of one run; all its randomness comes from ``random``.

        Args:
            inertia: What each motor's axis feels at rest (kg m^2, kg), shape (nz,).
            random: Generator of this disturbance alone.
        """
        ...


class Amplitude(Piece):
    """How strong a torque is: exactly one of the two, a number for all motors or one for each."""

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


disturbances: Registry[type[Disturbance]] = Registry(
    "disturbance type", "mobman.simulation.disturbances.kinds"
)
