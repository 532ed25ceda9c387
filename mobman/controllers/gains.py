"""Gains: declared with their unit and meaning, and refused with the reason where theory does."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from mobman.arrays import SIZES, Array, beyond_sizes
from mobman.errors import GainError

Auto = Literal["auto"]
MOST_TICKS = 100
Diagonal = float | Sequence[float]
"""A diagonal matrix: one number for all entries, or one for each."""


def gain(default: Any, unit: str, meaning: str) -> Any:
    """A dataclass field of a gain."""
    return dataclasses.field(default=default, metadata={"unit": unit, "meaning": meaning})


def as_settings(gains: Any) -> dict[str, Any]:
    """The gains as plain values, for records."""
    settings = {}
    for field in dataclasses.fields(gains):
        value = getattr(gains, field.name)
        if isinstance(value, Fraction):
            value = f"{value.numerator}/{value.denominator}"
        elif isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, (tuple, list)):
            value = list(value)
        settings[field.name] = value
    return settings


def require_positive(gains: Any, *names: str) -> None:
    """Raises GainError unless each named gain is a finite number above 0."""
    for name in names:
        if not _number(gains, name) > 0.0:
            raise GainError(f"{name} = {getattr(gains, name)!r}: must be above 0")


def require_positive_diagonal(gains: Any, *names: str) -> None:
    """Raises GainError unless each named gain is a number above 0, or a list of them."""
    for name in names:
        value = getattr(gains, name)
        if not np.all(_numbers(name, value) > 0.0):
            raise GainError(f"{name} = {value!r}: must be above 0, every entry of it")


def require_not_negative(gains: Any, *names: str) -> None:
    """Raises GainError unless each named gain is a finite number, 0 or more."""
    for name in names:
        if not _number(gains, name) >= 0.0:
            raise GainError(f"{name} = {getattr(gains, name)!r}: must not be negative")


def require_at_least_one(gains: Any, name: str, theorem: str) -> None:
    """Raises GainError unless the gain is at least 1, as the theorem supposes."""
    if not _number(gains, name) >= 1.0:
        raise GainError(f"{name} = {getattr(gains, name)!r}: must be at least 1 ({theorem})")


def require_bound(gains: Any, name: str, inequality: str) -> None:
    """Raises GainError unless the gain is ``"auto"`` or a number above 0."""
    value = getattr(gains, name)
    if isinstance(value, str):
        if value != "auto":
            raise GainError(f"{name} = {value!r}: must be 'auto' or a number above 0")
    elif not _number(gains, name) > 0.0:
        raise GainError(f"{name} = {value!r}: must be above 0, since {inequality}")


def require_ticks(gains: Any, name: str) -> None:
    """Raises GainError unless the gain is None or a whole number of ticks, 0 to 100."""
    value = getattr(gains, name)
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.bool_))
    if value is not None and not (whole and 0 <= value <= MOST_TICKS):
        raise GainError(
            f"{name} = {value!r}: must be a whole number of ticks from 0 to {MOST_TICKS}"
        )


def require_choice(gains: Any, name: str, choices: Sequence[str]) -> None:
    """Raises GainError unless the setting is one of the choices."""
    value = getattr(gains, name)
    if value not in choices:
        raise GainError(f"{name} = {value!r}: must be one of {', '.join(map(repr, choices))}")


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


def diagonal(name: str, value: Diagonal, length: int) -> Array:
    """The diagonal of a gain matrix, shape (length,).

    Raises:
        GainError: If it has another length.
    """
    vector = np.asarray(value, dtype=float)
    if vector.ndim == 0:
        return np.full(length, float(vector))
    if vector.shape != (length,):
        raise GainError(
            f"{name} has {vector.size} entries; needed: one number, or {length} of them, one for "
            "each component"
        )
    return vector.copy()


def _number(gains: Any, name: str) -> float:
    value = getattr(gains, name)
    if np.ndim(value) != 0:
        raise GainError(f"{name} = {value!r}: must be one number")
    return float(_numbers(name, value))


def _numbers(name: str, value: Any) -> Array:
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        numbers = np.array(np.nan)
    entries = np.ravel(np.asarray(value, dtype=object))
    plain = not any(isinstance(entry, (bool, np.bool_, str)) for entry in entries)
    if not plain or numbers.size == 0 or not np.all(np.isfinite(numbers)):
        raise GainError(f"{name} = {value!r}: must be a finite number, or a list of them")
    if beyond_sizes(numbers):
        raise GainError(f"{name} = {value!r}: must be {SIZES}")
    return numbers
