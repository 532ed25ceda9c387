"""A URDF made ready for flat coordinates: three 1-dof base joints in front, no two-slot joints."""

from __future__ import annotations

import hashlib
import math
import sysconfig
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mobman.errors import SpecError
from mobman.robots.spec import RobotSpec

BASE_JOINTS = ("base_x", "base_y", "base_theta")
"""The platform's pose: along the world's x and y (m), about its z (rad)."""

_UNBOUNDED = "1e9"


@dataclass(frozen=True)
class UrdfFile:
    """A URDF on disk, and where the meshes it names are looked for."""

    path: Path
    package_folders: tuple[Path, ...]

    def sha256(self) -> str:
        """Hash of the file's content, hexadecimal."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    def parse(self) -> ET.Element:
        """The ``<robot>`` element.

        Raises:
            SpecError: If the file cannot be read or is not the XML of a robot.
        """
        try:
            root = ET.parse(self.path).getroot()
        except OSError as error:
            raise SpecError(f"cannot read the URDF {self.path}: {error.strerror}") from error
        except ET.ParseError as error:
            raise SpecError(f"the URDF {self.path} is not valid XML: {error}") from error
        if root.tag != "robot":
            raise SpecError(f"the URDF {self.path} starts with <{root.tag}>, not with <robot>")
        return root


def urdf_of(spec: RobotSpec) -> UrdfFile:
    """The file that a robot's description points at.

    Raises:
        SpecError: If it does not exist.
    """
    source = spec.urdf
    if source.package is None:
        path = spec.folder / source.path
        packages = (path.parent, *path.parent.parents)
    else:
        share = _share_folder(spec.name, source.package)
        path = share / source.package / "robots" / source.path
        packages = (share,)
    if not path.is_file():
        raise SpecError(f"robot {spec.name!r}: field 'urdf.path': there is no URDF at {path}")
    return UrdfFile(path.resolve(), packages)


def _share_folder(robot: str, package: str) -> Path:
    """The ``share`` folder of a data package that ships no Python module."""
    site = Path(sysconfig.get_paths()["purelib"])
    candidates = [
        site / "cmeel.prefix" / "share",
        *(Path(entry).parents[2] / "share" for entry in _cmeel_paths()),
    ]
    for share in candidates:
        if (share / package).is_dir():
            return share
    raise SpecError(
        f"robot {robot!r}: field 'urdf.package': {package} is not installed (looked in "
        f"{', '.join(map(str, candidates))}); install it with: pip install {package}"
    )


def _cmeel_paths() -> list[str]:
    import pinocchio

    # .../cmeel.prefix/lib/pythonX.Y/site-packages/pinocchio/__init__.py
    return [str(Path(pinocchio.__file__).parents[1])]


def flat_urdf(urdf: UrdfFile, root_offset: Iterable[float]) -> str:
    """The URDF with planar base joints in front of its root, and without two-slot joints.

    A ``continuous`` joint becomes ``revolute`` with wide limits, since Pinocchio gives it two
    configuration slots (cos, sin) otherwise; ``floating`` and ``planar`` joints are refused.

    Args:
        urdf: The file.
        root_offset: Position of the root link's frame in the platform's frame (m): the platform's
            reference point on the ground is the frame's origin.

    Raises:
        SpecError: If the file cannot be parsed, has not exactly one root link, or a joint of a type
            or a mass that is not allowed.
    """
    robot = urdf.parse()
    for joint in robot.findall("joint"):
        kind = joint.get("type")
        name = joint.get("name")
        if name in BASE_JOINTS:
            raise SpecError(
                f"{urdf.path}: joint {name!r}: this name is kept for the platform's pose"
            )
        if kind not in ("fixed", "revolute", "prismatic", "continuous"):
            raise SpecError(
                f"{urdf.path}: joint {name!r} is {kind!r}; allowed: fixed, "
                "revolute, prismatic, continuous"
            )
        if kind == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", "-" + _UNBOUNDED)
            limit.set("upper", _UNBOUNDED)
    _check_masses(urdf, robot)
    parent = "world_of_mobman"
    ET.SubElement(robot, "link", name=parent)
    root = _root_link(urdf, robot, ignoring=parent)
    axes = ("1 0 0", "0 1 0", "0 0 1")
    for name, axis in zip(BASE_JOINTS, axes, strict=True):
        kind = "revolute" if name == "base_theta" else "prismatic"
        child = f"{name}_link"
        ET.SubElement(robot, "link", name=child)
        joint = ET.SubElement(robot, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        ET.SubElement(joint, "axis", xyz=axis)
        ET.SubElement(
            joint, "limit", lower="-" + _UNBOUNDED, upper=_UNBOUNDED, effort="0", velocity="0"
        )
        parent = child
    mount = ET.SubElement(robot, "joint", name="base_mount", type="fixed")
    ET.SubElement(mount, "parent", link=parent)
    ET.SubElement(mount, "child", link=root)
    ET.SubElement(mount, "origin", xyz=" ".join(repr(float(value)) for value in root_offset))
    return ET.tostring(robot, encoding="unicode")


def _check_masses(urdf: UrdfFile, robot: ET.Element) -> None:
    for link in robot.findall("link"):
        mass = link.find("inertial/mass")
        if mass is None:
            continue
        text = mass.get("value", "")
        try:
            allowed = 0.0 <= float(text) < math.inf
        except ValueError:
            allowed = False
        if not allowed:
            raise SpecError(
                f"{urdf.path}: link {link.get('name')!r}: its mass is {text!r}; allowed: a number, "
                "0 or more (kg)"
            )


def _root_link(urdf: UrdfFile, robot: ET.Element, ignoring: str) -> str:
    """The name of the link that is no joint's child."""
    children = set()
    for joint in robot.findall("joint"):
        child = joint.find("child")
        if child is None:
            raise SpecError(f"{urdf.path}: joint {joint.get('name')!r} has no <child>")
        children.add(child.get("link"))
    names = [link.get("name", "") for link in robot.findall("link")]
    roots = [name for name in names if name not in children and name != ignoring]
    if len(roots) != 1:
        raise SpecError(f"{urdf.path}: {len(roots)} root links ({', '.join(roots)}); allowed: one")
    return roots[0]
