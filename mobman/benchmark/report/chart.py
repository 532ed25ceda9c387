"""A figure as data: what is drawn, before it is SVG or PDF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from mobman.arrays import Array

Marker: TypeAlias = Literal[
    "circle", "square", "triangle", "diamond", "wedge", "plus", "star", "cross"
]

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Look:
    """How a curve, or whatever belongs to it, is drawn."""

    key: str
    """Unique among the looks of a report; the class of SVG elements."""
    colour: str
    """On white."""
    dark: str
    """On a dark page."""
    dashes: tuple[float, ...] = ()
    """Lengths of dashes and gaps (px); none for a solid line."""
    width: float = 1.2
    """Of the line (px)."""
    order: float = 2.0
    """What is higher is drawn above."""
    marker: Marker = "circle"
    hollow: bool = False
    """Whether its markers are."""


@dataclass(frozen=True)
class Axis:
    """An axis; of names if it has them, with name i at i."""

    label: str
    low: float
    high: float
    log: bool = False
    names: Sequence[str] = ()
    at: Sequence[float] = ()
    """Where its ticks are, if not at round numbers."""
    extra: Sequence[tuple[float, str]] = ()
    """More ticks: value and text."""

    def fractions(self, values: Array) -> Array:
        """Where values lie, from 0 at the low end to 1 at the high end; NaN for those at none."""
        low, high = self.low, self.high
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.log:
                values, low, high = np.log10(values), math.log10(low), math.log10(high)
            return np.asarray((values - low) / (high - low))

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Values and their texts, about so many at the most."""
        if self.names:
            return list(enumerate(self.names))
        if self.at:
            return [(value, plain(value)) for value in self.at]
        found = _log_ticks(self, most) if self.log else _linear_ticks(self, most)
        return [*found, *self.extra]


@dataclass(frozen=True)
class Curve:
    """A line through points; gaps where values are not finite."""

    x: Array
    y: Array
    look: Look
    thin: bool = False
    """Whether it is thinner than its look says: an interval, a front."""


@dataclass(frozen=True)
class Band:
    """The area between two curves."""

    x: Array
    low: Array
    high: Array
    look: Look


@dataclass(frozen=True)
class Point:
    """A marker."""

    x: float
    y: float
    look: Look
    shape: Marker | None = None
    """Its look's by default."""


@dataclass(frozen=True)
class Rule:
    """A dotted or thin line through the whole panel."""

    at: float
    along: Literal["x", "y"]
    """The axis on which ``at`` is."""
    dotted: bool = True


@dataclass(frozen=True)
class Span:
    """A shaded part of the x axis."""

    low: float
    high: float


@dataclass(frozen=True)
class Tile:
    """A square of a heat map, at whole numbers of both axes of names."""

    column: int
    row: int
    shade: float
    """From 0 (best) to 1; NaN for none."""
    text: str


@dataclass(frozen=True)
class Label:
    """Words at a place."""

    x: float
    y: float
    text: str


Item: TypeAlias = Curve | Band | Point | Rule | Span | Tile | Label


@dataclass(frozen=True)
class Panel:
    """A pair of axes, and what is drawn on them."""

    x: Axis
    y: Axis
    items: Sequence[Item]
    title: str = ""


@dataclass(frozen=True)
class Key:
    """A line of the legend."""

    text: str
    look: Look
    kind: Literal["line", "marker", "both"] = "line"


@dataclass(frozen=True)
class Chart:
    """A figure: panels in rows, and a legend."""

    title: str
    """What it shows, for those who cannot see it."""
    panels: Sequence[Panel]
    columns: int = 1
    height: float = 240.0
    """Of each panel (px)."""
    legend: Sequence[Key] = field(default_factory=tuple)
    width: float = 880.0
    """Of the whole (px)."""
    label: str = ""
    """Of the y axes of all panels together."""


def decades(values: Array, floor: float) -> tuple[float, float]:
    """Powers of ten around some values, not below the floor; one decade at least."""
    values = np.asarray(values, dtype=float)
    finite = values[np.isfinite(values) & (values > 0.0)]
    if not len(finite):
        return floor, 1.0
    low = max(math.floor(math.log10(finite.min()) + 1e-9), round(math.log10(floor)))
    high = min(max(math.ceil(math.log10(finite.max()) - 1e-9), low + 1), 300)
    return 10.0**low, 10.0**high


def power(value: float) -> str:
    """A power of ten, in the text of a tick."""
    exponent = round(math.log10(value))
    return "1" if exponent == 0 else f"10{str(exponent).translate(_SUPERSCRIPT)}"


def _log_ticks(axis: Axis, most: int) -> list[tuple[float, str]]:
    first = math.ceil(math.log10(axis.low) - 1e-9)
    last = math.floor(math.log10(axis.high) + 1e-9)
    if axis.high < 5.0 * axis.low:  # nearly linear
        return [(value, text) for value, text in _linear_ticks(axis, most) if value > 0.0]
    if last - first < 2:  # less than three decades: round numbers between
        found = [
            (factor * 10.0**exponent)
            for exponent in range(first - 1, last + 1)
            for factor in (1.0, 2.0, 5.0)
        ]
        inside = [value for value in found if axis.low <= value <= axis.high * (1.0 + 1e-9)]
        if len(inside) > most:
            inside = [value for value in inside if plain(value).strip("0.") == "1"] or inside
        return [(value, plain(value)) for value in inside]
    step = max(1, math.ceil((last - first + 1) / most))
    return [(10.0**n, power(10.0**n)) for n in range(first, last + 1) if n % step == 0]


def _linear_ticks(axis: Axis, most: int) -> list[tuple[float, str]]:
    span = axis.high - axis.low
    if not (span > 0.0 and math.isfinite(span)):
        return []
    rough = span / max(most, 1)
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(size * factor for factor in (1.0, 2.0, 5.0, 10.0) if size * factor >= rough * 0.999)
    first, last = math.ceil(axis.low / step - 1e-9), math.floor(axis.high / step + 1e-9)
    return [(step * n, plain(step * n)) for n in range(first, last + 1)]


def plain(value: float) -> str:
    """A value in the text of a tick, without the last digits that rounding leaves."""
    mantissa, _, exponent = f"{value:.10g}".partition("e")
    text = f"{mantissa}e{int(exponent)}" if exponent else mantissa
    return text.replace("-", "−")
