"""Robots of every platform type, described by numbers, under one small arm."""

from __future__ import annotations

from typing import Any

import pytest

import mobman as mm

_AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "0 0 1")
_LINK = """
<joint name="a{i}" type="revolute">
  <parent link="{parent}"/><child link="l{i}"/><origin xyz="0 0 {offset}"/><axis xyz="{axis}"/>
  <limit lower="-2.8" upper="2.8" effort="100" velocity="3"/>
</joint>
<link name="l{i}">
  <inertial>
    <origin xyz="0 0 0.1"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/>
  </inertial>
  <collision><origin xyz="0 0 0.1"/><geometry><box size="0.06 0.06 0.2"/></geometry></collision>
</link>"""


def arm_urdf(joints: int = 6) -> str:
    """An arm with links of 0.2 m."""
    links = [
        _LINK.format(
            i=i, parent=f"l{i - 1}" if i > 1 else "root", offset=0.2 if i > 1 else 0.05, axis=axis
        )
        for i, axis in enumerate(_AXES[:joints], start=1)
    ]
    tool = (
        f'<link name="tool"/><joint name="t" type="fixed"><parent link="l{joints}"/>'
        '<child link="tool"/><origin xyz="0 0 0.2"/></joint>'
    )
    return f'<robot name="arm"><link name="root"/>{"".join(links)}{tool}</robot>'


_BODY = {"mass": 40.0, "size": (0.6, 0.4, 0.2), "ground_clearance": 0.05}
_WHEELED = {
    **_BODY,
    "wheel_mass": 1.5,
    "wheel_width": 0.05,
    "wheel_velocity": 20.0,
    "wheel_effort": 40.0,
}
PLATFORMS: dict[str, dict[str, Any]] = {
    "unicycle": {"type": "unicycle", "body": _BODY},
    "planar": {"type": "planar", "body": _BODY},
    "differential": {
        "type": "differential",
        "wheel_radius": 0.08,
        "half_track": 0.25,
        "body": _WHEELED,
    },
    "skid-steer": {
        "type": "skid-steer",
        "wheel_radius": 0.1,
        "half_track": 0.25,
        "track_factor": 1.4,
        "body": {**_WHEELED, "wheelbase": 0.4},
    },
    "car-like": {
        "type": "car-like",
        "wheel_radius": 0.1,
        "half_track": 0.25,
        "wheelbase": 0.5,
        "body": {**_WHEELED, "steering_limit": 0.6, "knuckle_mass": 0.5},
    },
    "mecanum": {
        "type": "omnidirectional",
        "kind": "mecanum",
        "wheel_radius": 0.1,
        "body": {**_WHEELED, "wheelbase": 0.4, "half_track": 0.25},
    },
    "omni": {
        "type": "omnidirectional",
        "kind": "omni",
        "wheel_radius": 0.1,
        "body": {**_WHEELED, "circle": 0.3, "angles": [0.0, 2.0944, 4.1888]},
    },
    "swerve": {
        "type": "swerve",
        "wheel_radius": 0.1,
        "body": {**_WHEELED, "wheelbase": 0.4, "half_track": 0.25, "module_mass": 1.0},
    },
    "turret": {
        "type": "turret",
        "wheel_radius": 0.1,
        "half_track": 0.2,
        "offset": 0.11,
        "body": {**_WHEELED, "carriage_mass": 5.0},
    },
    "fixed": {"type": "fixed"},
}


@pytest.fixture(scope="session")
def on_platform(tmp_path_factory):
    """(platform, joints of the arm, further fields) to a robot with the arm on its deck."""
    folder = tmp_path_factory.mktemp("arms")

    def make(platform, joints=6, **fields):
        (folder / f"arm_{joints}.urdf").write_text(arm_urdf(joints), encoding="utf-8")
        bent = {"a2": 0.6, "a3": 1.2, "a4": 0.2, "a5": 0.5}
        return mm.load_robot(
            {
                "schema": 1,
                "name": "made",
                "folder": folder,
                "platform": PLATFORMS[platform] if isinstance(platform, str) else platform,
                "mount": [{"path": f"arm_{joints}.urdf", "parent": "deck"}],
                "arm": {"tip": "tool"},
                "rest": {name: value for name, value in bent.items() if int(name[1]) <= joints},
                **fields,
            }
        )

    return make
