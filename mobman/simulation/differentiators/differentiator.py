"""What a way to know z' is, and the registry of kinds."""

from __future__ import annotations

from typing import Protocol

from mobman.arrays import Array
from mobman.registry import Registry


class Estimate(Protocol):
    """A way to know z', at work."""

    def __call__(self, z: Array, true: Array) -> Array:
        """z' at a tick, shape (nz,), a new array; called once at every tick.

        Args:
            z: Measured reduced velocity, shape (nz,).
            true: The true z' under the torque held until now, shape (nz,).
        """
        ...


class Differentiator(Protocol):
    """A kind of it, with its parameters."""

    def start(self, names: list[str], dt: float) -> Estimate:
        """For one run.

        Args:
            names: Of the components of z.
            dt: Sampling period (s).

        Raises:
            SpecError: If it does not fit the robot.
        """
        ...


differentiators: Registry[type[Differentiator]] = Registry(
    "way to know z'", "mobman.simulation.differentiators.kinds"
)
"""The ways to know z'; each module registers its own."""
