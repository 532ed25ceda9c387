"""Spokes on wheels that look the same from every side, so that they can be seen to turn."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mobman.arrays import Array
from mobman.viewer.shapes import Box, Colour, Cylinder, Mesh, Shape, Sphere

_SPOKES = 3
_LIGHT: Colour = (0.95, 0.95, 0.96, 1.0)
_DARK: Colour = (0.12, 0.12, 0.14, 1.0)
_ALIGNED = 1e-3
_PROUD = 0.01
"""How far a spoke stands out of the wheel, of the radius."""


def wheel_marks(
    axis: Array, radius: float, shown: Sequence[tuple[Array, Shape, Colour]]
) -> list[tuple[Array, Box, Colour]]:
    """The spokes for a wheel.

    Args:
        axis: What the wheel turns about, a unit vector in its joint's frame, shape (3,).
        radius: m.
        shown: What is drawn on it: placement in the joint's frame, shape and colour.

    Returns:
        Placement in the joint's frame, shape and colour of each spoke; none where a shape that is
        not round about the axis shows the turning already.
    """
    if not shown or not all(_round(axis, placement, shape) for placement, shape, _ in shown):
        return []
    corners = np.vstack([_corners(placement, shape) for placement, shape, _ in shown])
    low, high = float((corners @ axis).min()), float((corners @ axis).max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    colour = _LIGHT if np.mean([c[:3] for _, _, c in shown]) < 0.5 else _DARK
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    # right through the wheel: it shows on both faces
    box = Box((0.8 * radius, 0.12 * radius, 2.0 * (half + _PROUD * radius)))
    marks = []
    for i in range(_SPOKES):
        angle = 2.0 * math.pi * i / _SPOKES
        along = math.cos(angle) * first + math.sin(angle) * second
        placement = np.eye(4)
        placement[:3, 0], placement[:3, 2] = along, axis
        placement[:3, 1] = np.cross(axis, along)
        placement[:3, 3] = middle * axis + 0.45 * radius * along
        marks.append((placement, box, colour))
    return marks


def _round(axis: Array, placement: Array, shape: Shape) -> bool:
    """Whether a shape looks the same when it turns about the axis, or may do so."""
    centre = placement[:3, 3]
    centred = bool(np.linalg.norm(centre - (centre @ axis) * axis) <= _ALIGNED)
    if isinstance(shape, Sphere):
        return centred
    if isinstance(shape, Cylinder):
        return centred and abs(float(placement[:3, 2] @ axis)) >= 1.0 - _ALIGNED
    return isinstance(shape, Mesh)  # most wheels' meshes are round, in one colour


def _corners(placement: Array, shape: Shape) -> Array:
    if isinstance(shape, Mesh):
        points = shape.vertices
    else:
        low, high = shape.bounds()
        points = np.array(
            [
                [x, y, z]
                for x in (low[0], high[0])
                for y in (low[1], high[1])
                for z in (low[2], high[2])
            ]
        )
    return np.asarray(points @ placement[:3, :3].T + placement[:3, 3])
