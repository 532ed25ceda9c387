"""The links of a URDF as they are written there, before fixed joints merge them into bodies."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from mobman.arrays import Array
from mobman.robots.urdf.shapes import USES, Shape, Use, placement, read_shapes, scalar


@dataclass(frozen=True)
class Link:
    """A link.

    Attributes:
        name: With the prefix of its mount.
        mass: kg; None without an ``<inertial>`` element.
        com: Centre of mass in the link's frame (m), shape (3,).
        moments: Principal moments of inertia, ascending (kg m^2), shape (3,).
        shapes: What could be read of its geometry.
        incomplete: The uses of which a mesh is missing or could not be read.
    """

    name: str
    mass: float | None
    com: Array
    moments: Array
    shapes: tuple[Shape, ...]
    incomplete: frozenset[Use]

    @property
    def solid(self) -> list[Shape]:
        """The collision geometry, or the visual one where there is none."""
        collision = [shape for shape in self.shapes if shape.use == "collision"]
        return collision or list(self.shapes)


Vertices = Callable[[str, str], Array | None]
"""(link, file name) to the vertices of a mesh (n, 3), or None if it cannot be read."""


def read_links(robot: ET.Element, vertices: Vertices) -> dict[str, Link]:
    """The links of a ``<robot>`` element by name.

    Args:
        robot: The element.
        vertices: Reads meshes.
    """
    links = [_link(element, vertices) for element in robot.findall("link")]
    return {link.name: link for link in links}


def _link(element: ET.Element, vertices: Vertices) -> Link:
    name = str(element.get("name"))
    mass, com, moments = _inertial(element.find("inertial"))
    shapes = [s for use in USES for s in read_shapes(element, use, partial(vertices, name))]
    return Link(
        name,
        mass,
        com,
        moments,
        tuple(shape for shape in shapes if shape.known),
        frozenset(shape.use for shape in shapes if not shape.known),
    )


def _inertial(inertial: ET.Element | None) -> tuple[float | None, Array, Array]:
    if inertial is None:
        return None, np.zeros(3), np.zeros(3)
    _, com = placement(inertial)
    inertia = inertial.find("inertia")
    xx, yy, zz, xy, xz, yz = (
        scalar(inertia, key) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return scalar(inertial.find("mass"), "value"), com, np.linalg.eigvalsh(matrix)
