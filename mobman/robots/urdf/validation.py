"""Whether a URDF makes sense as a robot: names, numbers, and one tree.

Pinocchio's reader of URDFs prints lines of its own, leaves out the mass of a link with a misspelt
number, and takes two links of one name or a robot of two parts for what it is not. What passes here
means the same to every reader.

Refused is only what makes no sense: inertias that no body can have but that programs write (zero, or
against the triangle inequality) are the business of ``mobman robots check``.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from mobman.robots.urdf.problems import Problems
from mobman.robots.urdf.quantities import NUMBERS, check_numbers, number, numbers, shown
from mobman.robots.urdf.tree import check_tree

JOINT_TYPES = ("fixed", "revolute", "prismatic", "continuous")
SHAPES = ("box", "cylinder", "sphere", "mesh")
_LIMITED = ("revolute", "prismatic")


def check_robot(robot: ET.Element, problems: Problems) -> None:
    """Note what is wrong with a ``<robot>`` element.

    Args:
        robot: The element; its links may be none.
        problems: Where to note it.
    """
    version = robot.get("version")
    if version is not None and not 1.0 <= (number(version) or 0.0) < 2.0:
        problems.add(robot, f"<robot> version is {shown(version)}; allowed: 1.x, or none")
    links, joints = robot.findall("link"), robot.findall("joint")
    link_names = _check_names("link", links, problems)
    joint_names = _check_names("joint", joints, problems)
    for link in links:
        _check_link(link, problems)
    for joint in joints:
        _check_joint(joint, joint_names, problems)
    check_tree(links, joints, link_names, problems)


def _check_names(kind: str, elements: Iterable[ET.Element], problems: Problems) -> set[str]:
    first: dict[str, ET.Element] = {}
    for element in elements:
        name = element.get("name", "")
        if not name.strip():
            problems.add(element, f"a <{kind}> has no name")
        elif name in first:
            problems.add(
                element,
                f"{kind} {name!r} is there twice, first in line {problems.line(first[name])}; "
                "give each a name of its own",
            )
        else:
            first[name] = element
    return set(first)


def _check_link(link: ET.Element, problems: Problems) -> None:
    owner = f"link {link.get('name', '')!r}"
    inertial = link.find("inertial")
    if inertial is not None:
        _check_origin(inertial, f"{owner}: inertial", problems)
        for tag in ("mass", "inertia"):
            element = inertial.find(tag)
            if element is None:
                needed = ", ".join(NUMBERS[tag])
                problems.add(
                    inertial,
                    f"{owner}: <inertial> has no <{tag}>; give it one ({needed}), or leave out "
                    "<inertial> for a link without mass",
                )
            else:
                check_numbers(element, owner, problems)
    for use in ("visual", "collision"):
        for shape in link.findall(use):
            _check_shape(shape, f"{owner}: {use}", problems)


def _check_shape(use: ET.Element, owner: str, problems: Problems) -> None:
    _check_origin(use, owner, problems)
    shape = shape_of(use)
    if shape is None:
        return
    check_numbers(shape, owner, problems)
    if shape.tag == "mesh":
        if not shape.get("filename", "").strip():
            problems.add(shape, f"{owner}: <mesh> has no 'filename'")
        if 0.0 in (numbers(shape.get("scale", "1 1 1")) or []):
            problems.add(
                shape,
                f"{owner}: <mesh> scale is {shown(shape.get('scale', ''))}; allowed: not 0",
            )


def shape_of(use: ET.Element) -> ET.Element | None:
    """The shape of a ``<visual>`` or ``<collision>`` element.

    None if it has none, or one that URDFs do not know, such as ``<capsule>``.
    """
    geometry = use.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    return shape if shape is not None and shape.tag in SHAPES else None


def _check_origin(element: ET.Element, owner: str, problems: Problems) -> None:
    origin = element.find("origin")
    if origin is None:
        return
    check_numbers(origin, owner, problems)
    if "quat_xyzw" in origin.attrib:
        problems.add(
            origin, f"{owner}: <origin> has 'quat_xyzw', which few tools read; give 'rpy' (rad)"
        )


def _check_joint(joint: ET.Element, joint_names: set[str], problems: Problems) -> None:
    name, kind = joint.get("name", ""), joint.get("type")
    owner = f"joint {name!r}"
    _check_origin(joint, owner, problems)
    if kind not in JOINT_TYPES:
        advice = ""
        if kind in ("floating", "planar"):
            advice = "; make it fixed: mobman adds the platform's motion itself"
        found = "has no type" if kind is None else f"is {kind!r}"
        problems.add(joint, f"{owner} {found}; allowed: {', '.join(JOINT_TYPES)}{advice}")
        return
    if kind == "fixed":
        return
    _check_axis(joint, owner, problems)
    _check_limit(joint, owner, problems)
    if (dynamics := joint.find("dynamics")) is not None:
        check_numbers(dynamics, owner, problems)
    if (mimic := joint.find("mimic")) is not None:
        check_numbers(mimic, owner, problems)
        followed = mimic.get("joint", "")
        if followed not in joint_names:
            problems.add(
                mimic,
                f"{owner}: <mimic> joint is {followed!r}, which is no joint"
                + problems.near(followed, joint_names),
            )
        elif followed == name:
            problems.add(mimic, f"{owner}: <mimic> joint is the joint itself; allowed: another one")


def _check_axis(joint: ET.Element, owner: str, problems: Problems) -> None:
    axis = joint.find("axis")
    if axis is None:
        return
    check_numbers(axis, owner, problems)
    values = numbers(axis.get("xyz", "1 0 0"))
    if values is not None and len(values) == 3 and not any(values):
        problems.add(
            axis,
            f"{owner}: <axis> xyz is {shown(axis.get('xyz', ''))}, which is no direction; allowed: a "
            "vector that is not 0",
        )


def _check_limit(joint: ET.Element, owner: str, problems: Problems) -> None:
    limit, kind = joint.find("limit"), joint.get("type")
    if limit is None:
        if kind in _LIMITED:
            also = ", or make it continuous" if kind == "revolute" else ""
            problems.add(
                joint,
                f"{owner} is {kind} and has no <limit>; give it one (lower, upper, effort, "
                f"velocity){also}",
            )
        return
    check_numbers(limit, owner, problems)
    lower, upper = (number(limit.get(bound, "0")) for bound in ("lower", "upper"))
    if kind in _LIMITED and lower is not None and upper is not None and lower > upper:
        problems.add(
            limit, f"{owner}: <limit> lower is {lower:g}, upper {upper:g}; allowed: lower <= upper"
        )
