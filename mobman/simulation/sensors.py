"""Sensors: errors of the measured state, and the measurement that the controller is given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import field_validator

from mobman.arrays import Array, Index
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.estimators import Estimate
from mobman.simulation.pieces import PACKAGE, Each, Piece, Setting, Types, entries


class Sensor:
    """A piece at work: from the true state to the measured one."""

    def state(self, q: Array, z: Array) -> None:
        """Change q and z, shapes (nq,) and (nz,), in place; called once at every tick."""

    def acceleration(self, z_dot: Array) -> None:
        """Change z', shape (nz,), in place; after :meth:`state`."""


sensors = Types("sensor type", PACKAGE, "mobman.sensors")
"""Types of errors; each starts as a :class:`Sensor`, or None."""


class Measurement:
    """(q, z, z') as the sensors show them.

    Args:
        estimate: The estimator of z'.
        sensors: Their errors, in the order in which they happen.
        encoders: What tells of z and z', from (q, z, z'); they themselves by default.
    """

    def __init__(
        self,
        estimate: Estimate,
        sensors: list[Sensor],
        encoders: Callable[[Array, Array, Array], tuple[Array, Array]] | None = None,
    ) -> None:
        self._estimate, self._sensors, self._encoders = estimate, sensors, encoders

    def take(self, q: Array, z: Array, z_dot: Array) -> tuple[Array, Array, Array]:
        """The measured ones, new arrays; to be called once at every tick.

        Args:
            q: The true configuration, shape (nq,).
            z: The true reduced velocity, shape (nz,).
            z_dot: The true z' under the torque held until now, shape (nz,).
        """
        if self._encoders is not None:
            z, z_dot = self._encoders(q, z, z_dot)
        q_now, z_now = q.copy(), z.copy()
        for sensor in self._sensors:
            sensor.state(q_now, z_now)
        acceleration = self._estimate(z_now, z_dot)
        for sensor in self._sensors:
            sensor.acceleration(acceleration)
        return q_now, z_now, acceleration


class WhiteNoise(Piece):
    """White Gaussian noise, new at every tick; each field is a standard deviation."""

    position: Each = 0.0
    """Deviation at the joints and wheels (rad, m): a number for all, or a list for all of q."""
    pose: Each = 0.0
    """Deviation of the platform's pose (m, m, rad), where ``position`` is no list."""
    velocity: Each = 0.0
    """Deviation of z."""
    acceleration: Each = 0.0
    """Deviation of z', in addition to what the noise of z does to a z' that is computed from it."""

    @field_validator("*")
    @classmethod
    def _deviation(cls, value: Any) -> Any:
        if np.min(value) < 0.0:
            raise ValueError("a standard deviation must not be negative")
        return value

    def start(self, setting: Setting) -> Sensor | None:
        """See :class:`Piece`."""
        names = list(setting.robot.velocity_names)
        deviations = (
            _of_coordinates(setting.robot, self.position, self.pose, "position"),
            entries(self.velocity, names, "velocity", "velocities"),
            entries(self.acceleration, names, "acceleration", "velocities"),
        )
        return _Noisy(deviations, setting.random) if np.concatenate(deviations).any() else None


class _Noisy(Sensor):
    def __init__(self, deviations: tuple[Array, ...], random: np.random.Generator) -> None:
        # a stream for each, so that noise of one does not depend on whether another has any
        streams = zip(deviations, random.spawn(3), strict=True)
        self._parts = [(some, own) if some.any() else None for some, own in streams]

    def state(self, q: Array, z: Array) -> None:
        self._add(0, q)
        self._add(1, z)

    def acceleration(self, z_dot: Array) -> None:
        self._add(2, z_dot)

    def _add(self, part: int, values: Array) -> None:
        if (noise := self._parts[part]) is not None:
            values += noise[0] * noise[1].standard_normal(len(values))


class Quantisation(Piece):
    """q is rounded to the nearest multiple of a resolution; z may be what its differences tell."""

    resolution: Each
    """Resolution of joints and wheels (rad, m): a number for all, or a list for all of q."""
    pose: Each = 0.0
    """Resolution of the platform's pose (m, m, rad), where ``resolution`` is no list; 0: not rounded."""
    velocity: Literal["measured", "difference"] = "measured"
    """z is measured by itself, or is (q_k - q_(k-1))/dt of the rounded q, as z."""

    @field_validator("resolution", "pose")
    @classmethod
    def _resolution(cls, value: Any) -> Any:
        if np.min(value) < 0.0:
            raise ValueError("a resolution must not be negative")
        return value

    def start(self, setting: Setting) -> Sensor | None:
        """See :class:`Piece`."""
        resolution = _of_coordinates(setting.robot, self.resolution, self.pose, "resolution")
        difference = self.velocity == "difference"
        if not resolution.any() and not difference:
            return None
        return _Encoders(setting.robot, resolution, setting.dt if difference else None)


class _Encoders(Sensor):
    def __init__(self, robot: MobileManipulator, resolution: Array, dt: float | None) -> None:
        self._rounded = np.flatnonzero(resolution)
        self._resolution = resolution[self._rounded]
        self._robot, self._dt = robot, dt
        self._last: Array | None = None
        self._telling = telling_rows(robot)

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


def telling_rows(robot: MobileManipulator) -> Index:
    """Places in q of what tells z: joints and wheels, or all where these leave something open."""
    every = np.arange(robot.nq, dtype=np.int64)
    own = np.setdiff1d(every, pose_index(robot))
    # the wheels tell how the platform moves, if they are coordinates at all
    tells = np.linalg.matrix_rank(robot.velocity_map(robot.q_rest)[own]) == robot.nz
    return own if tells else every


def pose_index(robot: MobileManipulator) -> list[int]:
    """Places of the platform's pose (x1, x2, theta) in q; none if it has no pose."""
    return [robot.joint_names.index(name) for name in robot.platform.base_joints]


def _of_coordinates(
    robot: MobileManipulator, encoders: float | list[float], pose: float | list[float], field: str
) -> Array:
    """A number for each coordinate, shape (nq,).

    Args:
        robot: The robot.
        encoders: For joints and wheels: a number for all, or a list in q's order.
        pose: For the platform's pose, which no encoder measures: a number for all three or a list. A
            list for all of q says this already.
        field: The field of ``encoders``, for messages.

    Raises:
        SpecError: If a list has another length.
    """
    values = entries(encoders, robot.joint_names, field, "coordinates")
    index = pose_index(robot)
    if index and not isinstance(encoders, list):
        values[index] = entries(pose, ["x1", "x2", "theta"], "pose", "coordinates of a pose")
    return values


sensors.register("noise", WhiteNoise)
sensors.register("quantisation", Quantisation)
