"""The shapes that a scene is drawn with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array, Index
from mobman.viewer.encoding import packed, packed_indices

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""


_HOLES = 0.01
"""Share of a closed mesh's edges that may have a triangle on one side only."""


@dataclass(frozen=True)
class Box:
    """A box about its origin."""

    size: tuple[float, float, float]
    """m."""

    def described(self) -> dict[str, Any]:
        """For the page."""
        return {"type": "box", "size": list(self.size)}

    def bounds(self) -> Array:
        """Lowest and highest corner (m), shape (2, 3)."""
        half = 0.5 * np.array(self.size)
        return np.array([-half, half])


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about its origin, along z."""

    radius: float
    """m."""
    length: float
    """m."""

    def described(self) -> dict[str, Any]:
        """For the page."""
        return {"type": "cylinder", "radius": self.radius, "length": self.length}

    def bounds(self) -> Array:
        """Lowest and highest corner (m), shape (2, 3)."""
        corner = np.array([self.radius, self.radius, 0.5 * self.length])
        return np.array([-corner, corner])


@dataclass(frozen=True)
class Sphere:
    """A sphere about its origin."""

    radius: float
    """m."""

    def described(self) -> dict[str, Any]:
        """For the page."""
        return {"type": "sphere", "radius": self.radius}

    def bounds(self) -> Array:
        """Lowest and highest corner (m), shape (2, 3)."""
        return np.array([[-self.radius] * 3, [self.radius] * 3])


@dataclass(frozen=True)
class Capsule:
    """A cylinder with half a sphere at either end, about its origin, along z."""

    radius: float
    """m."""
    length: float
    """Of the cylinder (m)."""

    def described(self) -> dict[str, Any]:
        """For the page."""
        return {"type": "capsule", "radius": self.radius, "length": self.length}

    def bounds(self) -> Array:
        """Lowest and highest corner (m), shape (2, 3)."""
        corner = np.array([self.radius, self.radius, 0.5 * self.length + self.radius])
        return np.array([-corner, corner])


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, in one colour, in a colour a vertex, or with a picture on them."""

    vertices: Array
    """m, shape (V, 3)."""
    faces: Index
    """Vertices of each triangle, anticlockwise from outside, shape (F, 3)."""
    colour: Colour | None = None
    """The mesh's own colour; None if its file says nothing."""
    vertex_colours: NDArray[np.uint8] | None = None
    """0 to 255, shape (V, 3)."""
    uv: Array | None = None
    """Where each vertex is on the picture, 0 to 1, shape (V, 2)."""
    texture: str | None = None
    """The picture, as a data: address."""

    def described(self) -> dict[str, Any]:
        """For the page."""
        content: dict[str, Any] = {
            "type": "mesh",
            "vertices": packed(self.vertices, "f4"),
            "faces": packed_indices(self.faces),
            "open": self.is_open(),
        }
        if self.vertex_colours is not None:
            content["vertex_colours"] = packed(self.vertex_colours, "u1")
        if self.uv is not None and self.texture is not None:
            content |= {"uv": packed(self.uv, "f4"), "texture": self.texture}
        return content

    def is_open(self) -> bool:
        """Whether its inside can be seen: through holes, or because triangles are the wrong way round.

        What is closed is drawn from outside alone, in half the time.
        """
        edges = self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
        count = len(self.vertices)
        there = edges[:, 0] * count + edges[:, 1]
        back = edges[:, 1] * count + edges[:, 0]
        alone = float(np.mean(~np.isin(there, back)))
        a, b, c = (self.vertices[self.faces[:, i]] - self.vertices.mean(axis=0) for i in range(3))
        volume = float(np.sum(a * np.cross(b, c)))
        return alone > _HOLES or volume <= 0.0

    def bounds(self) -> Array:
        """Lowest and highest corner (m), shape (2, 3)."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])


Shape = Box | Cylinder | Sphere | Capsule | Mesh
