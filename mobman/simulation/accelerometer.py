"""How z' is measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mobman.arrays import Array
from mobman.simulation.differentiators.differentiator import Estimate, differentiators
from mobman.simulation.pieces import Source


class AccelerationSource(Source):
    """A way to know z', with its parameters."""

    group, what, kinds = "acceleration", "acceleration", differentiators


class Accelerometer:
    """z' as a scenario lets the controller know it.

    Args:
        source: The way to know it; one without parameters by its name alone.
        dt: Sampling period (s).
        names: Of the components of z; needed for parameters that are lists.

    Raises:
        UnknownNameError: If there is no such way.
        SpecError: If a parameter is wrong.
    """

    def __init__(
        self, source: str | AccelerationSource, dt: float, names: Sequence[str] = ()
    ) -> None:
        if isinstance(source, str):
            source = AccelerationSource(type=source)
        piece: Any = source.resolved()
        self._estimate: Estimate = piece.start(list(names), dt)

    def measure(self, z: Array, true: Array) -> Array:
        """z' at a tick, shape (nz,); to be called once at every tick.

        Args:
            z: Measured reduced velocity, shape (nz,).
            true: The true z', shape (nz,).
        """
        return self._estimate(z, true)
