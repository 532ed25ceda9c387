"""A base whose turning motor has no lever at one heading: B(q) is singular there, for condition (67)."""

import numpy as np

from mobman.arrays import Array


class Crank:
    """A unicycle, turned by a crank whose lever is the sine of the heading beyond ``dead`` (rad).

    Without ``dead`` the lever is 1 at every heading.
    """

    coordinates = ("base_x", "base_y", "base_theta")
    velocity_names = ("v", "omega")
    root_offset = (0.0, 0.0, 0.05)

    def __init__(self, dead: float | None = None) -> None:
        self.dead = dead

    def constraint_matrix(self, x: Array) -> Array:
        return np.array([[np.sin(x[2]), -np.cos(x[2]), 0.0]])

    def velocity_map(self, x: Array) -> Array:
        return np.array([[np.cos(x[2]), 0.0], [np.sin(x[2]), 0.0], [0.0, 1.0]])

    def actuation(self, x: Array) -> Array:
        lever = 1.0 if self.dead is None else np.sin(x[2] - self.dead)
        return np.array([[np.cos(x[2]), 0.0], [np.sin(x[2]), 0.0], [0.0, lever]])
