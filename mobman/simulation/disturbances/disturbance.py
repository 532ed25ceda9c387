"""What a disturbance torque is, and the registry of kinds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.registry import Registry

Torque = Callable[[float], Array]
"""Disturbance torque on the motors' axes at time t (N m, N), shape (nz,)."""


class Disturbance(Protocol):
    """A kind of disturbance with its parameters."""

    def start(self, nz: int, random: np.random.Generator) -> Torque:
        """The disturbance of one run; all its randomness comes from ``random``.

        Args:
            nz: Number of motors.
            random: Generator of this disturbance alone.
        """
        ...


disturbances: Registry[type[Disturbance]] = Registry(
    "disturbance type", "mobman.simulation.disturbances.kinds"
)


def per_motor(value: float | list[float], nz: int) -> Array:
    """An amplitude as a vector: one number for all motors, or one for each.

    Raises:
        SpecError: If a list has another length.
    """
    if isinstance(value, list) and len(value) != nz:
        raise SpecError(
            f"a disturbance's 'torque' has {len(value)} entries; the robot has {nz} motors: give one "
            "number, or one for each"
        )
    return np.broadcast_to(np.asarray(value, dtype=float), (nz,)).copy()
