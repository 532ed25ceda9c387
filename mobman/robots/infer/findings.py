"""Input and output of inference: options, values with their reasons, and the meaning of names."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, NamedTuple

from mobman.errors import UsageError

TYPES: dict[str, tuple[str, ...]] = {
    "differential": ("heading", "right_wheel", "left_wheel", "wheel_radius", "half_track"),
    "skid-steer": ("heading", "right_wheels", "left_wheels", "wheel_radius", "half_track"),
    "omnidirectional": ("heading", "kind", "wheels", "wheel_radius"),
    "car-like": (
        "heading", "rear_right_wheel", "rear_left_wheel", "steering", "front_wheels", "wheel_radius",
        "half_track",
    ),
    "swerve": ("heading", "steering", "wheels", "wheel_radius"),
    "multi-axle": ("heading", "steering", "wheels", "wheel_radius"),
    "turret": ("heading", "turret", "right_wheel", "left_wheel", "wheel_radius", "half_track"),
    "unicycle": ("heading", "axle", "height"),
    "planar": ("heading", "centre", "height"),
    "fixed": (),
}  # fmt: skip
"""Platform types that wheels are recognised as, or that need none, and the fields that are found."""

MOST_RADIUS, MOST_TRACK, MOST_REACH = 2.0, 20.0, 30.0
"""What is larger is in another unit (m): the wheels of the largest dumpers have a radius of 2 m, and are
10 m apart; the longest arms that are sold reach 15 m, and those of excavators 25 m."""
MOST_OF_BASE = 30.0
"""An arm that reaches so many times as far as its platform is long is in another unit: an arm alone on
its foot reaches 12 times as far, and an inch is a 39th of a metre."""

CASTER = r"cast[eo]r|passive|idler|support|swivel|free_?wheel|dummy|trailing"
WHEEL = r"wheel(?!_?base)"
FOOTPRINT = r"footprint"
_FRONT, _REAR = (
    r"front|(^|_)(f|fl|fr|lf|rf)(_|\d|$)",
    r"rear|back|(^|_)(b|bl|br|rl|rr|lr|lb|rb)(_|\d|$)",
)
_RIGHT, _LEFT = r"right|(^|_)(r|fr|rf|br|rb|rr)(_|\d|$)", r"left|(^|_)(l|fl|lf|bl|lb|rl|lr)(_|\d|$)"


@dataclass(frozen=True)
class Options:
    """Facts that the user gives instead of having them inferred."""

    tip: str | None = None  # link whose origin is the end-effector
    right_wheels: tuple[str, ...] = ()  # driven wheels on each side (joints)
    left_wheels: tuple[str, ...] = ()
    wheels: tuple[str, ...] = ()  # of an omnidirectional platform (joints)
    steering: tuple[str, ...] = ()  # joints that steer
    platform: str | None = None  # platform type
    wheel_radius: float | None = None  # m
    heading: float | None = None  # direction of forward in the root link's frame (rad)
    lock: tuple[str, ...] = ()  # more joints that do not move: names or patterns
    as_it_is: bool = False  # whatever its sizes say
    # platform types that may be asked for, and those of their fields that are found
    types: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: TYPES, hash=False)

    def check(self, called: str = "{}") -> None:
        """Refuse values of a wrong type, numbers that are not finite, a radius that is not above 0.

        Args:
            called: How a message calls a fact, ``{}`` being its name.

        Raises:
            UsageError: If one is there.
        """
        for name in ("tip", "platform"):
            if not isinstance(value := getattr(self, name), str | None):
                raise UsageError(f"{called.format(name)} is {value!r}; allowed: a name")
        for name in ("right_wheels", "left_wheels", "wheels", "steering", "lock"):
            value = getattr(self, name)
            if not isinstance(value, tuple) or not all(isinstance(one, str) for one in value):
                raise UsageError(f"{called.format(name)} is {value!r}; allowed: a name, or several")
        for name, least, what in (
            ("heading", -math.inf, "angle (rad)"),
            ("wheel_radius", 0.0, "length above 0 (m)"),
        ):
            value = getattr(self, name)
            number = isinstance(value, Real) and not isinstance(value, bool)
            if value is not None and not (number and math.isfinite(value) and value > least):
                flag = called.format(name.replace("_", "-") if called != "{}" else name)
                raise UsageError(f"{flag} is {value!r}; allowed: a finite {what}")

    def fields(self, platform: str | None) -> tuple[str, ...]:
        """The fields of a platform type that are found."""
        return self.types.get(platform or "", ())

    def without_wheels(self, platform: str | None) -> bool:
        """True if a platform type's wheels are no coordinates."""
        return platform is not None and not any("wheel" in f for f in self.fields(platform))


class Inferred(NamedTuple):
    """A value and why it was taken."""

    value: Any
    why: str = ""


class Lock(NamedTuple):
    """Joints that do not move, and why."""

    joints: tuple[str, ...]
    why: str


def lock_once(taken: set[str], *groups: tuple[Iterable[str], str]) -> list[Lock]:
    """Locks of joints that are not taken, each by the first group that has it."""
    found, done = [], set(taken)
    for joints, why in groups:
        if names := tuple(dict.fromkeys(name for name in joints if name not in done)):
            done.update(names)
            found.append(Lock(names, why))
    return found


class Undecided(UsageError):
    """Something that the URDF does not tell; the message names the option that does."""


def says(pattern: str, *names: str) -> bool:
    """True if one of the names matches the pattern, in lower case with ``_`` between its words."""
    words = (re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower() for name in names)
    return any(re.search(pattern, re.sub(r"[^a-z0-9]+", "_", word)) for word in words)


def lengthwise(*names: str) -> int:
    """+1 where names say front, -1 rear, 0 neither or both."""
    return int(says(_FRONT, *names)) - int(says(_REAR, *names))


def sideways(*names: str) -> int:
    """+1 where names say left, -1 right, 0 neither or both."""
    return int(says(_LEFT, *names)) - int(says(_RIGHT, *names))


def common(pattern: str, names: Iterable[str]) -> bool:
    """True if most of the names match a pattern, which then tells nothing."""
    names = list(names)
    return sum(says(pattern, name) for name in names) > 0.6 * len(names)
