"""Details of platforms that no identity of A and N shows."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.platforms import PLATFORMS, on

import mobman as mm
from mobman.errors import SpecError
from mobman.model.platforms import custom


def _frame(robot, link):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_rest)
    return data.oMf[robot.model.getFrameId(link, pin.FrameType.BODY)]


@pytest.mark.parametrize("name", PLATFORMS)
def test_deck_looks_where_the_platform_looks(name):
    """What is mounted on it is not turned."""
    robot = mm.load_robot(on(name))
    platform, deck = _frame(robot, "platform"), _frame(robot, "deck")
    assert np.allclose(deck.rotation, platform.rotation, atol=1e-12)
    height = 0.12 + 0.25
    assert deck.translation[2] == pytest.approx(height, abs=1e-12)


def test_short_car():
    """Its steering joints are less than half a metre ahead of the rear axle."""
    robot = mm.load_robot(on("car-like", wheelbase=0.2))
    q = np.zeros(robot.nq)
    delta = robot.joint_names.index("steering_right")
    q[delta] = 0.1
    n = robot.velocity_map(q)
    x1, theta = (robot.joint_names.index(joint) for joint in ("base_x", "base_theta"))
    # theta' = v tan(delta)/L, whichever of the two steering angles delta is, to first order
    assert n[theta, 0] / n[x1, 0] == pytest.approx(np.tan(0.1) / 0.2, rel=0.15)


def test_reference_point_of_omnidirectional_wheels_is_their_middle():
    for name in ("mecanum", "omni"):
        robot = mm.load_robot(on(name))
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, robot.q_rest)
        wheels = [
            data.oMi[robot.model.getJointId(wheel.joint)].translation
            for wheel in robot.platform.wheels
        ]
        base = robot.q_rest[[robot.joint_names.index(joint) for joint in ("base_x", "base_y")]]
        assert np.allclose(np.mean(wheels, axis=0)[:2], base, atol=1e-12)
        assert np.allclose(np.mean(wheels, axis=0)[2], robot.platform.wheels[0].radius)


@pytest.mark.parametrize(
    ("platform", "field", "reason"),
    [
        ("differential", "half_track", "[platform.body] has no URDF to read it from"),
        ("mecanum", "body.wheelbase", "mecanum"),
    ],
)
def test_field_that_a_platform_by_numbers_needs(platform, field, reason):
    content = on(platform)
    table = content["platform"] = {**content["platform"], "body": {**PLATFORMS[platform]["body"]}}
    *parents, last = field.split(".")
    for parent in parents:
        table = table[parent]
    del table[last]
    with pytest.raises(SpecError, match=rf"field 'platform\.{field}' is missing: ") as caught:
        mm.load_robot(content)
    assert reason in str(caught.value).rpartition(" is missing: ")[2]


_FRONT = ["wheel_front_right", "wheel_front_left"]
_MODULES = [f"{end}_{hand}" for end in ("front", "rear") for hand in ("left", "right")]


@pytest.mark.parametrize(
    ("platform", "fields", "words"),
    [
        (
            "omni",
            {"body.angles": [0.0, 2.0]},
            "'platform.body.angles' gives wheel_1, wheel_2; .*three",
        ),
        (
            "omni",
            {"wheels": ["wheel_1", "wheel_2", "wheel_2"]},
            "'platform.wheels' gives .*three or",
        ),
        ("omni", {"body.angles": [0.0, 0.0, 2.0]}, "leave a direction of motion free"),
        ("omni", {"body.angles": [0, 120, 240]}, "'body.angles.1' is 120: must be an angle in rad"),
        ("unicycle", {"heading": 90}, "'heading' is 90: must be an angle in rad"),
        ("omni", {"wheels": ["universe"]}, "no movable joint 'universe'; it has: .*wheel_1"),
        ("mecanum", {"roller_angles": [0.7, 0.7]}, "'platform.roller_angles' has 2 numbers for 4"),
        ("mecanum", {"roller_angles": [np.pi / 4] * 4}, "leave a direction of motion free"),
        ("mecanum", {"roller_angles": [np.pi / 2, 0.7, -0.7, 0.7]}, "none at a right angle"),
        ("mecanum", {"heading": 0.7}, "'platform.roller_angles' is missing"),
        (
            "swerve",
            {"body.circle": 0.3, "body.angles": [1.0]},
            "'platform.body.angles' .*two or more",
        ),
        (
            "swerve",
            {"steering": ["steering_front_left"]},
            "'platform.steering' gives .*two or more",
        ),
        (
            "swerve",
            {"body.circle": 0.3, "body.angles": [1.0, 1.0]},
            "'steering_1' and 'steering_2' are at one place",
        ),
        ("swerve", {"wheels": ["wheel_front_left"]}, "names none behind 'steering_front_right'"),
        (
            "swerve",
            {"steering": ["steering_front_left", "steering_rear_left"]},
            "'wheel_front_right' is carried by 0 of",
        ),
        ("swerve", {"steering": ["wheel_front_left"]}, "axis .* a steering joint's is vertical"),
        ("swerve", {"wheels": ["steering_front_left"]}, "axis .* a wheel's is horizontal"),
        (
            "swerve",
            {"wheels": [f"wheel_{place}" for place in (*_MODULES, _MODULES[0])]},
            "joint 'wheel_front_left' is there twice",
        ),
        ("turret", {"turret": "shoulder_pan_joint"}, "does not carry the wheels; .*'differential'"),
        ("car-like", {"front_wheels": _FRONT[:1]}, "'front_wheels' is .*1 joints; allowed: 2"),
        ("car-like", {"steering": ["steering_right"] * 2}, "'steering_right' is there twice"),
        (
            "car-like",
            {"steering": ["shoulder_pan_joint"], "body.centre": [-0.3, 0.0]},
            "m ahead of the rear axle; allowed: one",
        ),
        (
            "car-like",
            {"front_wheels": ["wheel_rear_right", "wheel_rear_left"]},
            "'wheel_rear_right' is there twice",
        ),
        (
            "skid-steer",
            {"right_wheels": _FRONT[:1] * 2, "left_wheels": _FRONT[1:] * 2},
            "'wheel_front_right' is there twice",
        ),
    ],
)
def test_platforms_that_cannot_be_are_refused(platform, fields, words):
    content = on(platform)
    content["platform"] = own = {**content["platform"], "body": {**content["platform"]["body"]}}
    for field, value in fields.items():
        *parents, last = field.split(".")
        (own["body"] if parents else own)[last] = value
    with pytest.raises(SpecError, match=rf"robot '{content['name']}': .*{words}"):
        mm.load_robot(content)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"trail": -0.05},
            "'wheel_1' is .0.0500 m ahead of the axis of 'steer_1'; allowed: beside",
        ),
        (
            {"yaw": 0.3},
            "'wheel_1b' rolls in another direction than the other wheels behind 'steer_1'",
        ),
    ],
)
def test_wheels_that_are_no_modules_are_refused(tmp_path, change, words):
    """Two steering joints with two wheels each, the first one's as ``change`` says."""
    trail, yaw = change.get("trail", 0.0), change.get("yaw", 0.0)
    parts = []
    for i, (x, y) in enumerate([(0.2, 0.3), (-0.2, -0.3)], start=1):
        parts.append(("steer", f"{i}", "base", (x, y, 0.15), 0.0, "0 0 1"))
        for name, side, turned in (("", 0.04, 0.0), ("b", -0.04, yaw)):
            place = (trail, side, 0.0)
            parts.append(("wheel", f"{i}{name}", f"steer_{i}_link", place, turned, "0 1 0"))
    parts.append(("arm", "1", "base", (0.0, 0.0, 0.3), 0.0, "0 0 1"))
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    )
    xml = [f'<robot name="r"><link name="base">{inertial}</inertial></link>']
    for kind, number, parent, xyz, turned, axis in parts:
        name, at = f"{kind}_{number}", " ".join(map(str, xyz))
        xml.append(
            f'<link name="{name}_link">{inertial}</inertial></link><joint name="{name}" '
            f'type="continuous"><parent link="{parent}"/><child link="{name}_link"/>'
            f'<origin xyz="{at}" rpy="0 0 {turned}"/><axis xyz="{axis}"/></joint>'
        )
    (tmp_path / "r.urdf").write_text("".join([*xml, "</robot>"]), encoding="utf-8")
    names = {f"{kind}_{number}" for kind, number, *_ in parts}
    platform = {"type": "swerve", "wheel_radius": 0.15}
    for field, kind in (("steering", "steer"), ("wheels", "wheel")):
        platform[field] = sorted(name for name in names if name.startswith(kind))
    content = {"schema": 1, "name": "r", "platform": platform, "arm": {"tip": "arm_1_link"}}
    with pytest.raises(SpecError, match=rf"field 'platform.wheels': {words}"):
        mm.load_robot({**content, "urdf": {"path": "r.urdf"}, "folder": tmp_path})


def test_second_derivatives_of_a_users_functions_are_exact_to_rounding():
    """The truncation is 2e-15 of the tenth derivative, which sin(3 x) has 3^10 of."""
    at, along = np.array([0.4]), np.array([1.0])
    found = custom._twice(lambda x: np.sin(3.0 * x), at, along)
    assert found == pytest.approx(-9.0 * np.sin(1.2), abs=4e-15 * 3.0**10)
    first = custom._along(lambda x: np.sin(3.0 * x), at, along)
    assert first == pytest.approx(3.0 * np.cos(1.2), abs=1e-14 * 3.0**9)
