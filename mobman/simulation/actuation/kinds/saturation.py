"""Motors that give no more than so much torque."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.simulation.actuation.actuation import Motors, Stage, TorqueLevel, actuations


class Saturation(TorqueLevel):
    """Each motor's torque stays between minus and plus its level."""

    def start(self, motors: Motors, dt: float, random: np.random.Generator) -> Stage | None:
        """See :class:`Actuation`."""
        level = self.level(motors)
        return _Clip(level) if np.isfinite(level).any() else None


class _Clip(Stage):
    def __init__(self, level: Array) -> None:
        self._level = level

    def apply(self, torque: Array) -> Array:
        clipped: Array = np.clip(torque, -self._level, self._level)
        self.limited = bool((clipped != torque).any())
        return clipped


actuations.register("saturation", Saturation)
