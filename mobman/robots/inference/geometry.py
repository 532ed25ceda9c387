"""The geometry of links in the root's frame, all joints at zero."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from mobman.arrays import Array
from mobman.robots.inference.tree import Tree
from mobman.robots.urdf.meshes import MeshReader, mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import Shape, Use, read_shapes


class Geometry:
    """The shapes of a URDF's links; manufacturers' URDFs often come without their meshes.

    Args:
        robot: The ``<robot>`` element.
        urdf: Its file.
        tree: Where its links are.
    """

    def __init__(self, robot: ET.Element, urdf: UrdfFile, tree: Tree) -> None:
        self._tree = tree
        self._paths = {mesh.filename: mesh.path for mesh in mesh_paths(robot, urdf)}
        self._meshes = MeshReader()
        self._shapes: dict[tuple[str, Use], list[Shape]] = {}

    def lacks(self, filename: str) -> bool:
        """Whether the mesh that the URDF names so is missing."""
        return self._paths.get(filename) is None

    def shapes(self, link: str, use: Use) -> list[Shape]:
        """The shapes of a link in the root's frame; those of missing or unreadable meshes as well."""
        if (link, use) not in self._shapes:
            rotation, position = self._tree.rotation[link], self._tree.position[link]
            self._shapes[link, use] = [
                shape.placed(rotation, position)
                for shape in read_shapes(self._tree.links[link], use, self._vertices)
            ]
        return self._shapes[link, use]

    def _vertices(self, filename: str) -> Array | None:
        path = self._paths.get(filename)
        return None if path is None else self._meshes.vertices(path)
