"""What a URDF says of the looks of its links: shapes, places and colours, meshes found or not."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pinocchio as pin

from mobman.model.assembly import Assembly
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.meshes import mesh_paths
from mobman.robots.urdf.shapes import placement
from mobman.viewer.shapes import Box, Capsule, Colour, Cylinder, Sphere

Use = Literal["visual", "collision"]
USES: tuple[Use, Use] = ("visual", "collision")


@dataclass(frozen=True)
class MeshFile:
    """A mesh that a link is to be drawn with."""

    name: str
    """As the URDF has it."""
    path: Path | None
    """The file; None if there is none."""
    problem: str
    """Why there is none."""
    scale: tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """A ``<visual>`` or ``<collision>`` element."""

    link: str
    use: Use
    placement: pin.SE3
    """In the link's frame."""
    shape: Box | Cylinder | Sphere | Capsule | MeshFile
    colour: Colour | None
    """None if the URDF says nothing."""


def looks(robot: MobileManipulator) -> list[Look]:
    """Every shape that a robot's URDFs give its links; those of missing meshes are among them."""
    assembly = Assembly(robot.spec, robot.urdf)
    files = _mesh_files(robot)
    colours = _named_colours(assembly.robot)
    return [
        look
        for link in assembly.robot.findall("link")
        for use in USES
        for element in link.findall(use)
        for look in _look(str(link.get("name")), use, element, colours, files)
    ]


def _mesh_files(robot: MobileManipulator) -> dict[tuple[str, str], tuple[Path | None, str]]:
    """File, or why there is none, by link and name of the mesh."""
    spec = robot.spec
    prefixes = [] if spec.urdf is None else [""]
    prefixes += [mount.prefix for mount in spec.mount]
    return {
        (prefix + mesh.link, mesh.filename): (mesh.path, mesh.problem)
        for prefix, file in zip(prefixes, robot.urdf.files, strict=True)
        for mesh in mesh_paths(file.parse(), file)
    }


def _named_colours(robot: ET.Element) -> dict[str, Colour]:
    """Colours by the name of their material: it may be defined where it is first used."""
    return {
        str(material.get("name")): colour
        for material in robot.iter("material")
        if (colour := _own_colour(material)) is not None
    }


def _look(
    link: str,
    use: Use,
    element: ET.Element,
    colours: dict[str, Colour],
    files: dict[tuple[str, str], tuple[Path | None, str]],
) -> Iterator[Look]:
    geometry = element.find("geometry")
    shape = None if geometry is None else _shape(link, geometry, files)
    if shape is None:
        return
    material = element.find("material")
    colour = None
    if material is not None:
        colour = _own_colour(material) or colours.get(str(material.get("name")))
    yield Look(link, use, pin.SE3(*placement(element)), shape, colour)


def _shape(
    link: str, geometry: ET.Element, files: dict[tuple[str, str], tuple[Path | None, str]]
) -> Box | Cylinder | Sphere | Capsule | MeshFile | None:
    for child in geometry:
        if child.tag == "box":
            x, y, z = _numbers(child, "size", 3)
            return Box((x, y, z))
        if child.tag in ("cylinder", "capsule"):
            (radius,), (length,) = _numbers(child, "radius", 1), _numbers(child, "length", 1)
            return Cylinder(radius, length) if child.tag == "cylinder" else Capsule(radius, length)
        if child.tag == "sphere":
            return Sphere(*_numbers(child, "radius", 1))
        if child.tag == "mesh":
            name = child.get("filename", "").strip()
            path, problem = files.get((link, name), (None, "is not there"))
            x, y, z = _numbers(child, "scale", 3) if child.get("scale") else (1.0, 1.0, 1.0)
            return MeshFile(name, path, problem, (x, y, z))
    return None


def _own_colour(material: ET.Element) -> Colour | None:
    colour = material.find("color")
    if colour is None:
        return None
    r, g, b, a = _numbers(colour, "rgba", 4)
    return (r, g, b, a)


def _numbers(element: ET.Element, name: str, count: int) -> tuple[float, ...]:
    values = tuple(float(word) for word in element.get(name, "").split())
    if (
        len(values) != count
    ):  # a scale may be one number for all axes; the rest was checked on reading
        values = (values[0] if values else 1.0,) * count
    return values
