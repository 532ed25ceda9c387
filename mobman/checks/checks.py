"""Interface of a check of robots, the registry of checks, and running all of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.checks.subject import Subject
from mobman.errors import FOREIGN_ERRORS
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry

Status = Literal["ok", "warning", "wrong"]
_MOST_NAMED = 4


@dataclass(frozen=True)
class Finding:
    """Result of a check on a robot."""

    check: str
    """The check's name."""
    status: Status
    """``"wrong"``: must be fixed; ``"warning"``: plausible, please verify."""
    found: str
    """Result in words, with numbers and units."""
    fix: str
    """Remedy: which field or element of which file; empty where nothing is to be done."""


class Remark(NamedTuple):
    """A finding without the name of its check: what the functions that check give."""

    status: Status
    found: str
    fix: str
    alone: bool = False
    """True if it is left out where the check makes others."""


Function = Callable[[Subject], Iterable[Remark]]


@dataclass(frozen=True)
class Check:
    """Something that can be wrong with a robot."""

    name: str
    meaning: str
    """Condition that holds on a sound robot, in a clause."""
    function: Function
    simulates: bool
    """True if it runs a closed loop."""


checks: Registry[Check] = Registry("check", "mobman.checks", "mobman.checks")


def check(name: str, meaning: str, *, simulates: bool = False) -> Callable[[Function], Function]:
    """Decorator: register a function of a :class:`Subject` that gives remarks as a check."""

    def register(function: Function) -> Function:
        item = Check(name, meaning, function, simulates)
        checks.register(name, item, module=function.__module__)
        function.__doc__ = function.__doc__ or f"Check {name!r}: {meaning}."
        return function

    return register


def list_checks() -> list[Check]:
    """All checks, sorted by name."""
    return [checks.get(name) for name in checks.names()]


def run_checks(
    robot: MobileManipulator, *, simulation: bool = True, only: Collection[str] | None = None
) -> list[Finding]:
    """Findings of the checks on a robot, at least one each, in the order of the checks' names.

    Args:
        robot: The robot.
        simulation: Whether to run the checks that need a closed loop, too.
        only: Names of the checks to run; all by default.

    Raises:
        UnknownNameError: If ``only`` has a name that is none of :func:`list_checks`.
    """
    subject = Subject(robot)
    found: list[Finding] = []
    for item in list_checks() if only is None else [checks.get(name) for name in sorted(only)]:
        if item.simulates and not simulation:
            continue
        remarks: list[Remark] = []
        try:
            remarks.extend(item.function(subject))
        except FOREIGN_ERRORS as error:  # what breaks one check must not hide what the others find
            text = " ".join(str(error).split()) or "no message"
            remarks.append(
                wrong(
                    f"the check ended with {type(error).__name__}: {text}",
                    f"look at what it looks at ({item.meaning}); where nothing is wrong there, the "
                    "check is",
                )
            )
        remarks = [mark for mark in remarks if not mark.alone or len(remarks) == 1]
        found += [Finding(item.name, *mark[:3]) for mark in remarks or [ok(item.meaning)]]
    return found


# For the functions that check --------------------------------------------------------------------------

# Central differences of order 8: the truncation error is h^8/630 times the ninth derivative.
_WEIGHTS = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


def ok(found: str) -> Remark:
    """Nothing is to be done."""
    return Remark("ok", found, "")


def all_ok(found: str) -> Remark:
    """Nothing is to be done, unless the check makes another remark."""
    return Remark("ok", found, "", alone=True)


def does_not_apply(reason: str) -> Remark:
    """The robot has nothing to check here."""
    return ok(f"does not apply: {reason}")


def warning(found: str, fix: str) -> Remark:
    """Plausible, to be verified."""
    return Remark("warning", found, fix)


def wrong(found: str, fix: str) -> Remark:
    """Must be fixed."""
    return Remark("wrong", found, fix)


def named_wheels(joints: Sequence[str]) -> str:
    """The subject of a sentence about wheels, by their joints' names."""
    return f"wheel{'' if len(joints) == 1 else 's'} {', '.join(map(repr, joints))}"


def some(items: Iterable[str], joint: str = ", ") -> str:
    """A list for a sentence: the first few, and how many more."""
    items = list(items)
    more = len(items) - _MOST_NAMED
    named = joint.join(items[:_MOST_NAMED])
    return f"{named} and {more} more" if more > 0 else named


def derivative(function: Callable[[float], Array], step: float) -> Array:
    """d function(s)/ds at s = 0, by differences that reach nine digits."""
    terms = [weight * (function(i * step) - function(-i * step)) for i, weight in _WEIGHTS]
    total: Array = np.sum(terms, axis=0) / step
    return total


def relative(found: Array, expected: Array) -> float:
    """Largest difference of two arrays over the largest entry of either, or over 1."""
    both = np.concatenate([np.ravel(found), np.ravel(expected)])
    if both.size == 0:
        return 0.0
    return float(np.abs(found - expected).max() / max(1.0, np.abs(both).max()))
