"""A URDF made ready for flat coordinates: 1-dof base joints in front, no two-slot joints."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from mobman.arrays import Array
from mobman.errors import SpecError

BASE_JOINTS = ("base_x", "base_y", "base_theta")
"""The platform's pose: along the world's x and y (m), about its z (rad)."""

_AXES = {"base_x": "1 0 0", "base_y": "0 1 0", "base_theta": "0 0 1"}
_UNBOUNDED = "1e9"
_PINOCCHIOS = "universe"  # its joint 0
_OWN = "mobman/"  # begins the names of what is added, lest the URDF have them too
LINK = f"{_OWN}link/"
"""Begins the name of a link whose own name a joint has, too: Pinocchio makes frames of both."""
_ALLOWED = ("fixed", "revolute", "prismatic", "continuous")


def flat_urdf(
    robot: ET.Element,
    where: str,
    offset: Array | Sequence[float] = (0.0, 0.0, 0.0),
    heading: float = 0.0,
    base_joints: Sequence[str] = BASE_JOINTS,
) -> str:
    """A URDF with planar base joints in front of its root, and without two-slot joints.

    A ``continuous`` joint becomes ``revolute`` with wide limits, since Pinocchio gives it two
    configuration slots (cos, sin) otherwise; ``floating`` and ``planar`` joints are refused. Links with
    the name of a joint get :data:`LINK` in front.

    Args:
        robot: The ``<robot>`` element; it is changed.
        where: What to call it in messages.
        offset: Position of the root link's frame in the platform's frame (m): the platform's
            reference point on the ground is the frame's origin.
        heading: Direction of the platform's x axis in the root link's frame, about z (rad).
        base_joints: Joints of the base: :data:`BASE_JOINTS`, or none for a base that is fixed.

    Raises:
        SpecError: If it has not exactly one root link, or a joint of a type that is not allowed.
    """
    for joint in robot.findall("joint"):
        kind = joint.get("type")
        name = joint.get("name")
        if name in BASE_JOINTS:
            raise SpecError(f"{where}: joint {name!r}: this name is kept for the platform's pose")
        if name == _PINOCCHIOS:
            raise SpecError(f"{where}: joint {name!r}: this name is kept by Pinocchio; rename it")
        if kind not in _ALLOWED:
            raise SpecError(f"{where}: joint {name!r} is {kind!r}; allowed: {', '.join(_ALLOWED)}")
        if kind == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", "-" + _UNBOUNDED)
            limit.set("upper", _UNBOUNDED)
    root = root_link(robot, where)
    parent = f"{_OWN}world"
    ET.SubElement(robot, "link", name=parent)
    for name in base_joints:
        kind = "revolute" if name == "base_theta" else "prismatic"
        child = f"{_OWN}{name}"
        ET.SubElement(robot, "link", name=child)
        joint = ET.SubElement(robot, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        ET.SubElement(joint, "axis", xyz=_AXES[name])
        ET.SubElement(
            joint, "limit", lower="-" + _UNBOUNDED, upper=_UNBOUNDED, effort="0", velocity="0"
        )
        parent = child
    mount = ET.SubElement(robot, "joint", name=f"{_OWN}root", type="fixed")
    ET.SubElement(mount, "parent", link=parent)
    ET.SubElement(mount, "child", link=root)
    ET.SubElement(
        mount,
        "origin",
        xyz=" ".join(repr(float(value)) for value in np.asarray(offset)),
        rpy=f"0 0 {-math.remainder(float(heading), math.tau)!r}",
    )
    _rename_links(robot)
    return ET.tostring(robot, encoding="unicode")


def _rename_links(robot: ET.Element) -> None:
    taken = {joint.get("name") for joint in robot.findall("joint")} | {_PINOCCHIOS}
    for path, attribute in (("link", "name"), ("joint/parent", "link"), ("joint/child", "link")):
        for element in robot.findall(path):
            if element.get(attribute) in taken:
                element.set(attribute, f"{LINK}{element.get(attribute)}")


def root_link(robot: ET.Element, where: str) -> str:
    """The name of the link that is no joint's child.

    Raises:
        SpecError: If there is none, or there are several.
    """
    children = set()
    for joint in robot.findall("joint"):
        child = joint.find("child")
        if child is None:
            raise SpecError(f"{where}: joint {joint.get('name')!r} has no <child>")
        children.add(child.get("link"))
    names = [link.get("name", "") for link in robot.findall("link")]
    roots = [name for name in names if name not in children]
    if len(roots) != 1:
        raise SpecError(f"{where}: {len(roots)} root links ({', '.join(roots)}); allowed: one")
    return roots[0]
