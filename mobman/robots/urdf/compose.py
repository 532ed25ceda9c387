"""Several URDFs put together: arms mounted on a platform."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

from mobman.errors import SpecError
from mobman.robots.spec import Mount
from mobman.robots.urdf.flat import root_link

_WITHOUT_EFFECT = ("transmission", "gazebo")  # and they name joints and links, which get a prefix


@dataclass(frozen=True)
class Mounted:
    """A URDF and how it is mounted.

    Attributes:
        robot: Its ``<robot>`` element; it is changed by :func:`compose`.
        mount: The place, and the prefix of its names.
        where: What to call it in messages: the description and the field.
    """

    robot: ET.Element
    mount: Mount
    where: str


def compose(platform: ET.Element, mounted: list[Mounted]) -> ET.Element:
    """One tree of a platform and what is mounted on it; frames and geometry come along.

    Args:
        platform: The platform's ``<robot>`` element, to which the others are added.
        mounted: What is mounted, in this order.

    Raises:
        SpecError: If a parent link is not there, or two links or joints have one name.
    """
    for part in mounted:
        _mount(platform, part)
    return platform


def _mount(platform: ET.Element, part: Mounted) -> None:
    _add_prefix(part.robot, part.mount.prefix)
    for kind in ("link", "joint"):
        there = {element.get("name") for element in platform.findall(kind)}
        added = {element.get("name") for element in part.robot.findall(kind)}
        if both := sorted(str(name) for name in there & added):
            raise SpecError(
                f"{part.where}.prefix' is {part.mount.prefix!r}, and then the {kind}s "
                f"{', '.join(both[:5])} are there twice; choose another prefix"
            )
    links = [str(link.get("name")) for link in platform.findall("link")]
    if part.mount.parent not in links:
        raise SpecError(
            f"{part.where}.parent' is {part.mount.parent!r}, which is no link of the platform; its "
            f"links: {', '.join(links)}"
        )
    root = root_link(part.robot, part.where)
    joint = ET.SubElement(platform, "joint", name=f"mount/{root}", type="fixed")
    ET.SubElement(joint, "parent", link=part.mount.parent)
    ET.SubElement(joint, "child", link=root)
    ET.SubElement(joint, "origin", xyz=_numbers(part.mount.xyz), rpy=_numbers(part.mount.rpy))
    platform.extend([element for element in part.robot if element.tag not in _WITHOUT_EFFECT])


def _add_prefix(robot: ET.Element, prefix: str) -> None:
    """Every name of a URDF, and every reference to one, with a prefix."""
    for element, attribute in (
        *((element, "name") for element in robot.findall("link")),
        *((element, "name") for element in robot.findall("joint")),
        *((element, "link") for element in robot.findall("joint/parent")),
        *((element, "link") for element in robot.findall("joint/child")),
        *((element, "joint") for element in robot.findall("joint/mimic")),
        *((element, "name") for element in robot.iter("material")),
    ):
        if (name := element.get(attribute)) is not None:
            element.set(attribute, prefix + name)


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)
