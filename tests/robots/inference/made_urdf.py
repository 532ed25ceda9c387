"""URDFs made for tests: mobile manipulators with the difficulties of real ones."""

from __future__ import annotations

import math
import struct
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

QUARTER = math.pi / 2
# how the joint's frame is turned so that a local axis is the root's y: rpy and the axis
TURNED = {
    "x": ((0, 0, QUARTER), "1 0 0"),
    "-x": ((0, 0, -QUARTER), "-1 0 0"),
    "y": ((0, 0, 0), "0 1 0"),
    "-y": ((0, 0, 0), "0 -1 0"),
    "z": ((-QUARTER, 0, 0), "0 0 1"),
    "-z": ((QUARTER, 0, 0), "0 0 1"),  # to the right: a positive rate rolls backward
}


def cylinder(radius, length=0.04, rpy=(0, 0, 0)):
    return ("cylinder", {"radius": radius, "length": length}, rpy)


def sphere(radius):
    return ("sphere", {"radius": radius}, (0, 0, 0))


def box(*size):
    return ("box", {"size": " ".join(map(str, size))}, (0, 0, 0))


def mesh(filename, scale=1.0):
    return ("mesh", {"filename": filename, "scale": f"{scale} {scale} {scale}"}, (0, 0, 0))


class Robot:
    """A URDF that grows."""

    def __init__(self, name="made", root="base_link", body=True):
        self.xml = ET.Element("robot", name=name)
        self.link(root, collision=[box(0.5, 0.3, 0.1)] if body else [], mass=20.0)

    def link(self, name, collision=(), visual=(), mass=1.0):
        link = ET.SubElement(self.xml, "link", name=name)
        if mass:
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value=str(mass))
            same = str(0.01 * mass)
            ET.SubElement(
                inertial, "inertia", ixx=same, iyy=same, izz=same, ixy="0", ixz="0", iyz="0"
            )
        for tag, shapes in (("visual", visual), ("collision", collision)):
            for kind, attributes, rpy in shapes:
                element = ET.SubElement(link, tag)
                ET.SubElement(element, "origin", xyz="0 0 0", rpy=_text(rpy))
                geometry = ET.SubElement(element, "geometry")
                ET.SubElement(geometry, kind, {k: str(v) for k, v in attributes.items()})
        return self

    def joint(
        self, name, kind, parent, child, xyz, rpy=(0, 0, 0), axis="0 0 1", limits=None, mimic=None
    ):
        joint = ET.SubElement(self.xml, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        ET.SubElement(joint, "origin", xyz=_text(xyz), rpy=_text(rpy))
        if kind != "fixed":
            ET.SubElement(joint, "axis", xyz=axis)
        if limits is not None:
            ET.SubElement(
                joint, "limit", lower=str(limits[0]), upper=str(limits[1]), effort="9", velocity="9"
            )
        if mimic is not None:
            follows = {"joint": mimic} if isinstance(mimic, str) else mimic
            ET.SubElement(joint, "mimic", {key: str(value) for key, value in follows.items()})
        return self

    def wheel(self, name, xyz, local="y", yaw=0.0, parent="base_link", **geometry):
        """A wheel whose axis is along the root's y, turned by ``yaw``; the geometry is the link's."""
        rpy, axis = TURNED[local]
        if not geometry:
            geometry = {"collision": [self.tyre(0.1, local)]}
        turned = (rpy[0], rpy[1], rpy[2] + yaw)
        self.link(f"{name}_link", **geometry)
        return self.joint(name, "continuous", parent, f"{name}_link", xyz, turned, axis)

    @staticmethod
    def tyre(radius, local="y"):
        """A cylinder along the local axis."""
        return cylinder(
            radius,
            rpy=(0, QUARTER, 0) if "x" in local else (QUARTER, 0, 0) if "y" in local else (0, 0, 0),
        )

    def caster(self, name, xyz, radius=0.04):
        """A wheel behind a swivel."""
        self.link(f"{name}_fork").joint(
            f"{name}_swivel", "continuous", "base_link", f"{name}_fork", xyz
        )
        return self.wheel(
            f"{name}_wheel", (-0.02, 0, 0), parent=f"{name}_fork", collision=[self.tyre(radius)]
        )

    def arm(
        self, prefix="", xyz=(0.15, 0, 0.1), joints=6, parent="base_link", tip=None, length=0.2
    ):
        """A serial arm: yaw, pitch, pitch, roll, pitch, roll, ..."""
        axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0"]
        at = xyz
        for i in range(joints):
            link = f"{prefix}arm_{i + 1}_link"
            self.link(link)
            self.joint(
                f"{prefix}arm_{i + 1}_joint",
                "revolute",
                parent,
                link,
                at,
                axis=axes[i],
                limits=(-2.5, 2.5),
            )
            parent, at = link, (0.0, 0, 0.15) if i == 0 else (length, 0, 0)
        if tip is not None:
            self.link(tip, mass=0).joint(f"{tip}_fixed", "fixed", parent, tip, (0.1, 0, 0))
        return self

    def fingers(self, palm, names=("finger_left", "finger_right"), mimic=True):
        for i, name in enumerate(names):
            follows = f"{names[0]}_joint" if mimic and i else None
            self.link(f"{name}_link", mass=0.1)
            self.joint(
                f"{name}_joint", "prismatic", palm, f"{name}_link", (0.05, 0.02 - 0.04 * i, 0),
                axis="0 1 0", limits=(0.0, 0.04), mimic=follows,
            )  # fmt: skip
        return self

    def write(self, path: Path) -> Path:
        path.write_text(ET.tostring(self.xml, encoding="unicode"), encoding="utf-8")
        return path


def differential(local="y", track=0.4, height=0.1, **kwargs) -> Robot:
    robot = Robot(**kwargs)
    root = kwargs.get("root", "base_link")
    robot.wheel("wheel_right_joint", (0, -track / 2, height), local, parent=root)
    return robot.wheel("wheel_left_joint", (0, track / 2, height), local, parent=root)


def four_wheels(
    names=("front_right", "front_left", "rear_right", "rear_left"), **geometry
) -> Robot:
    robot = Robot()
    for name in names:
        x = 0.2 if "front" in name else -0.2
        robot.wheel(f"{name}_wheel", (x, -0.25 if "right" in name else 0.25, 0.1), **geometry)
    return robot


def write_wheel_stl(path: Path, radius: float, width: float = 0.05, sides: int = 48) -> None:
    """A binary STL of a disc about z."""
    angles = np.linspace(0.0, 2 * math.pi, sides, endpoint=False)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])
    faces = []
    for i in range(sides):
        a, b = rim[i], rim[(i + 1) % sides]
        low, high = -width / 2, width / 2
        faces.append([(*a, low), (*b, low), (*b, high)])
        faces.append([(*a, low), (*b, high), (*a, high)])
        faces.append([(0, 0, high), (*a, high), (*b, high)])
        faces.append([(0, 0, low), (*b, low), (*a, low)])
    content = b"\0" * 80 + struct.pack("<I", len(faces))
    for face in faces:
        content += struct.pack("<12fH", 0, 0, 0, *np.ravel(face), 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def _text(values) -> str:
    return " ".join(repr(float(v)) for v in values)


def no_wheels() -> Robot:
    """A body with an arm and nothing that drives."""
    return Robot().arm(tip="tool0")


def car(axis="0 0 1") -> Robot:
    robot = Robot()
    for side, y in (("right", -0.25), ("left", 0.25)):
        robot.wheel(f"rear_{side}", (0, y, 0.1))
        robot.link(f"{side}_knuckle")
        robot.joint(
            f"{side}_steering",
            "revolute",
            "base_link",
            f"{side}_knuckle",
            (0.5, y, 0.1),
            axis=axis,
            limits=(-0.6, 0.6),
        )
        robot.wheel(f"front_{side}", (0, 0, 0), parent=f"{side}_knuckle")
    return robot


def three_omni_wheels() -> Robot:
    robot = Robot()
    for i in range(3):
        angle = 2 * math.pi * i / 3
        robot.wheel(
            f"drive_{i}",
            (0.2 * math.cos(angle), 0.2 * math.sin(angle), 0.1),
            yaw=angle - math.pi / 2,
        )
    return robot
