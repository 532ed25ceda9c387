"""Reading a URDF: the XML, and whether it makes sense as a robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from mobman.errors import SpecError
from mobman.input_file import read_input
from mobman.robots.urdf.document import parse_xml
from mobman.robots.urdf.expansion import check_expanded, macro_call, not_expanded
from mobman.robots.urdf.problems import Problems
from mobman.robots.urdf.tidying import tidy
from mobman.robots.urdf.validation import check_robot

_MEGABYTES = 5.0
_OTHERS = {
    "sdf": "an SDF file (Gazebo)",
    "mujoco": "an MJCF file (MuJoCo)",
    "mujocoinclude": "an MJCF file (MuJoCo)",
    "COLLADA": "a mesh (COLLADA)",
    "launch": "a launch file (ROS)",
    "package": "a package's description (ROS)",
    "html": "a web page (HTML); download the file itself",
}


def read_urdf(path: Path) -> ET.Element:
    """The ``<robot>`` element of a URDF, checked.

    It is as in the file but for what :mod:`mobman.robots.urdf.tidying` says; elements that URDFs do not
    know (``<gazebo>``, ``<transmission>``, ...) are kept and not looked at.

    Args:
        path: The file.

    Raises:
        SpecError: If the file cannot be read or is not a URDF that makes sense. The message names the
            file and, of every problem, the line, the link or joint, the field, what was found, and
            what is allowed.
    """
    return parse_urdf(read_content(path), path)


def read_content(path: Path) -> bytes:
    """The content of a URDF's file.

    Raises:
        SpecError: If the file cannot be read.
    """
    return read_input(path, "URDF", _MEGABYTES, "geometry belongs in meshes")


def parse_urdf(content: bytes, path: Path) -> ET.Element:
    """The ``<robot>`` element of a URDF's content, as :func:`read_urdf`.

    Args:
        content: The file's content.
        path: The file, for messages and for a robot without a name.

    Raises:
        SpecError: If it is not a URDF that makes sense.
    """
    where = f"the URDF {path}"
    document = parse_xml(content, where)
    robot = document.root
    if robot.tag != "robot":
        other = _OTHERS.get(str(robot.tag))
        advice = f": it is {other}; convert it, or find the robot's URDF" if other else ""
        raise SpecError(f"{where} starts with <{robot.tag}>, not with <robot>{advice}")
    check_expanded(document, path)
    call = macro_call(document)
    if robot.find("link") is None:
        if call is not None:
            raise not_expanded(call, f"<{call.tag}>", document, path)
        advice = ""
        if robot.find("group") is not None or robot.find("disable_collisions") is not None:
            advice = ": it is an SRDF (MoveIt's groups and poses); give the robot's URDF"
        raise SpecError(f"{where} has no <link>{advice}")
    problems = Problems(where, document.lines)
    check_robot(robot, problems)
    if problems and call is not None:
        raise not_expanded(call, f"<{call.tag}>", document, path)
    problems.raise_any()
    tidy(robot, path.stem)
    return robot
