"""Measurements by encoders."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import field_validator

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.pieces import Each, Piece
from mobman.simulation.sensors.sensor import Sensor, of_coordinates, pose_index, sensors


class Quantisation(Piece):
    """q is rounded to the nearest multiple of a resolution; z may be what its differences tell."""

    resolution: Each
    """Of the joints and wheels (rad, m): a number for all, or a list for all of q in its order."""
    pose: Each = 0.0
    """Of the platform's pose (m, m, rad), where ``resolution`` is no list; 0: not rounded."""
    velocity: Literal["measured", "difference"] = "measured"
    """Whether z is measured by itself, or is (q_k - q_(k-1))/dt of the rounded q, as z."""

    @field_validator("resolution", "pose")
    @classmethod
    def _resolution(cls, value: Any) -> Any:
        if np.min(value) < 0.0:
            raise ValueError("a resolution must not be negative")
        return value

    def start(
        self, robot: MobileManipulator, dt: float, random: np.random.Generator
    ) -> Sensor | None:
        """See :class:`Sensors`."""
        resolution = of_coordinates(robot, self.resolution, self.pose, "resolution")
        difference = self.velocity == "difference"
        if not resolution.any() and not difference:
            return None
        return _Encoders(robot, resolution, dt if difference else None)


class _Encoders(Sensor):
    def __init__(self, robot: MobileManipulator, resolution: Array, dt: float | None) -> None:
        self._rounded = np.flatnonzero(resolution)
        self._resolution = resolution[self._rounded]
        self._robot, self._dt = robot, dt
        self._last: Array | None = None
        own = np.setdiff1d(np.arange(robot.nq), pose_index(robot))
        # the wheels tell how the platform moves, if they are coordinates at all
        tells = np.linalg.matrix_rank(robot.velocity_map(robot.q_rest)[own]) == robot.nz
        self._telling = own if tells else np.arange(robot.nq)

    def state(self, q: Array, z: Array) -> None:
        q[self._rounded] = self._resolution * np.round(q[self._rounded] / self._resolution)
        if self._dt is None:
            return
        rows = self._telling
        if self._last is None:
            z[:] = 0.0  # runs start at rest
        else:
            c = self._robot.velocity_map(q)[rows]
            z[:] = np.linalg.lstsq(c, (q - self._last)[rows] / self._dt, rcond=None)[0]
        self._last = q.copy()


sensors.register("quantisation", Quantisation)
