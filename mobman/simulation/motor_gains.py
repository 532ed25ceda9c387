"""Motors that give more or less than the command says: B of (17) scaled by motor."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field, field_validator

from mobman.arrays import Array
from mobman.simulation.actuation import Stage, actuations
from mobman.simulation.pieces import Each, Piece, Setting, entries


class MotorGains(Piece):
    """Each motor's torque over the commanded one, fixed or at random."""

    factor: Each = 1.0
    """A number for all motors or one for each."""
    spread: float = Field(0.0, ge=0, lt=1)
    """The factor times a number from [1 - spread, 1 + spread], for each motor its own."""

    @field_validator("factor")
    @classmethod
    def _positive(cls, value: Any) -> Any:
        if np.min(value) <= 0.0:
            raise ValueError("must be above 0")
        return value

    def start(self, setting: Setting) -> Stage | None:
        """See :class:`Piece`."""
        names = list(setting.robot.velocity_names)
        draws = setting.random.uniform(-1.0, 1.0, len(names))
        factor = entries(self.factor, names, "factor", "motors") * (1.0 + self.spread * draws)
        return _Scaled(factor) if np.any(factor != 1.0) else None


class _Scaled(Stage):
    def __init__(self, factor: Array) -> None:
        self._factor = factor

    def apply(self, torque: Array) -> Array:
        return self._factor * torque


actuations.register("gain", MotorGains)
