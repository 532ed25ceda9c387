"""Robots of any number of joints: an arm chain on a differential base, for how cost grows.

The arm has always the same length and mass, however many links share them. Its axes alternate
(z, y, y, z, y, y, ...) and at rest it is bent forward at its y joints, away from singular postures.
"""

from __future__ import annotations

import math
from pathlib import Path

import mobman as mm
from mobman.model.mobile_manipulator import MobileManipulator

_REACH = 1.2  # m: all links together
_MASS = 8.0  # kg: the same
_RADIUS = 0.04  # m: of the links, which are rods; it keeps short ones from weightless turning
_SHRINK = 0.25  # mass of the last link over that of the first
_BEND = 2.0  # rad: by how much the tip points away from upright at rest, all y joints together
_MOUNT = 0.3  # m: height of the arm's foot
_WHEEL, _TRACK = 0.08, 0.4  # m: radius, distance of the wheels

_LINK = """
  <link name="{name}">
    <inertial>
      <origin xyz="0 0 {height:.9g}"/><mass value="{mass:.9g}"/>
      <inertia ixx="{xx:.9g}" iyy="{yy:.9g}" izz="{zz:.9g}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>"""
_JOINT = """
  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/><child link="{child}"/><origin xyz="{origin}"/><axis xyz="{axis}"/>{limit}
  </joint>"""
_LIMIT = '<limit lower="-3.1" upper="3.1" effort="100" velocity="10"/>'
_TOML = """
schema = 1
name = "{name}"
description = "Chain of {joints} joints on a differential base, for measurements"

[urdf]
path = "{name}.urdf"

[platform]
type = "differential"
right_wheel = "wheel_right"
left_wheel = "wheel_left"
wheel_radius = {wheel}

[arm]
tip = "tip"

[rest]
{rest}

[criterion]
platform = 0.001
default = 0.05
"""


def chain_robot(joints: int, folder: Path) -> MobileManipulator:
    """A robot with an arm of that many joints, nz = joints + 2.

    Args:
        joints: 3 or more.
        folder: For its files; they are read again when a run is recorded.
    """
    return mm.load_robot(write_chain(joints, folder))


def write_chain(joints: int, folder: Path) -> Path:
    """URDF and TOML of such a robot; the path of the TOML."""
    name = f"chain-{joints}"
    (folder / f"{name}.urdf").write_text(_urdf(name, joints))
    toml = folder / f"{name}.toml"
    rest = "\n".join(f"{_joint(i)} = {angle:.9g}" for i, angle in enumerate(_rest(joints)))
    toml.write_text(_TOML.format(name=name, joints=joints, wheel=_WHEEL, rest=rest))
    return toml


def _joint(i: int) -> str:
    return f"arm_{i + 1}"


def _turns_about_z(i: int) -> bool:
    return i % 3 == 0


def _rest(joints: int) -> list[float]:
    """Angles (rad): the y joints share the bend; the z joints turn to and fro a little."""
    bending = [i for i in range(joints) if not _turns_about_z(i)]
    return [
        0.2 * math.cos(math.pi * i / 3) if _turns_about_z(i) else _BEND / len(bending)
        for i in range(joints)
    ]


def _masses(joints: int) -> list[float]:
    """Of the links (kg), shrinking evenly along the chain."""
    shares = [1.0 - (1.0 - _SHRINK) * i / max(joints - 1, 1) for i in range(joints)]
    return [_MASS * share / sum(shares) for share in shares]


def _urdf(name: str, joints: int) -> str:
    length = _REACH / joints
    parts = [f'<robot name="{name}">', _link("platform", 25.0, 0.3, 0.25, 0.15, "z"), _wheels()]
    parent, origin = "platform", f"0.1 0 {_MOUNT:.9g}"
    for i, mass in enumerate(_masses(joints)):
        axis = "0 0 1" if _turns_about_z(i) else "0 1 0"
        link = f"link_{i + 1}"
        parts += [
            _link(link, mass, length, _RADIUS, 0.5 * length, "z"),
            _JOINT.format(
                name=_joint(i),
                kind="revolute",
                parent=parent,
                child=link,
                origin=origin,
                axis=axis,
                limit=_LIMIT,
            ),
        ]
        parent, origin = link, f"0 0 {length:.9g}"
    parts += [
        '\n  <link name="tip"/>',
        _JOINT.format(
            name="tip_mount",
            kind="fixed",
            parent=parent,
            child="tip",
            origin=origin,
            axis="0 0 1",
            limit="",
        ),
        "\n</robot>\n",
    ]
    return "".join(parts)


def _wheels() -> str:
    text = ""
    for side, sign in (("right", -1), ("left", 1)):
        text += _link(f"{side}_wheel", 1.5, 0.04, _WHEEL, 0.0, "y")
        text += _JOINT.format(
            name=f"wheel_{side}",
            kind="continuous",
            parent="platform",
            child=f"{side}_wheel",
            origin=f"0 {sign * _TRACK / 2:.9g} {_WHEEL:.9g}",
            axis="0 1 0",
            limit="",
        )
    return text


def _link(name: str, mass: float, length: float, radius: float, height: float, axis: str) -> str:
    """A homogeneous cylinder about its y or z axis, its centre at that height (m)."""
    along = 0.5 * mass * radius**2
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    yy, zz = (along, across) if axis == "y" else (across, along)
    return _LINK.format(name=name, mass=mass, height=height, xx=across, yy=yy, zz=zz)
