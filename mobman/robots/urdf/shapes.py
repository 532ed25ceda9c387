"""Numbers and placements in a checked URDF, the geometry of its links, and how far that reaches."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.robots.urdf.validate import shape_of

Use = Literal["collision", "visual"]

USES: tuple[Use, ...] = ("collision", "visual")
"""In the order in which they are believed: visual meshes may have hubs, covers and decoration."""

_ALONG = math.cos(math.radians(5.0))
_OFF_AXIS = 0.3  # of the radius: how far a wheel's shape may be off its axis
_ROUND = 0.93  # smallest over largest extent of what is round
_DIRECTIONS = 72  # in which a shape's extent is looked for

Vertices = Callable[[ET.Element], Array | None]
"""From a ``<mesh>`` to its vertices in its own unit, shape (n, 3); None if it is missing or cannot be
read."""


def scalar(element: ET.Element | None, attribute: str, default: float = 0.0) -> float:
    """The number of an attribute; the default without the attribute, or the element."""
    return default if element is None else float(element.get(attribute, default))


def vector(
    element: ET.Element | None, attribute: str, default: Sequence[float] = (0.0, 0.0, 0.0)
) -> Array:
    """The three numbers of an attribute, shape (3,); the default without it, or the element."""
    text = None if element is None else element.get(attribute)
    return np.array(default if text is None else [float(part) for part in text.split()])


def placement(part: ET.Element) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (m), shape (3,), of what may have an ``<origin>``."""
    origin = part.find("origin")
    return np.array(pin.rpy.rpyToMatrix(vector(origin, "rpy"))), vector(origin, "xyz")


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape of a link: some points, each with a ball or (for cylinders) a disc about it."""

    use: Use
    kind: str  # the URDF's element: "box", "cylinder", "sphere", "mesh"
    points: Array  # in the link's frame (m), shape (n, 3); none of a mesh that could not be read
    radius: float = 0.0  # of the balls or discs (m); 0 for none
    axis: Array | None = None
    """Of the discs, a unit vector in the link's frame, shape (3,); None for balls."""

    @property
    def known(self) -> bool:
        """True if it could be read."""
        return len(self.points) > 0

    @property
    def centre(self) -> Array:
        """The mean of its points: of a box, a cylinder and a sphere the centre (m), shape (3,)."""
        return np.array(self.points.mean(axis=0))

    def reach(self, direction: Array) -> float:
        """The largest <direction, point> over the shape, for a direction in the link's frame (m)."""
        across = direction
        if self.axis is not None:
            across = direction - float(self.axis @ direction) * self.axis
        return float(np.max(self.points @ direction)) + self.radius * float(np.linalg.norm(across))

    def placed(self, rotation: Array, position: Array) -> Shape:
        """The shape in another frame, in which the link's has this rotation and position (m)."""
        axis = None if self.axis is None else rotation @ self.axis
        return replace(self, points=self.points @ rotation.T + position, axis=axis)


def read_shapes(link: ET.Element, use: Use, vertices: Vertices) -> list[Shape]:
    """The shapes of a checked ``<link>``, in the file's order, those of missing meshes included."""
    parts = [(part, shape_of(part)) for part in link.findall(use)]
    return [
        _shape(one, use, vertices).placed(*placement(part))
        for part, one in parts
        if one is not None
    ]


def _shape(element: ET.Element, use: Use, vertices: Vertices) -> Shape:
    """A shape in its own frame."""
    axis: Array | None = None
    if element.tag == "mesh":
        own = vertices(element)
        scale = vector(element, "scale", (1.0, 1.0, 1.0))
        points = np.zeros((0, 3)) if own is None else own * scale
    elif element.tag == "box":
        points = np.array(list(product((-0.5, 0.5), repeat=3))) * vector(element, "size")
    elif element.tag == "cylinder":
        half, axis = 0.5 * scalar(element, "length"), np.array([0.0, 0.0, 1.0])
        points = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
    else:
        points = np.zeros((1, 3))
    return Shape(use, element.tag, points, scalar(element, "radius"), axis)


def bounds(shapes: Sequence[Shape]) -> tuple[Array, Array]:
    """Lower and upper corner of the box around some shapes, in their frame's axes (m), shapes (3,)."""
    reach = [max(shape.reach(axis) for shape in shapes) for axis in (*np.eye(3), *-np.eye(3))]
    return -np.array(reach[3:]), np.array(reach[:3])


def extents(shapes: Sequence[Shape], point: Array, axis: Array, count: int) -> Array:
    """Reach of some shapes from an axis, in directions all around it (m), shape (count,).

    The axis is a unit vector through ``point`` (m) in the shapes' frame, shape (3,) each.
    """
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angles = 2.0 * np.pi * np.arange(count) / count
    directions = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second)
    return np.array([max(shape.reach(d) for shape in shapes) - point @ d for d in directions])


def radius_about(shape: Shape, centre: Array, axis: Array) -> float | None:
    """The radius of a known shape about an axis as of :func:`extents` (m); None if it is not round."""
    if shape.kind == "mesh":
        return extent_about([shape], centre, axis)
    off = shape.centre - centre
    aligned = shape.axis is None or abs(shape.axis @ axis) > _ALONG
    # a box has no radius, and nothing is less off than that
    central = float(np.linalg.norm(off - (off @ axis) * axis)) < _OFF_AXIS * shape.radius
    return shape.radius if aligned and central else None


def extent_about(shapes: Sequence[Shape], centre: Array, axis: Array) -> float | None:
    """The common reach of shapes from an axis (m), if it is the same all around; else None."""
    support = extents(shapes, centre, axis, _DIRECTIONS)
    largest = float(support.max())
    return largest if largest > 0.0 and support.min() > _ROUND * largest else None
