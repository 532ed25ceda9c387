"""Markers of points, on curves and in legends."""

from __future__ import annotations

from mobman.benchmark.report.chart import Look, Marker

_OPEN = ("cross", "plus", "star")  # shapes that have no inside to fill


def marker(look: Look, x: int, y: int, shape: Marker | None = None) -> str:
    """A look's marker at a place in units, of another shape if one is given."""
    shape = shape or look.marker
    inside = "" if shape in _OPEN else " h" if look.hollow else " f"
    return f'<path class="{look.key} p{inside}" d="{_outline(shape, x, y)}"/>'


def _outline(shape: Marker, x: int, y: int) -> str:
    """A marker's path, about 9 px wide."""
    if shape == "circle":
        return f"M{x - 40} {y}a40 40 0 1 0 80 0a40 40 0 1 0-80 0"
    if shape == "square":
        return f"M{x - 36} {y - 36}h72v72h-72z"
    if shape == "triangle":
        return f"M{x} {y - 46}l44 78h-88z"
    if shape == "wedge":
        return f"M{x} {y + 46}l44-78h-88z"
    if shape == "diamond":
        return f"M{x} {y - 50}l46 50-46 50-46-50z"
    if shape == "plus":
        return f"M{x - 48} {y}h96M{x} {y - 48}v96"
    if shape == "star":
        return f"M{x - 48} {y}h96M{x - 26} {y - 42}l52 84M{x + 26} {y - 42}l-52 84"
    return f"M{x - 40} {y - 40}l80 80m0-80l-80 80"
