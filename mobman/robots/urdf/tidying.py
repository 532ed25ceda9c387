"""A URDF in the form in which every reader takes it the same way.

Readers of URDFs differ in what they put up with. What is no mistake is written here as the strictest
of them wants it, and what concerns neither the motion nor the picture is left out:

- axes become unit vectors, as every reader makes them, and numbers are separated by single spaces;
- an effort or velocity limit that is not given is 0, which stands for "not known";
- a fixed joint has no axis, limit, dynamics or mimic, and a continuous one no lower and upper limit;
- a ``<visual>`` or ``<collision>`` without a shape that URDFs know (``<capsule>``) is left out;
- colours are in the ``<visual>`` elements that have them, since robots that are put together may have
  two of one name; what is none (four numbers from 0 to 1) or was never defined is left out.
"""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET

from mobman.robots.urdf.quantities import NUMBERS, numbers
from mobman.robots.urdf.validation import shape_of

_UNIT = 1e-12
_NOT_READ = ("safety_controller", "calibration")
_MOTION = ("axis", "limit", "dynamics", "mimic")


def tidy(robot: ET.Element, name: str) -> None:
    """Bring a checked ``<robot>`` element into that form.

    Args:
        robot: The element; it is changed.
        name: The robot's name, where the file gives none.
    """
    robot.attrib.pop("version", None)
    robot.set("name", robot.get("name") or name)
    colours = _take_colours(robot)
    for link in robot.findall("link"):
        for use in [*link.findall("visual"), *link.findall("collision")]:
            if shape_of(use) is None:
                link.remove(use)
        for visual in link.findall("visual"):
            _tidy_colour(visual, colours)
    for joint in robot.findall("joint"):
        _tidy_joint(joint)
    for element in [*robot.findall("link"), *robot.findall("joint")]:
        _tidy_spaces(element)


def _tidy_joint(joint: ET.Element) -> None:
    kind = joint.get("type")
    for tag in (*_NOT_READ, *(_MOTION if kind == "fixed" else ())):
        for element in joint.findall(tag):
            joint.remove(element)
    limit = joint.find("limit")
    if limit is not None:
        for attribute in ("effort", "velocity"):
            limit.attrib.setdefault(attribute, "0")
        if kind == "continuous":
            for attribute in ("lower", "upper"):
                limit.attrib.pop(attribute, None)
    dynamics = joint.find("dynamics")
    if dynamics is not None and not {"damping", "friction"} & set(dynamics.attrib):
        joint.remove(dynamics)
    axis = joint.find("axis")
    if axis is not None:
        xyz = numbers(axis.get("xyz", "1 0 0")) or []
        length = math.hypot(*xyz)
        if abs(length - 1.0) > _UNIT:
            # by the largest first: the squares of tiny or huge numbers are 0 or infinite
            largest = max(map(abs, xyz))
            scaled = [value / largest for value in xyz]
            length = math.hypot(*scaled)
            axis.set("xyz", " ".join(repr(value / length) for value in scaled))


def _tidy_spaces(element: ET.Element) -> None:
    for part in element.iter():
        for attribute in NUMBERS.get(str(part.tag), ()):
            text = part.get(attribute)
            if text is not None and text != (plain := " ".join(text.split())):
                part.set(attribute, plain)


def _take_colours(robot: ET.Element) -> dict[str, ET.Element]:
    """The robot's own materials by name, the first of each; they are removed from it."""
    colours: dict[str, ET.Element] = {}
    for material in robot.findall("material"):
        robot.remove(material)
        if (name := material.get("name")) and _has_look(material):
            colours.setdefault(name, material)
    return colours


def _tidy_colour(visual: ET.Element, colours: dict[str, ET.Element]) -> None:
    material = visual.find("material")
    if material is None:
        return
    name = material.get("name", "")
    if name in colours:
        material[:] = copy.deepcopy(list(colours[name]))
    if not _has_look(material):
        visual.remove(material)
        return
    material.set("name", name)


def _has_look(material: ET.Element) -> bool:
    """Whether it has a colour or a texture; a colour that is none is removed."""
    colour = material.find("color")
    if colour is not None:
        rgba = numbers(colour.get("rgba", "")) or []
        if len(rgba) != 4 or not all(0.0 <= value <= 1.0 for value in rgba):
            material.remove(colour)
            colour = None
    texture = material.find("texture")
    return colour is not None or (texture is not None and bool(texture.get("filename")))
