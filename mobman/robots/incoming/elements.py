"""Elements of a URDF that is made of another description: joints, inertias and shapes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from mobman.arrays import Array

_MOMENTS = (
    ("ixx", 0, 0),
    ("ixy", 0, 1),
    ("ixz", 0, 2),
    ("iyy", 1, 1),
    ("iyz", 1, 2),
    ("izz", 2, 2),
)


def add_joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, place: pin.SE3
) -> ET.Element:
    """A new joint with its links, at a place in the parent's frame."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    _origin(joint, place)
    return joint


def add_inertial(link: ET.Element, mass: float, place: pin.SE3, moments: Array) -> None:
    """Give a link its mass (kg), the frame of its centre, and the moments in it (kg m^2), (3, 3)."""
    element = ET.SubElement(link, "inertial")
    _origin(element, place)
    ET.SubElement(element, "mass", value=repr(float(mass)))
    ET.SubElement(element, "inertia", {key: repr(float(moments[i, j])) for key, i, j in _MOMENTS})


def add_dynamics(joint: ET.Element, damping: float, friction: float) -> None:
    """Give a joint damping and friction, if it has some."""
    if max(damping, friction) > 0.0:
        ET.SubElement(joint, "dynamics", damping=repr(damping), friction=repr(friction))


def add_shape(
    link: ET.Element, use: str, kind: str, attributes: Mapping[str, str], place: pin.SE3
) -> None:
    """Give a link a shape; a capsule becomes a cylinder and two spheres."""
    if kind == "capsule":
        half, ball = 0.5 * float(attributes["length"]), {"radius": attributes["radius"]}
        for end in (-half, half):
            add_shape(link, use, "sphere", ball, place * pin.SE3(np.eye(3), np.array([0, 0, end])))
        kind = "cylinder"
    element = ET.SubElement(link, use)
    _origin(element, place)
    ET.SubElement(ET.SubElement(element, "geometry"), kind, dict(attributes))


def text_of(values: Sequence[float] | Array) -> str:
    """Numbers as an attribute."""
    return " ".join(repr(float(value)) for value in values)


def _origin(element: ET.Element, place: pin.SE3) -> None:
    rpy = pin.rpy.matrixToRpy(place.rotation)
    ET.SubElement(element, "origin", xyz=text_of(place.translation), rpy=text_of(rpy))
