"""A platform described by its numbers: a box on wheels, as a URDF."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from pydantic import AfterValidator, Field, PositiveFloat

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.urdf.compose import add_inertial, add_joint, text_of
from mobman.toml_model import Strict


def _of_a_turn(value: float) -> float:
    if abs(value) > math.tau:
        raise ValueError("must be an angle in rad, from -2 pi to 2 pi")
    return value


Angle = Annotated[float, AfterValidator(_of_a_turn)]  # rad; larger ones are degrees by mistake
BASE_LINK, DECK = "platform", "deck"
_GREY, _DARK = "0.55 0.58 0.62 1", "0.15 0.15 0.16 1"


class Body(Strict):
    """The fields of ``[platform.body]``; a type may add its own."""

    mass: float = Field(gt=0)  # mass of everything but the wheels (kg)
    size: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    """Length, width and height of the body, a box (m)."""
    ground_clearance: float = Field(0.0, ge=0)  # height of the box's underside (m)
    centre: tuple[float, float] = (0.0, 0.0)
    """Place of the box's centre, ahead and to the left of ``platform`` (m)."""
    centre_of_mass: tuple[float, float, float] | None = None
    """From ``platform`` (m); by default the box's centre."""
    inertia: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    """Principal inertias about x, y, z through the centre of mass (kg m^2); by default the
    homogeneous box's."""


class WheeledBody(Body):
    """The same with wheels, all alike."""

    wheel_mass: float = Field(gt=0)  # mass of one wheel (kg); a homogeneous cylinder
    wheel_width: float = Field(gt=0)  # m
    wheel_velocity: float = Field(0.0, ge=0)  # largest rate of a wheel (rad/s); 0: not known
    wheel_effort: float = Field(0.0, ge=0)  # largest torque on a wheel (N m); 0: not known


class SpreadBody(WheeledBody):
    """The same with wheels on a rectangle or on a circle."""

    wheelbase: float | None = Field(None, gt=0)
    """On a rectangle: distance of the front and the rear ones (m)."""
    half_track: float | None = Field(None, gt=0)
    """On a rectangle: half the distance of the right and the left ones (m)."""
    circle: float | None = Field(None, gt=0)  # on a circle: its radius (m)
    angles: list[Angle] = []  # where on the circle they are, from forward, anticlockwise (rad)

    def spots(self, origin: str, on_circle: bool, why: str) -> dict[str, tuple[float, float]]:
        """Places of the wheels ahead and to the left (m), by name; ``why`` fields are needed is said if
        one is missing. SpecError if one is."""
        if on_circle:
            r = required(origin, "body.circle", self.circle, why)
            angles = required(origin, "body.angles", self.angles, why)
            return {f"{i}": (r * math.cos(a), r * math.sin(a)) for i, a in enumerate(angles, 1)}
        x = 0.5 * required(origin, "body.wheelbase", self.wheelbase, why)
        y = required(origin, "body.half_track", self.half_track, why)
        ends, sides = (("front", x), ("rear", -x)), (("left", y), ("right", -y))
        return {f"{end}_{side}": (a, b) for end, a in ends for side, b in sides}


T = TypeVar("T")


class WheelPart(NamedTuple):
    """A wheel to be put into the URDF."""

    joint: str  # name of its joint; its link is called <joint>_link
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)  # its centre in the parent's frame (m)
    yaw: float = 0.0  # direction of its axis, about z from the parent's y axis (rad)
    parent: str = BASE_LINK  # link that carries it


class Knuckle(NamedTuple):
    """A steering joint about the vertical."""

    joint: str  # name of its joint; its link is called <joint>_link
    xyz: tuple[float, float, float]  # its position from platform (m)
    mass: float  # kg
    limit: float = math.inf  # largest angle (rad); infinite: it turns without end
    velocity: float = 0.0  # largest rate (rad/s); 0: not known
    effort: float = 0.0  # largest torque (N m); 0: not known


def required(origin: str, field: str, value: T | None, why: str = "") -> T:
    """A field of ``[platform]`` that a platform described by its numbers needs; SpecError if it is
    missing."""
    if value is None or value == []:
        reason = why or "[platform.body] has no URDF to read it from"
        raise SpecError(f"{origin}: field 'platform.{field}' is missing: {reason}")
    return value


def body_urdf(
    body: Body, radius: float = 0.0, parts: Iterable[WheelPart | Knuckle] = ()
) -> ET.Element:
    """The ``<robot>`` element of a box on wheels of a radius (m), with the links ``platform`` and
    ``deck``."""
    height = body.size[2]
    middle = (*body.centre, body.ground_clearance + 0.5 * height)
    com = middle if body.centre_of_mass is None else body.centre_of_mass
    inertia = body.inertia or box_inertia(body.mass, body.size)
    robot = ET.Element("robot", name="platform")
    box = _add_link(robot, BASE_LINK, body.mass, inertia, com)
    _add_shape(box, "box", {"size": text_of(body.size)}, _GREY, middle)
    ET.SubElement(robot, "link", name=DECK)
    top = (*body.centre, body.ground_clearance + height)
    add_joint(robot, "deck_joint", "fixed", BASE_LINK, DECK, top)
    for part in parts:
        if isinstance(part, Knuckle):
            _add_knuckle(robot, part, radius)
        elif isinstance(body, WheeledBody):
            _add_wheel(robot, body, part, radius)
    return robot


def box_inertia(mass: float, size: tuple[float, float, float]) -> Array:
    """Principal inertias of a homogeneous box (kg m^2), shape (3,)."""
    x, y, z = np.square(size)
    return mass / 12.0 * np.array([y + z, x + z, x + y])


def _add_wheel(robot: ET.Element, body: WheeledBody, wheel: WheelPart, r: float) -> None:
    name, m, w = f"{wheel.joint}_link", body.wheel_mass, body.wheel_width
    across = m / 12.0 * (3.0 * r**2 + w**2)
    link = _add_link(robot, name, m, (across, 0.5 * m * r**2, across))
    cylinder = {"radius": repr(r), "length": repr(w)}
    _add_shape(link, "cylinder", cylinder, _DARK, rpy=(0.5 * math.pi, 0.0, 0.0))
    # a spoke, so that the wheel can be seen to turn
    spoke = {"size": text_of((1.6 * r, 1.02 * w, 0.2 * r))}
    _add_shape(link, "box", spoke, _GREY, uses=("visual",))
    place = wheel.xyz, (0.0, 0.0, wheel.yaw)
    joint = add_joint(robot, wheel.joint, "continuous", wheel.parent, name, *place)
    _add_motor(joint, "0 1 0", effort=body.wheel_effort, velocity=body.wheel_velocity)


def _add_knuckle(robot: ET.Element, knuckle: Knuckle, radius: float) -> None:
    """Add a steering joint, its link in the size of the wheel that it carries."""
    name, size = f"{knuckle.joint}_link", (0.4 * radius, 0.4 * radius, radius)
    link = _add_link(robot, name, knuckle.mass, box_inertia(knuckle.mass, size))
    _add_shape(link, "box", {"size": text_of(size)}, _GREY)
    endless = math.isinf(knuckle.limit)
    bounds = {} if endless else {"lower": -knuckle.limit, "upper": knuckle.limit}
    kind = "continuous" if endless else "revolute"
    joint = add_joint(robot, knuckle.joint, kind, BASE_LINK, name, knuckle.xyz)
    _add_motor(joint, "0 0 1", **bounds, effort=knuckle.effort, velocity=knuckle.velocity)


def _add_link(
    robot: ET.Element,
    name: str,
    mass: float,
    moments: Iterable[float],
    com: Sequence[float] = (0.0, 0.0, 0.0),
) -> ET.Element:
    link = ET.SubElement(robot, "link", name=name)
    add_inertial(link, mass, pin.SE3(np.eye(3), np.array(com)), np.diag([*moments]))
    return link


def _add_motor(joint: ET.Element, axis: str, **bounds: float) -> None:
    ET.SubElement(joint, "axis", xyz=axis)
    ET.SubElement(joint, "limit", {key: repr(float(value)) for key, value in bounds.items()})


def _add_shape(
    link: ET.Element,
    kind: str,
    size: dict[str, str],
    colour: str,
    xyz: Sequence[float] = (0.0, 0.0, 0.0),
    rpy: Sequence[float] = (0.0, 0.0, 0.0),
    uses: Sequence[str] = ("visual", "collision"),
) -> None:
    for use in uses:
        element = ET.SubElement(link, use)
        ET.SubElement(element, "origin", xyz=text_of(xyz), rpy=text_of(rpy))
        ET.SubElement(ET.SubElement(element, "geometry"), kind, size)
        if use == "visual":  # one name a colour: materials of one name are one material
            material = ET.SubElement(element, "material", name=f"platform_{colour.split()[0]}")
            ET.SubElement(material, "color", rgba=colour)
