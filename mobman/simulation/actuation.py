"""Actuation: from the commanded torque to the one that acts."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.simulation.pieces import (
    EachPositive,
    Piece,
    Setting,
    Spread,
    entries,
    some_given,
    types_of,
)

_ROUNDING = 1e-6  # ticks, share of a limit: what is as near to a whole number, or to it, is there


class Stage(NamedTuple):
    """A piece at work: from the torques of the ticks to other torques of the ticks."""

    apply: Callable[[Array], tuple[Array, bool]] = lambda torque: (torque, False)
    """The torque that comes out at a tick, of the one that goes in (N m, N), shape (nz,), which must not
    be written to; and whether it met a limit: was cut, or was as large as is allowed. Called once at
    every tick, v = 0 before the first."""
    delay: float = 0.0
    """By how much what comes out is late, in addition (s)."""
    level: Array | None = None
    """Largest |torque| of each motor that comes out (N m, N), shape (nz,), if there is one."""


actuations = types_of("actuation type", "mobman.actuation")
"""Types of actuation; each starts as a :class:`Stage`, or None."""


class ActuationChain:
    """The pieces in their order, and their delays.

    What a piece makes of the torques of the ticks does not depend on when they arrive, so all delays
    together may come last. Stages are in the order of the signal, dt is the sampling period (s).

    Attributes:
        split: How far into each tick a new torque arrives, as a fraction of the tick; 0 where the
            delay is a whole number of ticks.
        early: The torque that acts from the tick on, shape (nz,).
        late: That from ``split`` on, shape (nz,).
        limited: Whether the torque that is commanded at this tick met a limit.
        level: Largest |torque| that comes out (N m, N), shape (nz,); None if nothing limits it.
    """

    def __init__(self, stages: list[Stage], dt: float, nz: int) -> None:
        self._stages = stages
        ticks = math.fsum(stage.delay for stage in stages) / dt
        self._whole = math.floor(ticks + _ROUNDING)
        fraction = ticks - self._whole
        self.split = fraction if fraction > _ROUNDING else 0.0
        self._under_way: deque[Array] = deque()
        self.early, self.late = np.zeros(nz), np.zeros(nz)
        self.limited = False
        levels = [stage.level for stage in stages if stage.level is not None]
        self.level: Array | None = np.min(levels, axis=0) if levels else None

    def take(self, torque: Array) -> None:
        """Command a torque, shape (nz,), at the next tick."""
        self.limited = False
        for stage in self._stages:
            given = stage.apply(torque)
            if not isinstance(given, tuple) or len(given) != 2:
                raise UsageError(
                    f"actuation: {stage.apply!r} gave {given!r}; expected the torque, and whether it "
                    "met a limit"
                )
            torque, limited = given
            self.limited |= bool(limited)
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


@actuations.register("delay")
class Delay(Piece):
    """The command acts so much later, whether or not that is a whole number of ticks; v = 0
    until the first command has arrived."""

    delay: float = Field(ge=0)
    """s."""

    def start(self, setting: Setting) -> Stage | None:
        return Stage(delay=self.delay) if self.delay > 0.0 else None


class TorqueLevel(Piece):
    """A torque for each motor, in one of several measures."""

    torque: EachPositive | None = None
    """N m, N: a number for all motors or one for each."""
    factor: float | None = Field(None, gt=0)
    """Factor of the URDF's effort limits."""
    acceleration: float | None = Field(None, gt=0)
    """rad/s^2, m/s^2: what holds the robot still at its rest posture, and gives the motor's axis this
    acceleration there. In addition to ``factor``, for the motors whose limit the URDF does not state."""

    @model_validator(mode="after")
    def _measure(self) -> Self:
        some_given(self, "torque", "factor", "acceleration")
        if self.torque is not None and (self.factor is not None or self.acceleration is not None):
            raise ValueError("give 'torque' alone, or 'factor' or 'acceleration' or both")
        return self

    def level(self, setting: Setting) -> Array:
        """The torque of each motor (N m, N), shape (nz,); inf where nothing states one.
        SpecError if a list has not one entry for each motor."""
        robot = setting.robot
        if self.torque is not None:
            return entries(self.torque, list(robot.velocity_names), "torque", "motors")
        level = np.full(robot.nz, np.inf)
        if self.acceleration is not None:
            holding = np.abs(robot.holding_torque(robot.q_rest))
            level = holding + self.acceleration * setting.inertia
        if self.factor is not None:
            limit = robot.limits.torque
            level = np.where(np.isfinite(limit), self.factor * limit, level)
        return level


@actuations.register("saturation")
class Saturation(TorqueLevel):
    """Each motor's torque stays between minus and plus its level."""

    def start(self, setting: Setting) -> Stage | None:
        level = self.level(setting)

        def clip(torque: Array) -> tuple[Array, bool]:
            # also where the law keeps to the limit by itself, but for rounding
            limited = (np.abs(torque) >= (1.0 - _ROUNDING) * level).any()
            return np.clip(torque, -level, level), bool(limited)

        return Stage(clip, level=level) if np.isfinite(level).any() else None


@actuations.register("rate-limit")
class RateLimit(TorqueLevel):
    """Each motor's torque changes by at most dt / ``rise_time`` of its level from tick to tick."""

    rise_time: float = Field(gt=0)
    """From 0 to the level (s)."""

    def start(self, setting: Setting) -> Stage | None:
        level = self.level(setting)
        step, last = setting.dt / self.rise_time * level, np.zeros_like(level)

        def follow(torque: Array) -> tuple[Array, bool]:
            nonlocal last
            # not the last plus a change: a torque within the limit comes through bit for bit
            last = np.clip(torque, last - step, last + step)
            return last, bool((last != torque).any())

        return Stage(follow) if np.isfinite(level).any() else None


@actuations.register("gain")
class MotorGains(Piece):
    """Each motor's torque over the commanded one, fixed or at random: B of (17) scaled by motor."""

    factor: EachPositive = 1.0
    """A number for all motors or one for each."""
    spread: Spread = 0.0
    """The factor times a number from [1 - spread, 1 + spread], for each motor its own."""

    def start(self, setting: Setting) -> Stage | None:
        names = list(setting.robot.velocity_names)
        draws = setting.random.uniform(-1.0, 1.0, len(names))
        factor = entries(self.factor, names, "factor", "motors") * (1.0 + self.spread * draws)
        return Stage(lambda torque: (factor * torque, False)) if np.any(factor != 1.0) else None
