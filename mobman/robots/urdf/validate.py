"""Validation of a URDF as a robot: names, numbers, and one tree.

Pinocchio's reader of URDFs prints lines of its own, leaves out the mass of a link with a misspelt
number, and takes two links of one name or a robot of two parts for what it is not. What passes here
means the same to every reader.

Refused is only what makes no sense: inertias that no body can have but that programs write (zero, or
against the triangle inequality) are the business of ``mobman robots check``. Geometry is only for
looking: what is wrong with it is left out, and said.

Only what every reader of URDFs takes is a number: digits with a decimal point and an exponent, as XML
Schema writes a double, whatever the locale. ``nan``, ``inf``, ``0x10``, ``1_000``, ``0,5`` and
``0.1 m`` are none; but limits may be infinite, and an effort or a velocity -1, which means none.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

from mobman.errors import SpecError

JOINT_TYPES = ("fixed", "revolute", "prismatic", "continuous")
SHAPES = ("box", "cylinder", "sphere", "mesh")
_LIMITED = ("revolute", "prismatic")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WITH_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+")
_INFINITE = re.compile(r"([+-]?)\.?inf(?:inity)?", re.IGNORECASE)
MOST_LINKS, MOST_JOINTS = 500, 150
_TOLD = 5  # problems, and names in a list
_LOOKED_THROUGH = 5000


@dataclass(frozen=True)
class Numbers:
    """The numbers that an attribute may hold."""

    unit: str = ""  # of each number; empty for a pure number
    count: int = 1
    least: float = -math.inf  # the smallest value, if there is one
    positive: bool = False  # whether they must be above 0
    required: bool = False  # whether the attribute must be there

    def allow(self, values: Sequence[float] | None) -> bool:
        """True if these may be the values."""
        if values is None or len(values) != self.count:
            return False
        return all(value > 0 if self.positive else value >= self.least for value in values)

    def __str__(self) -> str:
        allowed = "a finite number" if self.count == 1 else f"{self.count} finite numbers"
        if self.positive or self.least > -math.inf:
            allowed += " above 0" if self.positive else ", 0 or more"
        return allowed + (f" ({self.unit})" if self.unit else "")


KNOWN = tomllib.loads((files("mobman.robots.urdf") / "urdf.toml").read_text(encoding="utf-8"))
"""What is known of URDFs beforehand."""
NUMBERS = {
    element: {attribute: Numbers(**allowed) for attribute, allowed in attributes.items()}
    for element, attributes in KNOWN["numbers"].items()
}
"""Numbers by element and attribute."""


def numbers(text: str) -> list[float] | None:
    """The finite numbers that a text holds, separated by spaces, or None."""
    parts = text.split()
    if not all(_NUMBER.fullmatch(part) for part in parts):
        return None
    values = [float(part) for part in parts]
    return values if all(map(math.isfinite, values)) else None


def number(text: str) -> float | None:
    """The finite number that a text is, or None."""
    values = numbers(text)
    return values[0] if values is not None and len(values) == 1 else None


def limit_of(attribute: str, text: str) -> float | None:
    """The number of an attribute of ``<limit>``, None if it is none; infinite where there is no limit:
    at a lower limit of -inf, an upper limit, effort or velocity of inf, an effort or velocity of -1."""
    infinite = _INFINITE.fullmatch(text.strip())
    if infinite is not None:
        below = infinite[1] == "-"
        return None if below != (attribute == "lower") else -math.inf if below else math.inf
    value = number(text)
    return math.inf if value == -1.0 and attribute in ("effort", "velocity") else value


def shape_of(use: ET.Element) -> ET.Element | None:
    """The shape of a ``<visual>`` or ``<collision>`` element; None if it has none, or one that URDFs do
    not know, such as ``<capsule>``."""
    geometry = use.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    return shape if shape is not None and shape.tag in SHAPES else None


def listed(names: Iterable[str], joint: str = ", ") -> str:
    """Names in one line; of many, the first few and how many more there are."""
    given = list(names)
    more = [f"... and {len(given) - _TOLD} more"] if len(given) > _TOLD else []
    return joint.join([*given[:_TOLD], *more])


def too_large(robot: ET.Element) -> str:
    """A description of what makes a robot too large for Pinocchio; empty if nothing does.

    Its parser recurses from link to link until the stack is full, and its data grow with the cube of the
    number of movable joints.
    """
    movable = sum(joint.get("type") != "fixed" for joint in robot.findall("joint"))
    for what, count, most in (
        ("links", len(robot.findall("link")), MOST_LINKS),
        ("movable joints", movable, MOST_JOINTS),
    ):
        if count > most:
            return f"it has {count} {what}; allowed: {most}"
    return ""


class Validation:
    """Validation of a URDF that gathers all faults, so that they are reported at once."""

    def __init__(self, where: str, lines: Mapping[ET.Element, int]) -> None:
        self.found: list[tuple[int, str]] = []  # lines, and what is wrong there
        # links, their <visual> or <collision> elements that cannot be drawn, and why
        self.left_out: list[tuple[ET.Element, ET.Element, str]] = []
        self._where, self._lines = where, lines
        self._links: dict[str, ET.Element] = {}  # the first of each name
        self._joints: dict[str, ET.Element] = {}

    def raise_any(self) -> None:
        """Raise a SpecError if there are problems, with the first few of them in the file's order."""
        in_order = sorted(self.found, key=lambda problem: problem[0])
        found = [f"line {line}: {text}" for line, text in in_order]
        if len(found) == 1:
            raise SpecError(f"{self._where}, {found[0]}")
        if found:
            told = listed((f"({i}) {text}" for i, text in enumerate(found, start=1)), "; ")
            raise SpecError(f"{self._where} has {len(found)} problems: {told}")

    def check(self, robot: ET.Element) -> None:
        """Note what is wrong with a ``<robot>`` element; its links may be none."""
        version = robot.get("version")
        if version is not None and not 1.0 <= (number(version) or 0.0) < 2.0:
            self._add(robot, f"<robot> version is {_shown(version)}; allowed: 1.x, or none")
        if fault := too_large(robot):
            self._add(robot, fault)
            return
        for kind, named in (("link", self._links), ("joint", self._joints)):
            for element in robot.findall(kind):
                name = element.get("name", "")
                if not name.strip():
                    self._add(element, f"a <{kind}> has no name")
                elif (first := named.setdefault(name, element)) is not element:
                    there = f"(first defined on line {self._lines[first]})"
                    own = "give each a name of its own"
                    self._add(element, f"duplicate {kind} name {name!r} {there}; {own}")
        for link in robot.findall("link"):
            self._check_link(link)
        for joint in robot.findall("joint"):
            self._check_joint(joint)
        self._check_tree(robot)

    def _add(self, element: ET.Element, text: str) -> None:
        self.found.append((self._lines[element], text))

    def _near(self, name: str, names: Collection[str], otherwise: str = "") -> str:
        """The names that one may have been meant for, as the end of a message; looking takes its time,
        and of many problems only the first few are reported."""
        if len(self.found) >= 2 * _TOLD or len(names) > _LOOKED_THROUGH:
            return otherwise
        found = difflib.get_close_matches(name, sorted(names), n=3, cutoff=0.6)
        return f"; near it: {listed(found)}" if found else otherwise

    def _check_numbers(self, element: ET.Element | None, owner: str) -> None:
        if element is None:
            return
        for attribute, allowed in NUMBERS[element.tag].items():
            text, fault = element.get(attribute), ""
            if text is None:
                fault = f"has no {attribute!r}; allowed: {allowed}" if allowed.required else ""
            elif not allowed.allow(_values(element.tag, attribute, text)):
                fault = f"{attribute} is {_shown(text)}; allowed: {allowed}"
                if any(_WITH_COMMA.fullmatch(part) for part in text.split()):
                    fault += ", with a decimal point"
            if fault:
                self._add(element, f"{owner}: <{element.tag}> {fault}")

    def _check_link(self, link: ET.Element) -> None:
        owner, inertial = f"link {link.get('name', '')!r}", link.find("inertial")
        if inertial is not None:
            self._check_origin(inertial, f"{owner}: inertial")
            for tag in ("mass", "inertia"):
                element = inertial.find(tag)
                if element is None:
                    self._add(
                        inertial,
                        f"{owner}: <inertial> has no <{tag}>; give it one ({', '.join(NUMBERS[tag])}), "
                        "or leave out <inertial> for a link without mass",
                    )
                self._check_numbers(element, owner)
        for part in (*link.findall("visual"), *link.findall("collision")):
            before = len(self.found)
            self._check_shape(part, f"{owner}: {part.tag}")
            if faults := self.found[before:]:
                del self.found[before:]
                said = "; ".join(f"line {line}: {text}" for line, text in faults)
                self.left_out.append((link, part, f"{said}: this <{part.tag}> is left out"))

    def _check_shape(self, part: ET.Element, owner: str) -> None:
        shape = shape_of(part)
        self._check_origin(part, owner)
        self._check_numbers(shape, owner)
        if shape is not None and shape.tag == "mesh":
            if not shape.get("filename", "").strip():
                self._add(shape, f"{owner}: <mesh> has no 'filename'")
            scale = shape.get("scale", "1 1 1")
            if 0.0 in (numbers(scale) or []):
                self._add(shape, f"{owner}: <mesh> scale is {_shown(scale)}; allowed: not 0")

    def _check_origin(self, element: ET.Element, owner: str) -> None:
        origin = element.find("origin")
        self._check_numbers(origin, owner)
        if origin is not None and "quat_xyzw" in origin.attrib:
            advice = "which few tools read; give 'rpy' (rad)"
            self._add(origin, f"{owner}: <origin> has 'quat_xyzw', {advice}")

    def _check_joint(self, joint: ET.Element) -> None:
        name, kind = joint.get("name", ""), joint.get("type")
        owner = f"joint {name!r}"
        self._check_origin(joint, owner)
        if kind not in JOINT_TYPES:
            found = "has no type" if kind is None else f"is {kind!r}"
            moving = "; make it fixed: mobman adds the platform's motion itself"
            advice = moving if kind in ("floating", "planar") else ""
            self._add(joint, f"{owner} {found}; allowed: {', '.join(JOINT_TYPES)}{advice}")
            return
        if kind == "fixed":
            return
        axis, mimic, limit = joint.find("axis"), joint.find("mimic"), joint.find("limit")
        self._check_numbers(axis, owner)
        xyz = "1 0 0" if axis is None else axis.get("xyz", "missing")
        if axis is not None and (xyz == "missing" or numbers(xyz) == [0.0] * 3):
            allowed = "which is not a direction; allowed: a vector that is not 0"
            self._add(axis, f"{owner}: <axis> xyz is {_shown(xyz)}, {allowed}")
        self._check_numbers(limit, owner)
        if kind in _LIMITED and limit is None:
            also = ", or make it continuous" if kind == "revolute" else ""
            one = f"give it one (lower, upper, effort, velocity){also}"
            self._add(joint, f"{owner} is {kind} and has no <limit>; {one}")
        elif kind in _LIMITED and limit is not None:
            lower, upper = (limit_of(bound, limit.get(bound, "0")) for bound in ("lower", "upper"))
            if lower is not None and upper is not None and lower > upper:
                ends = f"lower is {lower:g}, upper {upper:g}; allowed: lower <= upper"
                self._add(limit, f"{owner}: <limit> {ends}")
        self._check_numbers(joint.find("dynamics"), owner)
        self._check_numbers(mimic, owner)
        followed = "" if mimic is None else mimic.get("joint", "")
        if mimic is not None and followed not in self._joints:
            near = self._near(followed, self._joints)
            self._add(mimic, f"{owner}: <mimic> joint is {followed!r}, which is no joint{near}")
        elif mimic is not None and followed == name:
            self._add(mimic, f"{owner}: <mimic> joint is the joint itself; allowed: another one")

    def _check_tree(self, robot: ET.Element) -> None:
        """Note what keeps the joints from making one tree of the links."""
        before, by_child, parents = len(self.found), dict[str, ET.Element](), dict[str, str]()
        for joint in robot.findall("joint"):
            parent, child = self._end(joint, "parent"), self._end(joint, "child")
            if child and (first := by_child.setdefault(child, joint)) is not joint:
                self._add(
                    joint,
                    f"joint {joint.get('name', '')!r}: its child {child!r} is the child of joint "
                    f"{first.get('name')!r} (line {self._lines[first]}) as well; a link has one parent",
                )
            elif child:
                parents[child] = parent
        links = robot.findall("link")
        if len(self.found) > before or not all(link.get("name") for link in links):
            return  # the rest would follow from that
        # every circle of links, once; without a root link there is one
        rooted: set[str] = set()
        for start in parents:
            path: dict[str, None] = {}  # an ordered set
            name = start
            while name in parents and name not in rooted and name not in path:
                path[name] = None
                name = parents[name]
            if name in path:
                circle = list(path)[list(path).index(name) :]
                shown = listed(repr(link) for link in reversed(circle))
                removable = listed(repr(by_child[link].get("name")) for link in circle)
                self._add(
                    by_child[circle[0]],
                    f"the links {shown} are each other's parents in a circle, apart from any root; "
                    f"remove one of the joints {removable}",
                )
            rooted |= path.keys()
        roots = [link for link in links if link.get("name") not in by_child]
        if len(roots) > 1:
            names = listed(link.get("name", "") for link in roots)
            connect = "allowed: one: connect the others by joints"
            self._add(roots[1], f"{len(roots)} root links ({names}); {connect}")

    def _end(self, joint: ET.Element, tag: str) -> str:
        """The link at one end of a joint; empty if it is none."""
        owner, element = f"joint {joint.get('name', '')!r}", joint.find(tag)
        name = "" if element is None else element.get("link", "")
        if element is None or not name:
            self._add(joint, f'{owner} has no {tag}; give it <{tag} link="..."/>')
        elif name not in self._links:
            advice = self._near(name, self._links, "; add the link, or remove the joint")
            self._add(element, f"{owner}: its {tag} {name!r} is no link{advice}")
        return name if name in self._links else ""


def _values(tag: str, attribute: str, text: str) -> list[float] | None:
    """The numbers of an attribute, or None."""
    if tag != "limit":
        return numbers(text)
    value = limit_of(attribute, text)
    return None if value is None else [value]


def _shown(text: str) -> str:
    """A text for messages, shortened if it is long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")
