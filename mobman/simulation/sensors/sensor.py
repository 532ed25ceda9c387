"""What a sensors' error is, and the registry of kinds."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry
from mobman.simulation.pieces import entries


class Sensor:
    """A piece at work: what is measured, from what is."""

    def state(self, q: Array, z: Array) -> None:
        """Change q and z, shapes (nq,) and (nz,), in place; called once at every tick."""

    def acceleration(self, z_dot: Array) -> None:
        """Change z', shape (nz,), in place; after :meth:`state`."""


class Sensors(Protocol):
    """A kind of error with its parameters."""

    def start(
        self, robot: MobileManipulator, dt: float, random: np.random.Generator
    ) -> Sensor | None:
        """The error of one run; None if there is none.

        Args:
            robot: The nominal robot.
            dt: Sampling period (s).
            random: Generator of this piece alone.

        Raises:
            SpecError: If it does not fit the robot.
        """
        ...


sensors: Registry[type[Sensors]] = Registry("sensor type", "mobman.simulation.sensors.kinds")
"""The kinds of errors; each module registers its own."""


def pose_index(robot: MobileManipulator) -> list[int]:
    """Where the platform's pose (x1, x2, theta) is in q; empty if there is none."""
    return [robot.joint_names.index(name) for name in robot.platform.base_joints]


def of_coordinates(
    robot: MobileManipulator,
    encoders: float | list[float],
    pose: float | list[float],
    field: str,
) -> Array:
    """A number for each coordinate, shape (nq,).

    Args:
        robot: Whose.
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
