"""Gains: declared with their unit and meaning, and refused with the reason where theory does; those of
the criterion F, which all laws have."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from mobman.arrays import SIZES, Array, beyond_sizes
from mobman.errors import GainError, MobmanError
from mobman.model.criterion import Posture, Sum, Term, criteria
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task
from mobman.toml_model import validate

Check = Callable[[str, Any], object]
"""Raises GainError unless a gain of this name may have this value."""


def gain(default: Any, unit: str, meaning: str) -> Any:
    """A dataclass field of a gain."""
    return dataclasses.field(default=default, metadata={"unit": unit, "meaning": meaning})


class CheckedGains:
    """Base of dataclasses of gains: each is what its annotation says, a choice of a Literal, or what a
    :data:`Check` in it allows (:data:`Positive`, ...)."""

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, hint in _hints(kind).items():
            value, parts = getattr(self, name), (hint, *get_args(hint))
            if value is None and type(None) in parts:
                continue
            if get_origin(hint) is Literal:
                choices = ", ".join(map(repr, parts[1:]))
                _require(value in parts[1:], name, value, f"be one of {choices}")
            for check in (check for part in parts for check in getattr(part, "__metadata__", ())):
                check(name, value)


@functools.cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def as_settings(gains: Any) -> dict[str, Any]:
    """The gains as plain values, for records."""

    def plain(value: Any) -> Any:
        if isinstance(value, Fraction):
            return f"{value.numerator}/{value.denominator}"
        if isinstance(value, np.ndarray):
            return value.tolist()
        return list(value) if isinstance(value, tuple | list) else value

    return {field.name: plain(getattr(gains, field.name)) for field in dataclasses.fields(gains)}


# Conditions ------------------------------------------------------------------------------------------


def _require(met: bool, name: str, value: Any, condition: str) -> None:
    if not met:
        raise GainError(f"{name} = {value!r}: must {condition}")


def condition(
    words: str, holds: Callable[[Array], Any], *, several: bool = False, auto: bool = False
) -> Check:
    """The gain is a finite number for which something holds, and must ``words``; or several numbers, or
    ``"auto"``, where these are allowed."""

    def check(name: str, value: Any) -> None:
        if auto and isinstance(value, str):
            return _require(value == "auto", name, value, "be 'auto' or a number above 0")
        _require(several or np.ndim(value) == 0, name, value, "be one number")
        return _require(bool(np.all(holds(_numbers(name, value)))), name, value, words)

    return check


def at_least_one(theorem: str) -> Check:
    """The gain is at least 1, as the theorem supposes."""
    return condition(f"be at least 1 ({theorem})", lambda x: x >= 1.0)


def bound(inequality: str) -> Check:
    """The gain is ``"auto"`` or a number above 0."""
    return condition(f"be above 0, since {inequality}", lambda x: x > 0.0, auto=True)


def whole(least: int, most: int, what: str = "") -> Check:
    """The gain is a whole number within bounds, of what it counts."""

    def check(name: str, value: Any) -> None:
        met = isinstance(value, int | np.integer) and not isinstance(value, bool | np.bool_)
        words = f"be a whole number{what} from {least} to {most}"
        _require(met and least <= value <= most, name, value, words)

    return check


Auto = Literal["auto"]
Positive = Annotated[float, condition("be above 0", lambda x: x > 0.0)]
NotNegative = Annotated[float, condition("not be negative", lambda x: x >= 0.0)]
Diagonal = Annotated[
    float | Sequence[float],
    condition("be above 0, every entry of it", lambda x: x > 0.0, several=True),
]
"""A diagonal matrix: one number for all entries, or one for each."""


def odd_ratio(name: str, value: Any) -> Fraction:
    """alpha_1 = n1/n2 of (51) as a fraction.

    Args:
        name: What to call it in messages.
        value: A fraction, a string such as ``"3/5"``, or a float that is one of small odd numbers.

    Raises:
        GainError: Unless n1 and n2 are odd and n1 < n2 < 2 n1.
    """
    try:
        ratio = Fraction(value).limit_denominator(999)
        exact = abs(float(ratio) - float(Fraction(value))) < 1e-12
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        ratio, exact = Fraction(0), False
    n1, n2 = ratio.numerator, ratio.denominator
    if not (exact and n1 % 2 == 1 and n2 % 2 == 1 and n1 < n2 < 2 * n1):
        found = f" = {n1}/{n2}" if exact else ""
        raise GainError(
            f"{name} = {value}{found}: must be n1/n2 with n1 and n2 odd and n1 < n2 < 2 n1 (51), "
            "for instance 3/5"
        )
    return ratio


def diagonal(name: str, value: Any, length: int) -> Array:
    """The diagonal of a gain matrix, shape (length,).

    Raises:
        GainError: If it has another length.
    """
    vector = np.asarray(value, dtype=float)
    if vector.shape not in ((), (length,)):
        raise GainError(
            f"{name} has {vector.size} entries; needed: one number, or {length} of them, one for "
            "each component"
        )
    return np.full(length, vector)


def _numbers(name: str, value: Any) -> Array:
    if type(value) is float and not beyond_sizes(value):  # most are, and what follows takes 10 us
        return np.array(value)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        numbers = np.array(np.nan)
    entries = np.ravel(np.asarray(value, dtype=object))
    plain = not any(isinstance(entry, bool | np.bool_ | str) for entry in entries)
    finite = plain and numbers.size > 0 and bool(np.isfinite(numbers).all())
    _require(finite, name, value, "be a finite number, or a list of them")
    _require(not beyond_sizes(numbers), name, value, f"be {SIZES}")
    return numbers


# The criterion of a law --------------------------------------------------------------------------------


def terms(name: str, given: Sequence[Mapping[str, Any]]) -> list[Term]:
    """The terms of ``criteria``.

    Raises:
        GainError: If one has an unknown type or a wrong field.
    """
    if not isinstance(given, list | tuple):
        raise GainError(f"{name} = {given!r}: must be a list of tables, each with a type")
    found = []
    for number, table in enumerate(given):
        origin = f"{name}[{number}]"
        fields = dict(table) if isinstance(table, Mapping) else {}
        kind = fields.pop("type", None)
        if not isinstance(kind, str):
            raise GainError(
                f"{origin} = {table!r}: must be a table with a type, one of "
                f"{', '.join(map(repr, criteria.names()))}, a weight, and the type's fields"
            )
        try:
            found.append(validate(criteria.get(kind), fields, origin))
        except MobmanError as error:
            raise GainError(f"{origin}: {str(error).removeprefix(f'{origin}: ')}") from error
    return found


@dataclasses.dataclass(frozen=True, kw_only=True)
class CriterionGains(CheckedGains):
    """Gains of the criterion."""

    c_F: Positive = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )
    criteria: Annotated[Sequence[Mapping[str, Any]], terms] = gain(
        (), "", "terms added to (12): tables of type, weight and the type's fields"
    )

    def criterion(self, robot: MobileManipulator, task: Task) -> Posture | Sum:
        """F of a law with these gains: (12), and what is added to it.

        Where no K_F is given, its diagonal is the task's ``criterion_weights(robot)`` if it has that
        method, else the robot's own. The robot's couplings stay.

        Raises:
            GainError: If K_F has not one weight for each coordinate of q.
            UsageError: If a term means nothing for this robot.
        """
        own = getattr(task, "criterion_weights", None)
        if self.K_F is not None:
            weights = diagonal("K_F", self.K_F, robot.nq)
        else:
            weights = robot.criterion_weights if own is None else own(robot)
        posture = Posture(weights, robot.q_rest, self.c_F, robot.criterion_couplings)
        added = [term.on(robot) for term in terms("criteria", self.criteria)]
        return Sum(posture, added) if added else posture
