"""Coordinates in SVG: whole tenths of a pixel.

A path of them is short, and none is seen to be rounded.
"""

from __future__ import annotations

import math

from mobman.arrays import Array

UNIT = 10.0
"""Of a pixel."""


def units(length: float) -> int:
    """A length or place (px), in units."""
    return round(UNIT * length)


def whole(place: Array | float) -> int:
    """A place in units, rounded; 0 where there is none."""
    found = float(place)
    return round(found) if math.isfinite(found) else 0
