"""From the commanded torque to the one that acts, through all pieces of the actuation."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from mobman.arrays import Array
from mobman.simulation.actuation.actuation import Stage

_ROUNDING = 1e-6  # ticks: a delay as near to a whole number of them is that number


class ActuationChain:
    """The pieces in their order, and their delays.

    What a piece makes of the torques of the ticks does not depend on when they arrive, so all delays
    together may come last.

    Args:
        stages: In the order of the signal.
        dt: Sampling period (s).
        nz: Number of motors.

    Attributes:
        split: How far into each tick a new torque arrives, as a fraction of the tick; 0 where the
            delay is a whole number of ticks.
        early: The torque that acts from the tick on, shape (nz,).
        late: That from ``split`` on, shape (nz,).
        limited: Whether a limit changed the torque that is commanded at this tick.
    """

    def __init__(self, stages: list[Stage], dt: float, nz: int) -> None:
        self._stages = stages
        ticks = math.fsum(stage.delay for stage in stages) / dt
        whole = math.floor(ticks + _ROUNDING)
        fraction = ticks - whole
        self.split = fraction if fraction > _ROUNDING else 0.0
        self._whole = whole
        self._under_way: deque[Array] = deque()
        self.early, self.late = np.zeros(nz), np.zeros(nz)
        self.limited = False

    def take(self, torque: Array) -> None:
        """Command a torque, shape (nz,), at the next tick."""
        self.limited = False
        for stage in self._stages:
            torque = stage.apply(torque)
            self.limited |= stage.limited
        self._under_way.append(torque.copy())
        self.early = self.late
        if len(self._under_way) > self._whole:
            self.late = self._under_way.popleft()
        if not self.split:
            self.early = self.late

    def mean(self) -> Array:
        """The mean over the tick of the torque that acts, shape (nz,)."""
        if not self.split:
            return self.late
        return self.split * self.early + (1.0 - self.split) * self.late
