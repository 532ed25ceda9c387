"""Motors whose torque takes time to change."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.simulation.actuation.actuation import Motors, Stage, TorqueLevel, actuations


class RateLimit(TorqueLevel):
    """Each motor's torque changes by at most dt / ``rise_time`` of its level from tick to tick."""

    rise_time: float = Field(gt=0)
    """From 0 to the level (s)."""

    def start(self, motors: Motors, dt: float, random: np.random.Generator) -> Stage | None:
        """See :class:`Actuation`."""
        level = self.level(motors)
        return _Follow(dt / self.rise_time * level) if np.isfinite(level).any() else None


class _Follow(Stage):
    def __init__(self, step: Array) -> None:
        self._step = step
        self._last = np.zeros_like(step)

    def apply(self, torque: Array) -> Array:
        # not the last plus a change: a torque within the limit comes through bit for bit
        self._last = np.clip(torque, self._last - self._step, self._last + self._step)
        self.limited = bool((self._last != torque).any())
        return self._last


actuations.register("rate-limit", RateLimit)
