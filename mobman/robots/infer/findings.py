"""Input and output of inference: options, values with their reasons, and the meaning of names."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from numbers import Real
from typing import Any, NamedTuple

from mobman.arrays import LARGEST
from mobman.errors import UsageError

_KNOWN = tomllib.loads(
    (files("mobman.robots.infer") / "inference.toml").read_text(encoding="utf-8")
)
TIPS: dict[str, str] = _KNOWN["tips"]
"""Kinds of frames at the end of an arm, the best ones first."""
TYPES = {name: tuple(fields) for name, fields in _KNOWN["types"].items()}
"""Platform types that wheels are recognised as, or that need none, and the fields that are found."""
_NAMES: dict[str, str] = _KNOWN["names"] | TIPS

MOST_RADIUS, MOST_TRACK, MOST_REACH = 2.0, 20.0, 30.0
"""What is larger is in another unit (m): the wheels of the largest dumpers have a radius of 2 m, and are
10 m apart; the longest arms that are sold reach 15 m, and those of excavators 25 m."""
MOST_OF_BASE = 30.0
"""An arm that reaches so many times as far as its platform is long is in another unit: an arm alone on
its foot reaches 12 times as far, and an inch is a 39th of a metre."""


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
        """Refuse values of a wrong type, numbers that are not finite, a radius that is not above 0, by a
        UsageError; ``called`` is how it calls a fact, ``{}`` being its name."""
        for name in ("tip", "platform"):
            if not isinstance(value := getattr(self, name), str | None):
                raise UsageError(f"{called.format(name)} is {value!r}; allowed: a name")
        for name in ("right_wheels", "left_wheels", "wheels", "steering", "lock"):
            value = getattr(self, name)
            if not isinstance(value, tuple) or not all(isinstance(one, str) for one in value):
                raise UsageError(f"{called.format(name)} is {value!r}; allowed: a name, or several")
        for name, least, what in (
            ("heading", -math.tau, "angle within a turn (rad)"),
            ("wheel_radius", 0.0, "length above 0 (m)"),
        ):
            value = getattr(self, name)
            number = isinstance(value, Real) and not isinstance(value, bool)
            most = -least or LARGEST
            if value is not None and not (number and least < value < most):
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


def says(what: str, *names: str) -> bool:
    """True if one of the names says what a regular expression of ``inference.toml`` is for."""
    words = (re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower() for name in names)
    return any(re.search(_NAMES[what], re.sub(r"[^a-z0-9]+", "_", word)) for word in words)


def says_which(one: str, other: str, *names: str) -> int:
    """+1 where names say one thing, -1 the other, 0 neither or both."""
    return int(says(one, *names)) - int(says(other, *names))


def common(what: str, names: Collection[str]) -> bool:
    """True if most of the names say something, which then tells nothing."""
    return sum(says(what, name) for name in names) > 0.6 * len(names)
