"""Measurements with noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import field_validator

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.pieces import Each, Piece, entries
from mobman.simulation.sensors.sensor import Sensor, of_coordinates, sensors


class Noise(Piece):
    """White Gaussian noise, new at every tick; each field is a standard deviation."""

    position: Each = 0.0
    """Of the joints and wheels (rad, m): a number for all, or a list for all of q in its order."""
    pose: Each = 0.0
    """Of the platform's pose (m, m, rad), where ``position`` is no list."""
    velocity: Each = 0.0
    """Of z."""
    acceleration: Each = 0.0
    """Of z', beside what the noise of z does to a z' that is computed from it."""

    @field_validator("*")
    @classmethod
    def _deviation(cls, value: Any) -> Any:
        if np.min(value) < 0.0:
            raise ValueError("a standard deviation must not be negative")
        return value

    def start(
        self, robot: MobileManipulator, dt: float, random: np.random.Generator
    ) -> Sensor | None:
        """See :class:`Sensors`."""
        names = robot.velocity_names
        deviations = (
            of_coordinates(robot, self.position, self.pose, "position"),
            entries(self.velocity, names, "velocity", "velocities"),
            entries(self.acceleration, names, "acceleration", "velocities"),
        )
        return _Noise(deviations, random) if any(some.any() for some in deviations) else None


class _Noise(Sensor):
    def __init__(self, deviations: tuple[Array, Array, Array], random: np.random.Generator) -> None:
        # a stream for each, so that noise of one does not depend on whether another has any
        self._q, self._z, self._z_dot = (
            _White(deviation, own)
            for deviation, own in zip(deviations, random.spawn(3), strict=True)
        )

    def state(self, q: Array, z: Array) -> None:
        self._q.add_to(q)
        self._z.add_to(z)

    def acceleration(self, z_dot: Array) -> None:
        self._z_dot.add_to(z_dot)


class _White:
    def __init__(self, deviation: Array, random: np.random.Generator) -> None:
        self._deviation, self._random = deviation, random
        self._active = bool(deviation.any())

    def add_to(self, values: Array) -> None:
        if self._active:
            values += self._deviation * self._random.standard_normal(len(values))


sensors.register("noise", Noise)
