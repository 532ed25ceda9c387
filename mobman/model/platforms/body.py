"""A platform described by its numbers: a box on wheels, as a URDF."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from pydantic import Field, PositiveFloat

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.toml_model import Strict

BASE_LINK, DECK = "platform", "deck"
_ORIGIN = (0.0, 0.0, 0.0)
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


class WheelPart(NamedTuple):
    """A wheel to be put into the URDF."""

    joint: str
    """Name of its joint; its link is called ``<joint>_link``."""
    xyz: tuple[float, float, float]
    """Its centre in the parent's frame (m)."""
    radius: float
    """m."""
    yaw: float = 0.0
    """Direction of its axis, about z from the parent's y axis (rad)."""
    parent: str = BASE_LINK
    """Link that carries it."""


class Knuckle(NamedTuple):
    """A steering joint about the vertical."""

    joint: str
    """Name of its joint; its link is called ``<joint>_link``."""
    xyz: tuple[float, float, float]
    """Its position from ``platform`` (m)."""
    limit: float
    """Largest angle (rad); infinite: it turns without end."""
    velocity: float
    """Largest rate (rad/s); 0: not known."""
    mass: float
    """kg."""
    radius: float
    """Of the wheel that it carries, for its size (m)."""
    effort: float = 0.0
    """Largest torque (N m); 0: not known."""


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
    height = body.size[2]
    middle = (*body.centre, body.ground_clearance + 0.5 * height)
    com = middle if body.centre_of_mass is None else body.centre_of_mass
    inertia = body.inertia or box_inertia(body.mass, body.size)
    box = _shape("box", {"size": _text(body.size)}, _GREY, middle)
    top = (*body.centre, body.ground_clearance + height)
    parts = [
        _link(BASE_LINK, body.mass, inertia, box, com),
        f'<link name="{DECK}"/>',
        _joint("deck_joint", "fixed", BASE_LINK, DECK, top),
        *map(_knuckle, knuckles),
        *(_wheel(body, wheel) for wheel in wheels if isinstance(body, WheeledBody)),
    ]
    return ET.fromstring(f'<robot name="platform">{"".join(parts)}</robot>')


def box_inertia(mass: float, size: tuple[float, float, float]) -> Array:
    """Principal inertias of a homogeneous box (kg m^2), shape (3,)."""
    x, y, z = np.square(size)
    return mass / 12.0 * np.array([y + z, x + z, x + y])


def _wheel(body: WheeledBody, wheel: WheelPart) -> str:
    name, m, w, r = f"{wheel.joint}_link", body.wheel_mass, body.wheel_width, wheel.radius
    across = m / 12.0 * (3.0 * r**2 + w**2)
    cylinder = {"radius": repr(r), "length": repr(w)}
    # a spoke, so that the wheel can be seen to turn
    spoke = {"size": _text((1.6 * r, 1.02 * w, 0.2 * r))}
    shapes = _shape("cylinder", cylinder, _DARK, rpy=(0.5 * math.pi, 0.0, 0.0))
    shapes += _shape("box", spoke, _GREY, uses=("visual",))
    motor = {"effort": body.wheel_effort, "velocity": body.wheel_velocity}
    place = (wheel.parent, name, wheel.xyz, wheel.yaw)
    return _link(name, m, (across, 0.5 * m * r**2, across), shapes) + _joint(
        wheel.joint, "continuous", *place, axis="0 1 0", limit=motor
    )


def _knuckle(knuckle: Knuckle) -> str:
    name = f"{knuckle.joint}_link"
    size = (0.4 * knuckle.radius, 0.4 * knuckle.radius, knuckle.radius)
    box = _shape("box", {"size": _text(size)}, _GREY)
    endless = math.isinf(knuckle.limit)
    bounds = {} if endless else {"lower": -knuckle.limit, "upper": knuckle.limit}
    bounds |= {"effort": knuckle.effort, "velocity": knuckle.velocity}
    kind = "continuous" if endless else "revolute"
    return _link(name, knuckle.mass, box_inertia(knuckle.mass, size), box) + _joint(
        knuckle.joint, kind, BASE_LINK, name, knuckle.xyz, axis="0 0 1", limit=bounds
    )


def _link(
    name: str, mass: float, inertia: Iterable[float], shapes: str, com: Sequence[float] = _ORIGIN
) -> str:
    ixx, iyy, izz = (repr(float(moment)) for moment in inertia)
    return (
        f'<link name="{name}"><inertial><origin xyz="{_text(com)}" rpy="0 0 0"/>'
        f'<mass value="{float(mass)!r}"/><inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" '
        f'ixz="0" iyz="0"/></inertial>{shapes}</link>'
    )


def _shape(
    kind: str,
    size: dict[str, str],
    colour: str,
    xyz: Sequence[float] = _ORIGIN,
    rpy: Sequence[float] = _ORIGIN,
    uses: Sequence[str] = ("visual", "collision"),
) -> str:
    shape = " ".join([kind, *(f'{key}="{value}"' for key, value in size.items())])
    place = f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/><geometry><{shape}/></geometry>'
    # one name a colour: materials of one name are one material
    paint = f'<material name="platform_{colour.split()[0]}"><color rgba="{colour}"/></material>'
    return "".join(f"<{use}>{place}{paint if use == 'visual' else ''}</{use}>" for use in uses)


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Sequence[float],
    yaw: float = 0.0,
    axis: str = "",
    limit: dict[str, float] | None = None,
) -> str:
    bounds = "".join(f' {key}="{value!r}"' for key, value in (limit or {}).items())
    moves = f'<axis xyz="{axis}"/><limit{bounds}/>' if axis else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(xyz)}" rpy="{_text((0.0, 0.0, yaw))}"/>{moves}</joint>'
    )


def _text(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
