"""Numbers in a URDF: which attributes have them, and what they may be.

Only what every reader of URDFs takes is a number: digits with a decimal point and an exponent, as XML
Schema writes a double, whatever the locale. ``nan``, ``inf``, ``0x10``, ``1_000``, ``0,5`` and
``0.1 m`` are none.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.robots.urdf.problems import Problems

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WITH_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+")
_ROUNDING = 1e-12  # moments (kg m^2) below zero by no more than this come from a program's rounding


@dataclass(frozen=True)
class Numbers:
    """What an attribute may hold.

    Attributes:
        unit: Of each number; empty for a pure number.
        count: How many numbers there are.
        least: The smallest value, if there is one.
        positive: Whether they must be above 0.
        required: Whether the attribute must be there.
    """

    unit: str
    count: int = 1
    least: float | None = None
    positive: bool = False
    required: bool = False

    def holds(self, value: float) -> bool:
        """Whether one number is allowed."""
        return value > 0 if self.positive else self.least is None or value >= self.least

    def __str__(self) -> str:
        allowed = "a finite number" if self.count == 1 else f"{self.count} finite numbers"
        if self.positive:
            allowed += " above 0"
        elif self.least is not None:
            allowed += ", 0 or more"
        return allowed + (f" ({self.unit})" if self.unit else "")


_MOMENT = Numbers("kg m^2", required=True, least=-_ROUNDING)
_PRODUCT = Numbers("kg m^2", required=True)
_SIZE = Numbers("m", required=True, positive=True)

NUMBERS: dict[str, dict[str, Numbers]] = {
    "origin": {"xyz": Numbers("m", count=3), "rpy": Numbers("rad", count=3)},
    "axis": {"xyz": Numbers("", count=3)},
    "limit": {
        "lower": Numbers("m or rad"),
        "upper": Numbers("m or rad"),
        "effort": Numbers("N or N m", least=0.0),
        "velocity": Numbers("m/s or rad/s", least=0.0),
    },
    "dynamics": {
        "damping": Numbers("N s/m or N m s/rad", least=0.0),
        "friction": Numbers("N or N m", least=0.0),
    },
    "mimic": {"multiplier": Numbers(""), "offset": Numbers("m or rad")},
    "mass": {"value": Numbers("kg", required=True, least=0.0)},
    "inertia": {
        **dict.fromkeys(("ixx", "iyy", "izz"), _MOMENT),
        **dict.fromkeys(("ixy", "ixz", "iyz"), _PRODUCT),
    },
    "box": {"size": Numbers("m", count=3, required=True, positive=True)},
    "cylinder": {"radius": _SIZE, "length": _SIZE},
    "sphere": {"radius": _SIZE},
    "mesh": {"scale": Numbers("", count=3)},
}
"""By element and attribute."""


def number(text: str) -> float | None:
    """The finite number that a text is, or None."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def numbers(text: str) -> list[float] | None:
    """The finite numbers that a text holds, separated by spaces, or None."""
    values = []
    for part in text.split():
        value = number(part)
        if value is None:
            return None
        values.append(value)
    return values


def scalar(element: ET.Element | None, attribute: str) -> float:
    """The number of an attribute of a checked URDF; 0 without the attribute, or the element."""
    return float("0" if element is None else element.get(attribute, "0"))


def vector(
    element: ET.Element | None, attribute: str, default: Sequence[float] = (0.0, 0.0, 0.0)
) -> Array:
    """The three numbers of an attribute of a checked URDF, shape (3,).

    Args:
        element: What has the attribute.
        attribute: Its name.
        default: What it is without the attribute, or the element.
    """
    text = None if element is None else element.get(attribute)
    return np.array(default if text is None else [float(part) for part in text.split()])


def check_numbers(element: ET.Element, owner: str, problems: Problems) -> None:
    """Note what is wrong with the numbers of an element.

    Args:
        element: One whose tag is in :data:`NUMBERS`; another one has none.
        owner: The link or joint, for messages, such as ``"link 'arm_3'"``.
        problems: Where to note it.
    """
    for attribute, allowed in NUMBERS.get(str(element.tag), {}).items():
        text = element.get(attribute)
        if text is None:
            if allowed.required:
                problems.add(
                    element, f"{owner}: <{element.tag}> has no {attribute!r}; allowed: {allowed}"
                )
            continue
        values = numbers(text)
        if (
            values is None
            or len(values) != allowed.count
            or not all(allowed.holds(value) for value in values)
        ):
            problems.add(
                element,
                f"{owner}: <{element.tag}> {attribute} is {shown(text)}; allowed: {allowed}"
                + _advice(text),
            )


def shown(text: str) -> str:
    """A text for messages, shortened if it is long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _advice(text: str) -> str:
    if any(_WITH_COMMA.fullmatch(part) for part in text.split()):
        return ", with a decimal point"
    return ""
