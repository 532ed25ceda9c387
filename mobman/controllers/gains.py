"""Gains: declared with their unit and meaning, and refused with the reason where theory does."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from mobman.arrays import SIZES, Array, beyond_sizes
from mobman.errors import GainError

MOST_TICKS = 100
Check = Callable[[str, Any], None]
"""Raises GainError unless a gain of this name may have this value."""


def gain(default: Any, unit: str, meaning: str) -> Any:
    """A dataclass field of a gain."""
    return dataclasses.field(default=default, metadata={"unit": unit, "meaning": meaning})


class CheckedGains:
    """Base of dataclasses of gains: each is what its annotation says, a choice of a Literal, or what a
    :data:`Check` in it allows (:data:`Positive`, ...)."""

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, check in _checks(kind):
            check(name, getattr(self, name))


@functools.cache
def _checks(kind: Any) -> list[tuple[str, Check]]:
    found: list[tuple[str, Check]] = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        parts = (hint, *get_args(hint))
        checks = [check for part in parts for check in getattr(part, "__metadata__", ())]
        if get_origin(hint) is Literal:
            checks = [functools.partial(_chosen, get_args(hint))]
        if type(None) in parts:
            checks = [functools.partial(_if_given, check) for check in checks]
        found += [(name, check) for check in checks]
    return found


def _chosen(choices: tuple[str, ...], name: str, value: Any) -> None:
    _require(value in choices, name, value, f"be one of {', '.join(map(repr, choices))}")


def _if_given(check: Check, name: str, value: Any) -> None:
    if value is not None:
        check(name, value)


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


def positive(name: str, value: Any) -> None:
    """Raises GainError unless the gain is a finite number above 0."""
    _require(_number(name, value) > 0.0, name, value, "be above 0")


def not_negative(name: str, value: Any) -> None:
    """Raises GainError unless the gain is a finite number, 0 or more."""
    _require(_number(name, value) >= 0.0, name, value, "not be negative")


def positive_diagonal(name: str, value: Any) -> None:
    """Raises GainError unless the gain is a number above 0, or a list of them."""
    met = bool(np.all(_numbers(name, value) > 0.0))
    _require(met, name, value, "be above 0, every entry of it")


def at_least_one(theorem: str) -> Check:
    """The gain is at least 1, as the theorem supposes."""

    def check(name: str, value: Any) -> None:
        _require(_number(name, value) >= 1.0, name, value, f"be at least 1 ({theorem})")

    return check


def bound(inequality: str) -> Check:
    """The gain is ``"auto"`` or a number above 0."""

    def check(name: str, value: Any) -> None:
        if isinstance(value, str):
            _require(value == "auto", name, value, "be 'auto' or a number above 0")
        else:
            _require(_number(name, value) > 0.0, name, value, f"be above 0, since {inequality}")

    return check


def ticks(name: str, value: Any) -> None:
    """Raises GainError unless the gain is a whole number of ticks, 0 to 100."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool | np.bool_)
    met = whole and 0 <= value <= MOST_TICKS
    _require(met, name, value, f"be a whole number of ticks from 0 to {MOST_TICKS}")


Auto = Literal["auto"]
Positive = Annotated[float, positive]
NotNegative = Annotated[float, not_negative]
Diagonal = Annotated[float | Sequence[float], positive_diagonal]
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


def _number(name: str, value: Any) -> float:
    _require(np.ndim(value) == 0, name, value, "be one number")
    return float(_numbers(name, value))


def _numbers(name: str, value: Any) -> Array:
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
