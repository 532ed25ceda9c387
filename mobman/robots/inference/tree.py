"""The kinematic tree of a URDF with all joints at zero: where every joint is, and what is behind it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.urdf.compose import root_link
from mobman.robots.urdf.shapes import placement, scalar, vector

_WIDE = 30.0  # rad; limits so far apart are a way to write "none"
_FULL_TURN = 4.0  # rad; a vertical joint that turns further is a swivel, one that does not steers
_VERTICAL = 0.02  # rad
_HORIZONTAL = 0.02  # rad


@dataclass(frozen=True)
class Follows:
    """What a mimic joint does: multiplier * position of another joint + offset (m, rad)."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint in the root link's frame, all joints at zero.

    Attributes:
        name, kind, parent, child: As the URDF has them.
        lower, upper: Limits (m, rad), infinite where there are none.
        follows: Which other joint it follows, and how (mimic).
        rotation: Orientation of the joint's frame, shape (3, 3).
        centre: Its origin (m), shape (3,).
        axis: Unit vector, shape (3,).
    """

    name: str
    kind: str
    parent: str
    child: str
    lower: float
    upper: float
    follows: Follows | None
    rotation: Array
    centre: Array
    axis: Array

    @property
    def mimic(self) -> bool:
        """Whether it follows another joint."""
        return self.follows is not None

    @property
    def movable(self) -> bool:
        """Whether it has a degree of freedom."""
        return self.kind != "fixed"

    @property
    def prismatic(self) -> bool:
        """Whether it slides."""
        return self.kind == "prismatic"

    @property
    def width(self) -> float:
        """Between its limits (m, rad)."""
        return self.upper - self.lower

    @property
    def endless(self) -> bool:
        """Whether it turns without limits, or with limits that amount to none."""
        return self.kind == "continuous" or (self.kind == "revolute" and self.width > _WIDE)

    @property
    def vertical(self) -> bool:
        """Whether its axis is along the root link's z."""
        return abs(float(self.axis[2])) > math.cos(_VERTICAL)

    @property
    def horizontal(self) -> bool:
        """Whether its axis is across the root link's z."""
        return abs(float(self.axis[2])) < math.sin(_HORIZONTAL)

    @property
    def swivels(self) -> bool:
        """Whether it turns freely about the vertical, as a caster's does."""
        return not self.prismatic and self.vertical and (self.endless or self.width > _FULL_TURN)

    @property
    def steers(self) -> bool:
        """Whether it turns about the vertical, within limits."""
        return not self.prismatic and self.vertical and not self.swivels


class Tree:
    """Links and joints of a URDF.

    Args:
        robot: The ``<robot>`` element.
        where: What to call it in messages.

    Raises:
        SpecError: If it has not exactly one root link, or a joint's child is no link.

    Attributes:
        root: Name of the root link.
        links: ``<link>`` elements by name.
        joints: In the file's order.
        rotation, position: Of each link's frame in the root's, by name.
    """

    def __init__(self, robot: ET.Element, where: str) -> None:
        self.root = root_link(robot, where)
        self.links = {str(link.get("name")): link for link in robot.findall("link")}
        self.children: dict[str, list[Joint]] = {name: [] for name in self.links}
        self.above: dict[str, Joint] = {}
        self.rotation, self.position = {self.root: np.eye(3)}, {self.root: np.zeros(3)}
        elements: dict[str, list[ET.Element]] = {}
        for element in robot.findall("joint"):
            elements.setdefault(_end(element, "parent"), []).append(element)
        open_links = [self.root]
        found: dict[str, Joint] = {}
        while open_links:
            parent = open_links.pop()
            for element in elements.get(parent, []):
                joint = self._joint(element, parent)
                found[joint.name] = joint
                self.children[parent].append(joint)
                self.above[joint.child] = joint
                self.rotation[joint.child], self.position[joint.child] = (
                    joint.rotation,
                    joint.centre,
                )
                open_links.append(joint.child)
        order = [str(element.get("name")) for element in robot.findall("joint")]
        self.joints = [found[name] for name in order if name in found]

    def _joint(self, element: ET.Element, parent: str) -> Joint:
        if _end(element, "child") not in self.links:
            raise SpecError(
                f"joint {element.get('name')!r}: its child {_end(element, 'child')!r} is no link"
            )
        turn, xyz = placement(element)
        rotation = self.rotation[parent] @ turn
        kind = element.get("type", "")
        axis = vector(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
        lower, upper = _limits(element, kind)
        return Joint(
            name=str(element.get("name")),
            kind=kind,
            parent=parent,
            child=_end(element, "child"),
            lower=lower,
            upper=upper,
            follows=_follows(element.find("mimic")),
            rotation=rotation,
            centre=self.position[parent] + self.rotation[parent] @ xyz,
            axis=rotation @ (axis / np.linalg.norm(axis)),
        )

    @property
    def movable(self) -> list[Joint]:
        """Joints with a degree of freedom, mimic joints included, in the file's order."""
        return [joint for joint in self.joints if joint.movable]

    def joint(self, name: str) -> Joint | None:
        """The movable joint of that name."""
        return next((joint for joint in self.movable if joint.name == name), None)

    def chain(self, link: str) -> list[Joint]:
        """The movable joints from the root to a link."""
        chain = []
        while link in self.above:
            joint = self.above[link]
            if joint.movable:
                chain.append(joint)
            link = joint.parent
        return chain[::-1]

    def rigid(self, link: str) -> list[str]:
        """A link and what is fixed to it further out, from the inside outwards."""
        body = [link]
        for name in body:
            body += [joint.child for joint in self.children[name] if not joint.movable]
        return body

    def next_joints(self, link: str) -> list[Joint]:
        """The first movable joints behind a link."""
        return [
            joint for name in self.rigid(link) for joint in self.children[name] if joint.movable
        ]

    def behind(self, joint: Joint) -> Iterator[Joint]:
        """The movable joints behind a joint, however far."""
        for following in self.next_joints(joint.child):
            yield following
            yield from self.behind(following)

    def depth(self, link: str) -> int:
        """How many joints of any kind are between the root and a link."""
        count = 0
        while link in self.above:
            link, count = self.above[link].parent, count + 1
        return count


def _end(joint: ET.Element, tag: str) -> str:
    found = joint.find(tag)
    return "" if found is None else found.get("link", "")


def _follows(mimic: ET.Element | None) -> Follows | None:
    if mimic is None:
        return None
    multiplier = scalar(mimic, "multiplier") if "multiplier" in mimic.attrib else 1.0
    return Follows(mimic.get("joint", ""), multiplier, scalar(mimic, "offset"))


def _limits(element: ET.Element, kind: str) -> tuple[float, float]:
    if kind == "continuous":
        return -math.inf, math.inf
    limit = element.find("limit")
    return scalar(limit, "lower"), scalar(limit, "upper")


def names_of(joints: Sequence[Joint]) -> str:
    """The names of joints, for messages."""
    return ", ".join(joint.name for joint in joints) or "none"
