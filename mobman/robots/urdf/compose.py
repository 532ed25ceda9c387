"""URDFs changed: tidied, put together, and made ready for flat coordinates."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.spec import Mount
from mobman.robots.urdf.validate import NUMBERS, limit_of, numbers, shape_of

BASE_JOINTS = ("base_x", "base_y", "base_theta")
"""The platform's pose: along the world's x and y (m), about its z (rad)."""
TRAVEL_JOINTS = ("travel_direction", "travel_curvature")
"""Coordinates of a swerve platform's travel: direction in its axes (rad), its path's curvature (1/m)."""

_AXES = {"base_x": "1 0 0", "base_y": "0 1 0", "base_theta": "0 0 1"}
_UNBOUNDED = {"lower": "-1e9", "upper": "1e9"}
_UNKNOWN = {"effort": "0", "velocity": "0"}
_PINOCCHIOS = "universe"  # its joint 0
_OWN = "mobman/"  # begins the names of what is added, lest the URDF have them too
LINK = f"{_OWN}link/"
"""Begins the name of a link whose own name a joint has, too: Pinocchio makes frames of both."""
_UPRIGHT = {  # roll, pitch and yaw that turn an axis of the root link up (rad)
    "x": (0.0, -0.5 * math.pi, 0.0),
    "-x": (0.0, 0.5 * math.pi, 0.0),
    "y": (0.5 * math.pi, 0.0, 0.0),
    "-y": (-0.5 * math.pi, 0.0, 0.0),
    "-z": (math.pi, 0.0, 0.0),
}
_WITHOUT_EFFECT = ("transmission", "gazebo")  # and they name joints and links, which get a prefix
_NAMES = {
    "link": "name",
    "joint": "name",
    "joint/parent": "link",
    "joint/child": "link",
    "joint/mimic": "joint",
    ".//material": "name",
}
"""Where names are, and references to them: elements and attributes."""
_UNIT = 1e-12
_NOT_READ = ("safety_controller", "calibration")
_MOTION = ("axis", "limit", "dynamics", "mimic")


def tidy(robot: ET.Element, name: str) -> None:
    """Bring a checked ``<robot>`` element into the form in which every reader takes it the same way.

    Readers of URDFs differ in what they put up with. What is no mistake is written here as the
    strictest of them wants it, and what concerns neither the motion nor the picture is left out:

    - axes become unit vectors, as every reader makes them, and numbers are separated by single spaces;
    - an effort or velocity limit that is not given or infinite is 0, which stands for "not known";
    - a revolute joint with an infinite range is continuous, other infinite limits are huge ones;
    - a fixed joint has no axis, limit, dynamics or mimic, and a continuous one no lower and upper limit;
    - a ``<visual>`` or ``<collision>`` without a shape that URDFs know (``<capsule>``) is left out;
    - colours are in the ``<visual>`` elements that have them, since robots that are put together may
      have two of one name; what is none (four numbers from 0 to 1) or was never defined is left out;
    - the robot has the ``name``, where the file gives none.
    """
    robot.attrib.pop("version", None)
    robot.set("name", robot.get("name") or name)
    colours: dict[str, ET.Element] = {}  # the first of each name
    for material in robot.findall("material"):
        robot.remove(material)
        if (name := material.get("name", "")) and _has_look(material):
            colours.setdefault(name, material)
    for link in robot.findall("link"):
        for use in [*link.findall("visual"), *link.findall("collision")]:
            if shape_of(use) is None:
                link.remove(use)
        for visual in link.findall("visual"):
            if (own := visual.find("material")) is not None:
                name = own.get("name", "")
                if name in colours:
                    own[:] = copy.deepcopy(list(colours[name]))
                if _has_look(own):
                    own.set("name", name)
                else:
                    visual.remove(own)
    for joint in robot.findall("joint"):
        _tidy_joint(joint)
    for part in (p for tag in ("link", "joint") for e in robot.findall(tag) for p in e.iter()):
        for attribute in NUMBERS.get(part.tag, {}).keys() & part.attrib.keys():
            part.set(attribute, " ".join(part.attrib[attribute].split()))


def _tidy_joint(joint: ET.Element) -> None:
    kind = joint.get("type")
    for tag in (*_NOT_READ, *(_MOTION if kind == "fixed" else ())):
        for element in joint.findall(tag):
            joint.remove(element)
    limit, dynamics, axis = joint.find("limit"), joint.find("dynamics"), joint.find("axis")
    if limit is not None:
        limit.attrib.update(_UNKNOWN | limit.attrib)
        given = {key: limit_of(key, limit.get(key, "")) or 0.0 for key in NUMBERS["limit"]}
        infinite = {key for key, value in given.items() if math.isinf(value)}
        limit.attrib.update({key: {**_UNKNOWN, **_UNBOUNDED}[key] for key in infinite})
        if kind == "revolute" and infinite >= _UNBOUNDED.keys():
            kind = "continuous"
            joint.set("type", kind)
        if kind == "continuous":
            for attribute in _UNBOUNDED:
                limit.attrib.pop(attribute, None)
    if dynamics is not None and not {"damping", "friction"} & set(dynamics.attrib):
        joint.remove(dynamics)
    if axis is not None:
        xyz = numbers(axis.get("xyz", "1 0 0")) or []
        if abs(math.hypot(*xyz) - 1.0) > _UNIT:
            # by the largest first: the squares of tiny or huge numbers are 0 or infinite
            scaled = [value / max(map(abs, xyz)) for value in xyz]
            axis.set("xyz", text_of([value / math.hypot(*scaled) for value in scaled]))


def _has_look(material: ET.Element) -> bool:
    """True if it has a colour or a texture; a colour that is none is removed."""
    colour, texture = material.find("color"), material.find("texture")
    if colour is not None:
        rgba = numbers(colour.get("rgba", "")) or []
        if len(rgba) == 4 and all(0.0 <= value <= 1.0 for value in rgba):
            return True
        material.remove(colour)
    return texture is not None and bool(texture.get("filename"))


def turn_up(robot: ET.Element, axis: str, where: str) -> None:
    """Put a link in front of the root link whose z axis is one of the root's, which points up; SpecError
    if it has not exactly one root link."""
    if axis in _UPRIGHT:
        root, upright = root_link(robot, where), f"{_OWN}upright"
        ET.SubElement(robot, "link", name=upright)
        add_joint(robot, upright, "fixed", upright, root, (0, 0, 0), _UPRIGHT[axis])


class Mounted(NamedTuple):
    """A URDF and how it is mounted."""

    robot: ET.Element  # its ``<robot>`` element; it is changed by :func:`compose`
    mount: Mount
    where: str  # the description and the field, for messages


def compose(platform: ET.Element, mounted: Sequence[Mounted]) -> ET.Element:
    """One tree: a platform's ``<robot>`` element, to which what is mounted is added, in this order;
    SpecError if a parent link is not there, or two links or joints have one name."""
    for robot, mount, where in mounted:
        for path, attribute in _NAMES.items():
            for element in robot.findall(path):
                if (name := element.get(attribute)) is not None:
                    element.set(attribute, mount.prefix + name)
        for kind in ("link", "joint"):
            there = {element.get("name") for element in platform.findall(kind)}
            added = {element.get("name") for element in robot.findall(kind)}
            if both := sorted(str(name) for name in there & added):
                raise SpecError(
                    f"{where}.prefix' is {mount.prefix!r}, and then the {kind}s "
                    f"{', '.join(both[:5])} are there twice; choose another prefix"
                )
        links = [link.get("name", "") for link in platform.findall("link")]
        if mount.parent not in links:
            raise SpecError(
                f"{where}.parent' is {mount.parent!r}, which is not a link of the platform; its "
                f"links: {', '.join(links)}"
            )
        root = root_link(robot, where)
        add_joint(platform, f"mount/{root}", "fixed", mount.parent, root, mount.xyz, mount.rpy)
        platform.extend([element for element in robot if element.tag not in _WITHOUT_EFFECT])
    return platform


def flat_urdf(
    robot: ET.Element,
    where: str,
    offset: Array | Sequence[float] = (0.0, 0.0, 0.0),
    heading: float = 0.0,
    base_joints: Sequence[str] = BASE_JOINTS,
    virtual_joints: Sequence[str] = (),
) -> str:
    """A URDF with planar base joints in front of its root, and without two-slot joints.

    A ``continuous`` joint becomes ``revolute`` with wide limits, since Pinocchio gives it two
    configuration slots (cos, sin) otherwise. Links with the name of a joint get :data:`LINK` in front.

    Args:
        robot: The checked ``<robot>`` element; it is changed.
        where: What to call it in messages.
        offset: Position of the root link's frame in the platform's frame (m): the platform's
            reference point on the ground is the frame's origin.
        heading: Direction of the platform's x axis in the root link's frame, about z (rad).
        base_joints: Joints of the base: :data:`BASE_JOINTS`, or none for a base that is fixed.
        virtual_joints: Coordinates that no joint has: each becomes one about the root link's z axis that
            carries a link without mass.

    SpecError if it has not exactly one root link, or a joint has a name that is kept.
    """
    for joint in robot.findall("joint"):
        name = joint.get("name")
        if name in (*BASE_JOINTS, *virtual_joints):
            raise SpecError(f"{where}: joint {name!r}: this name is kept for the platform's pose")
        if name == _PINOCCHIOS:
            raise SpecError(f"{where}: joint {name!r}: this name is kept by Pinocchio; rename it")
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", _UNKNOWN)
            limit.attrib.update(_UNBOUNDED)
    root, parent = root_link(robot, where), f"{_OWN}world"
    ET.SubElement(robot, "link", name=parent)
    for name in (*base_joints, *virtual_joints):
        child = f"{_OWN}{name}"
        ET.SubElement(robot, "link", name=child)
        kind = "prismatic" if name in BASE_JOINTS[:2] else "revolute"
        joint = add_joint(robot, name, kind, parent if name in base_joints else root, child)
        ET.SubElement(joint, "axis", xyz=_AXES.get(name, "0 0 1"))
        ET.SubElement(joint, "limit", _UNBOUNDED | _UNKNOWN)
        parent = child if name in base_joints else parent
    turned = (0.0, 0.0, -math.remainder(float(heading), math.tau))
    add_joint(robot, f"{_OWN}root", "fixed", parent, root, offset, turned)
    joints = {joint.get("name") for joint in robot.findall("joint")} | {_PINOCCHIOS}
    for path, attribute in (("link", "name"), ("joint/parent", "link"), ("joint/child", "link")):
        for element in robot.findall(path):
            if element.get(attribute) in joints:
                element.set(attribute, f"{LINK}{element.get(attribute)}")
    return ET.tostring(robot, encoding="unicode")


def frame_of(model: pin.Model, link: str) -> int:
    """The index of a link's frame in a model of :func:`flat_urdf`."""
    own = model.existFrame(link, pin.FrameType.BODY)
    return int(model.getFrameId(link if own else LINK + link, pin.FrameType.BODY))


def root_link(robot: ET.Element, where: str) -> str:
    """The name of the link that is no joint's child; SpecError if there is none, or several."""
    children = {child.get("link") for child in robot.findall("joint/child")}
    names = [link.get("name", "") for link in robot.findall("link")]
    roots = [name for name in names if name not in children]
    if len(roots) != 1:
        raise SpecError(f"{where}: {len(roots)} root links ({', '.join(roots)}); allowed: one")
    return roots[0]


# Elements ----------------------------------------------------------------------------------------------


def add_joint(
    robot: ET.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Sequence[float] | Array | None = None,
    rpy: Sequence[float] | Array = (0.0, 0.0, 0.0),
) -> ET.Element:
    """A new joint between two links; with ``xyz`` (m) it has an origin in the parent's frame."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    if xyz is not None:
        ET.SubElement(joint, "origin", xyz=text_of(xyz), rpy=text_of(rpy))
    return joint


def place_joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, place: pin.SE3
) -> ET.Element:
    """A new joint between two links, at a place in the parent's frame."""
    rpy = pin.rpy.matrixToRpy(place.rotation)
    return add_joint(robot, name, kind, parent, child, place.translation, rpy)


def add_inertial(link: ET.Element, mass: float, place: pin.SE3, moments: Array) -> None:
    """Give a link its mass (kg), the frame of its centre, and the moments in it (kg m^2), (3, 3)."""
    element = ET.SubElement(link, "inertial")
    _add_origin(element, place)
    ET.SubElement(element, "mass", value=repr(float(mass)))
    pairs = combinations_with_replacement(range(3), 2)
    values = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(moments[i, j])) for i, j in pairs}
    ET.SubElement(element, "inertia", values)


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
    _add_origin(element, place)
    ET.SubElement(ET.SubElement(element, "geometry"), kind, dict(attributes))


def _add_origin(element: ET.Element, place: pin.SE3) -> None:
    rpy = text_of(pin.rpy.matrixToRpy(place.rotation))
    ET.SubElement(element, "origin", xyz=text_of(place.translation), rpy=rpy)


def text_of(values: Sequence[float] | Array) -> str:
    """Numbers as an attribute."""
    return " ".join(repr(float(value)) for value in values)
