"""A platform described by its numbers: a box on wheels, as a URDF."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from pydantic import Field, PositiveFloat

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.toml_model import Strict

BASE_LINK, DECK = "platform", "deck"
_GREY, _DARK = "0.55 0.58 0.62 1", "0.15 0.15 0.16 1"


class Body(Strict):
    """The fields of ``[platform.body]``; a type may add its own."""

    mass: float = Field(gt=0)
    """Mass of everything but the wheels (kg)."""
    size: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    """Length, width and height of the body, a box (m)."""
    ground_clearance: float = Field(0.0, ge=0)
    """Height of the box's underside (m)."""
    centre: tuple[float, float] = (0.0, 0.0)
    """Place of the box's centre, ahead and to the left of ``platform`` (m)."""
    centre_of_mass: tuple[float, float, float] | None = None
    """From ``platform`` (m); by default the box's centre."""
    inertia: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    """Principal inertias about x, y, z through the centre of mass (kg m^2); by default the
    homogeneous box's."""


class WheeledBody(Body):
    """The same with wheels, all alike."""

    wheel_mass: float = Field(gt=0)
    """Mass of one wheel (kg); a homogeneous cylinder."""
    wheel_width: float = Field(gt=0)
    """m."""
    wheel_velocity: float = Field(0.0, ge=0)
    """Largest rate of a wheel (rad/s); 0: not known."""
    wheel_effort: float = Field(0.0, ge=0)
    """Largest torque on a wheel (N m); 0: not known."""


B = TypeVar("B", bound=Body)
T = TypeVar("T")


@dataclass(frozen=True)
class WheelPart:
    """A wheel to be put into the URDF.

    Attributes:
        joint: Name of its joint; its link is called ``<joint>_link``.
        xyz: Its centre in the parent's frame (m).
        radius: m.
        yaw: Direction of its axis, about z from the parent's y axis (rad).
        parent: Link that carries it.
    """

    joint: str
    xyz: tuple[float, float, float]
    radius: float
    yaw: float = 0.0
    parent: str = BASE_LINK


@dataclass(frozen=True)
class Knuckle:
    """A steering joint about the vertical.

    Attributes:
        joint: Name of its joint; its link is called ``<joint>_link``.
        xyz: Its position from ``platform`` (m).
        limit: Largest angle (rad); infinite: it turns without end.
        velocity: Largest rate (rad/s); 0: not known.
        mass: kg.
        radius: Of the wheel that it carries, for its size (m).
        effort: Largest torque (N m); 0: not known.
    """

    joint: str
    xyz: tuple[float, float, float]
    limit: float
    velocity: float
    mass: float
    radius: float
    effort: float = 0.0


def required(origin: str, field: str, value: T | None, why: str = "") -> T:
    """A field of ``[platform]`` that a platform described by its numbers needs.

    Raises:
        SpecError: If it is missing.
    """
    if value is None or value == []:
        reason = why or "[platform.body] has no URDF to read it from"
        raise SpecError(f"{origin}: field 'platform.{field}' is missing: {reason}")
    return value


def required_body(origin: str, body: B | None) -> B:
    """
    Raises:
        SpecError: If there is no ``[platform.body]``.
    """
    if body is None:
        raise SpecError(
            f"{origin}: field 'urdf' is missing, and so is 'platform.body': describe the platform by "
            "a URDF or by its numbers"
        )
    return body


def body_urdf(
    body: Body, wheels: Sequence[WheelPart] = (), knuckles: Sequence[Knuckle] = ()
) -> ET.Element:
    """The ``<robot>`` element of a box on wheels, with the links ``platform`` and ``deck``."""
    robot = ET.Element("robot", name="platform")
    height = body.size[2]
    middle = (*body.centre, body.ground_clearance + 0.5 * height)
    com = middle if body.centre_of_mass is None else body.centre_of_mass
    inertia = body.inertia or tuple(box_inertia(body.mass, body.size))
    base = _link(robot, BASE_LINK, body.mass, inertia, com)
    _shape(base, "box", {"size": _text(body.size)}, middle, (0.0, 0.0, 0.0), _GREY)
    ET.SubElement(robot, "link", name=DECK)
    top = (*body.centre, body.ground_clearance + height)
    _joint(robot, "deck_joint", "fixed", BASE_LINK, DECK, top, 0.0)
    for knuckle in knuckles:
        _add_knuckle(robot, knuckle)
    for wheel in wheels:
        if isinstance(body, WheeledBody):
            _add_wheel(robot, body, wheel)
    return robot


def box_inertia(mass: float, size: tuple[float, float, float]) -> Array:
    """Principal inertias of a homogeneous box (kg m^2), shape (3,)."""
    x, y, z = np.square(size)
    return mass / 12.0 * np.array([y + z, x + z, x + y])


def _add_wheel(robot: ET.Element, body: WheeledBody, wheel: WheelPart) -> None:
    name, m, w, r = f"{wheel.joint}_link", body.wheel_mass, body.wheel_width, wheel.radius
    across = m / 12.0 * (3.0 * r**2 + w**2)
    link = _link(robot, name, m, (across, 0.5 * m * r**2, across), (0.0, 0.0, 0.0))
    cylinder = {"radius": repr(r), "length": repr(w)}
    upright = (0.5 * math.pi, 0.0, 0.0)
    _shape(link, "cylinder", cylinder, (0.0, 0.0, 0.0), upright, _DARK)
    # a spoke, so that the wheel can be seen to turn
    spoke = {"size": _text((1.6 * r, 1.02 * w, 0.2 * r))}
    _shape(link, "box", spoke, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _GREY, visual_only=True)
    joint = _joint(robot, wheel.joint, "continuous", wheel.parent, name, wheel.xyz, wheel.yaw)
    ET.SubElement(joint, "axis", xyz="0 1 0")
    limits = {"effort": repr(body.wheel_effort), "velocity": repr(body.wheel_velocity)}
    ET.SubElement(joint, "limit", limits)


def _add_knuckle(robot: ET.Element, knuckle: Knuckle) -> None:
    name = f"{knuckle.joint}_link"
    size = (0.4 * knuckle.radius, 0.4 * knuckle.radius, knuckle.radius)
    inertia = tuple(box_inertia(knuckle.mass, size))
    link = _link(robot, name, knuckle.mass, inertia, (0.0, 0.0, 0.0))
    _shape(link, "box", {"size": _text(size)}, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _GREY)
    endless = math.isinf(knuckle.limit)
    kind = "continuous" if endless else "revolute"
    joint = _joint(robot, knuckle.joint, kind, BASE_LINK, name, knuckle.xyz, 0.0)
    ET.SubElement(joint, "axis", xyz="0 0 1")
    bounds = {} if endless else {"lower": repr(-knuckle.limit), "upper": repr(knuckle.limit)}
    motor = {"effort": repr(knuckle.effort), "velocity": repr(knuckle.velocity)}
    ET.SubElement(joint, "limit", {**bounds, **motor})


def _link(
    robot: ET.Element,
    name: str,
    mass: float,
    inertia: Sequence[float],
    com: Sequence[float],
) -> ET.Element:
    link = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(mass)))
    moments = dict(zip(("ixx", "iyy", "izz"), (repr(float(i)) for i in inertia), strict=True))
    ET.SubElement(inertial, "inertia", {**moments, "ixy": "0", "ixz": "0", "iyz": "0"})
    return link


def _shape(
    link: ET.Element,
    kind: str,
    size: dict[str, str],
    xyz: Sequence[float],
    rpy: Sequence[float],
    colour: str,
    visual_only: bool = False,
) -> None:
    for use in ("visual",) if visual_only else ("visual", "collision"):
        element = ET.SubElement(link, use)
        ET.SubElement(element, "origin", xyz=_text(xyz), rpy=_text(rpy))
        ET.SubElement(ET.SubElement(element, "geometry"), kind, size)
        if use == "visual":
            # one name a colour: materials of one name are one material
            material = ET.SubElement(element, "material", name=f"platform_{colour.split()[0]}")
            ET.SubElement(material, "color", rgba=colour)


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Sequence[float],
    yaw: float,
) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_text(xyz), rpy=_text((0.0, 0.0, yaw)))
    return joint


def _text(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
