"""A wheel's radius from the geometry of its link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.tree import Joint, Tree
from mobman.robots.urdf.shapes import Shape, Use, extents

_ALONG = math.cos(math.radians(5.0))
_OFF_AXIS = 0.3  # of the radius: how far a wheel's shape may be off its axis
_ROUND = 0.93  # smallest over largest extent of what is round
_DIRECTIONS = 72  # in which a shape's extent is looked for


@dataclass(frozen=True)
class Radius:
    """A radius, and what says so.

    Attributes:
        value: m.
        why: What it was read from.
    """

    value: float
    why: str


def wheel_radius(tree: Tree, joint: Joint, use: Use, geometry: Geometry) -> Radius | None:
    """The radius that the collision or the visual geometry behind a joint has about its axis.

    None if there is none, or if some of its meshes are missing: what is left may be the hub only.
    """
    shapes = [
        (link, shape) for link in _turning(tree, joint) for shape in geometry.shapes(link, use)
    ]
    complete = all(shape.known for _, shape in shapes)
    plain = [(link, shape) for link, shape in shapes if shape.kind != "mesh"]
    meshes = [(link, shape) for link, shape in shapes if shape.kind == "mesh"]
    found = [
        Radius(value, f"{use} {shape.kind} of {link}")
        for link, shape in (*plain, *(meshes if complete else []))
        if (value := radius_about(shape, joint.centre, joint.axis)) is not None
    ]
    if any(tree.behind(joint)) and shapes and complete:  # rollers: round together only
        value = extent_about([shape for _, shape in shapes], joint.centre, joint.axis)
        if value is not None:
            found.append(Radius(value, f"{use} geometry of {joint.child} and its rollers"))
    return max(found, key=lambda radius: radius.value, default=None)


def mesh_names(tree: Tree, joint: Joint) -> list[str]:
    """The files that the meshes of what turns about a joint have."""
    return [
        mesh.get("filename", "").strip()
        for link in _turning(tree, joint)
        for mesh in tree.links[link].iter("mesh")
    ]


def _turning(tree: Tree, joint: Joint) -> list[str]:
    """What turns with a wheel: its link, what is fixed to it, and rollers."""
    links = tree.rigid(joint.child)
    for roller in tree.behind(joint):
        links += tree.rigid(roller.child)
    return links


def radius_about(shape: Shape, centre: Array, axis: Array) -> float | None:
    """The radius of a shape about an axis (m), if it is round about it; None if it is not.

    Args:
        shape: In any frame; not of a mesh that could not be read.
        centre: A point of the axis there (m), shape (3,).
        axis: Its direction there, a unit vector, shape (3,).
    """
    if shape.kind == "mesh":
        return extent_about([shape], centre, axis)
    off = shape.centre - centre
    off = off - (off @ axis) * axis
    aligned = shape.axis is None or abs(shape.axis @ axis) > _ALONG
    # a box has no radius, and nothing is less off than that
    central = float(np.linalg.norm(off)) < _OFF_AXIS * shape.radius
    return shape.radius if aligned and central else None


def extent_about(shapes: Sequence[Shape], centre: Array, axis: Array) -> float | None:
    """How far shapes reach together from an axis (m), if that is the same all around; else None.

    Arguments as for :func:`radius_about`.
    """
    support = extents(shapes, centre, axis, _DIRECTIONS)
    largest = float(support.max())
    return largest if largest > 0.0 and support.min() > _ROUND * largest else None
