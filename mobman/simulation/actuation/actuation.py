"""What a piece of the actuation is, and the registry of kinds."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry
from mobman.simulation.pieces import Each, Piece, entries, some_given


class Motors(NamedTuple):
    """What is known of a robot's motors, each of shape (nz,)."""

    names: list[str]
    inertia: Array
    """What each one's axis feels at ``q_rest`` (kg m^2, kg)."""
    limit: Array
    """Largest torque by the URDF (N m, N); inf where it states none."""
    holding: Array
    """|torque| that holds the robot still at ``q_rest`` (N m, N)."""

    @classmethod
    def of(cls, robot: MobileManipulator) -> Motors:
        """Those of a robot."""
        still = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
        return cls(
            names=list(robot.velocity_names),
            inertia=robot.motor_inertia(robot.q_rest),
            limit=robot.limits.torque,
            holding=np.abs(np.linalg.solve(still.B, still.bias)),
        )


class Stage:
    """A piece at work: from the torques of the ticks to other torques of the ticks.

    Attributes:
        delay: By how much what comes out is late, besides (s).
        limited: Whether a limit changed the last torque.
    """

    delay: float = 0.0
    limited: bool = False

    def apply(self, torque: Array) -> Array:
        """What comes out at a tick; called once at every tick, v = 0 before the first.

        Args:
            torque: What goes in (N m, N), shape (nz,); not to be written to.
        """
        return torque


class Actuation(Protocol):
    """A kind of actuation with its parameters."""

    def start(self, motors: Motors, dt: float, random: np.random.Generator) -> Stage | None:
        """The piece for one run; None if it changes nothing.

        Args:
            motors: The robot's.
            dt: Sampling period (s).
            random: Generator of this piece alone.

        Raises:
            SpecError: If it does not fit the robot.
        """
        ...


class TorqueLevel(Piece):
    """A torque for each motor, in one of several measures."""

    torque: Each | None = None
    """N m, N: a number for all motors or one for each."""
    factor: float | None = Field(None, gt=0)
    """Of the URDF's effort limits."""
    acceleration: float | None = Field(None, gt=0)
    """rad/s^2, m/s^2: what holds the robot still at its rest posture, and gives the motor's axis this
    acceleration there. Beside ``factor``, for the motors whose limit the URDF does not state."""

    @field_validator("torque")
    @classmethod
    def _positive(cls, value: float | list[float] | None) -> float | list[float] | None:
        if value is not None and np.min(value) <= 0.0:
            raise ValueError("must be above 0")
        return value

    @model_validator(mode="after")
    def _measure(self) -> Self:
        some_given(
            {"torque": self.torque, "factor": self.factor, "acceleration": self.acceleration}
        )
        if self.torque is not None and (self.factor is not None or self.acceleration is not None):
            raise ValueError("give 'torque' alone, or 'factor' or 'acceleration' or both")
        return self

    def level(self, motors: Motors) -> Array:
        """The torque of each motor (N m, N), shape (nz,); inf where nothing states one.

        Raises:
            SpecError: If a list has not one entry for each motor.
        """
        if self.torque is not None:
            return entries(self.torque, motors.names, "torque", "motors")
        level = np.full(len(motors.names), np.inf)
        if self.acceleration is not None:
            level = motors.holding + self.acceleration * motors.inertia
        if self.factor is not None:
            level = np.where(np.isfinite(motors.limit), self.factor * motors.limit, level)
        return level


actuations: Registry[type[Actuation]] = Registry(
    "actuation type", "mobman.simulation.actuation.kinds"
)
"""The kinds of actuation; each module registers its own."""
