"""A controller that keeps what it was told."""

from __future__ import annotations

import numpy as np


class Listener:
    """Its torque is a given function of time.

    Attributes:
        t, q, z, z_dot: What it was told, one row a tick.
    """

    def __init__(self, function):
        self.function = function

    def reset(self, robot, task, dt):
        self._heard = []

    def step(self, t, q, z, z_dot):
        self._heard.append((t, q, z, z_dot))
        return self.function(t)

    def __getattr__(self, name):
        if name not in ("t", "q", "z", "z_dot"):
            raise AttributeError(name)
        place = ("t", "q", "z", "z_dot").index(name)
        return np.array([heard[place] for heard in self._heard])
