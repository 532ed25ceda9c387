"""What a check is, what it finds, and the registry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from mobman.checks.subject import Subject
from mobman.registry import Registry

Status = Literal["ok", "warning", "wrong"]
_MOST_NAMED = 4


@dataclass(frozen=True)
class Finding:
    """What a check found on a robot."""

    check: str
    """The check's name."""
    status: Status
    """``"wrong"``: must be mended; ``"warning"``: may be as it should, but should be looked at."""
    found: str
    """What was found, with numbers and units."""
    fix: str
    """What to do about it: which field or element of which file; empty where nothing is to be done."""


class Remark(NamedTuple):
    """A finding without the name of its check: what the functions that check give."""

    status: Status
    found: str
    fix: str


@dataclass(frozen=True)
class Check:
    """Something that can be wrong with a robot."""

    name: str
    meaning: str
    """What it looks at, in a clause."""
    function: Callable[[Subject], Iterable[Remark]]
    simulates: bool
    """Whether it runs a closed loop."""


checks: Registry[Check] = Registry("check", "mobman.checks.kinds", "mobman.checks")

Function = Callable[[Subject], Iterable[Remark]]


def check(name: str, meaning: str, *, simulates: bool = False) -> Callable[[Function], Function]:
    """Decorator: register a function of a :class:`Subject` that gives remarks as a check."""

    def register(function: Function) -> Function:
        checks.register(name, Check(name, meaning, function, simulates))
        return function

    return register


def list_checks() -> list[Check]:
    """All checks, sorted by name."""
    return [checks.get(name) for name in checks.names()]


def ok(found: str) -> Remark:
    """Nothing is to be done."""
    return Remark("ok", found, "")


def does_not_apply(reason: str) -> Remark:
    """The robot has nothing to check here."""
    return Remark("ok", f"does not apply: {reason}", "")


def warning(found: str, fix: str) -> Remark:
    """May be as it should, but should be looked at."""
    return Remark("warning", found, fix)


def wrong(found: str, fix: str) -> Remark:
    """Must be mended."""
    return Remark("wrong", found, fix)


def named_wheels(joints: Sequence[str]) -> str:
    """The subject of a sentence about wheels, by their joints' names."""
    return f"wheel{'' if len(joints) == 1 else 's'} {', '.join(map(repr, joints))}"


def some(items: Sequence[str], joint: str = ", ") -> str:
    """A list for a sentence: the first few, and how many more."""
    more = len(items) - _MOST_NAMED
    named = joint.join(items[:_MOST_NAMED])
    return f"{named} and {more} more" if more > 0 else named
