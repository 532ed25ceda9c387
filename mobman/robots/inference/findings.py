"""What inference hands on: values with their reasons, and questions that only the user can answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mobman.errors import UsageError


@dataclass(frozen=True)
class Options:
    """What the user says of a robot instead of having it inferred.

    Attributes:
        tip: Link whose origin is the end-effector.
        right_wheels, left_wheels: Driven wheels on each side (joints).
        wheels: Wheels of an omnidirectional platform (joints).
        steering: Joints that steer.
        platform: Platform type.
        wheel_radius: m.
        heading: Direction of forward in the root link's frame (rad).
        lock: More joints that do not move: names or patterns.
    """

    tip: str | None = None
    right_wheels: tuple[str, ...] = ()
    left_wheels: tuple[str, ...] = ()
    wheels: tuple[str, ...] = ()
    steering: tuple[str, ...] = ()
    platform: str | None = None
    wheel_radius: float | None = None
    heading: float | None = None
    lock: tuple[str, ...] = ()


@dataclass(frozen=True)
class Finding:
    """A value and why it was taken."""

    value: Any
    why: str = ""


@dataclass(frozen=True)
class Lock:
    """Joints that do not move, and why."""

    joints: tuple[str, ...]
    why: str


class Undecided(UsageError):
    """Something that the URDF does not tell; the message names the option that does."""
