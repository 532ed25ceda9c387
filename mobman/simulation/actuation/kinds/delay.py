"""Torques that act late."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.simulation.actuation.actuation import Motors, Stage, actuations
from mobman.simulation.pieces import Piece


class Delay(Piece):
    """What is commanded acts so much later, whether or not that is a whole number of ticks; v = 0
    until the first command has arrived."""

    delay: float = Field(ge=0)
    """s."""

    def start(self, motors: Motors, dt: float, random: np.random.Generator) -> Stage | None:
        """See :class:`Actuation`."""
        return _Late(self.delay) if self.delay > 0.0 else None


class _Late(Stage):
    def __init__(self, delay: float) -> None:
        self.delay = delay


actuations.register("delay", Delay)
