"""A description that is not valid is refused: file, field, what was found, what is allowed."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.variants import ROBOTS, description, toml, youbot_urdf, youbot_with_urdf

import mobman as mm
from mobman.errors import SpecError

JOINTS = ["phi_1", "phi_2", "y_1", "y_2", "y_3"]

# what is changed: what the message must name (field, what was found, what is allowed)
WRONG = {
    "unknown field": (
        {"colour": "red"},
        ["'colour'", "unknown", "schema", "name", "urdf", "platform", "arm", "rest", "criterion"],
    ),
    "unknown field of a table": ({"urdf__pth": "x"}, ["'urdf.pth'", "path", "package", "lock"]),
    "unknown field of the platform's type": (
        {"platform__radius": 0.05},
        ["[platform]", "'radius'", "wheel_radius", "half_track"],
    ),
    "missing field": ({"urdf__path": None}, ["'urdf.path'", "missing"]),
    "missing field of the platform's type": (
        {"platform__wheel_radius": None},
        ["[platform]", "'wheel_radius'", "missing"],
    ),
    "schema of a later version": ({"schema": 2}, ["'schema'", "2", "1"]),
    "name that is no file name": ({"name": "a/b"}, ["'name'", "'a/b'"]),
    "no urdf": ({"urdf__path": "none.urdf"}, ["'urdf.path'", "none.urdf"]),
    "unknown data package": (
        {"urdf__package": "ros-data"},
        ["'urdf.package'", "'ros-data'", "'example-robot-data'"],
    ),
    "wheel that is no joint": (
        {"platform__right_wheel": "wheel"},
        ["'platform.right_wheel'", "'wheel'", *JOINTS],
    ),
    "wheel about a vertical axis": (
        {"platform__left_wheel": "y_1"},
        ["'platform.left_wheel'", "'y_1'", "[ 0.  0. -1.]", "y axis"],
    ),
    "wheels mixed up": (
        {"platform__right_wheel": "phi_2", "platform__left_wheel": "phi_1"},
        ["[platform]", "'phi_2'", "'phi_1'", "left one's y be the larger"],
    ),
    "no wheel radius to speak of": (
        {"platform__wheel_radius": 0},
        ["'wheel_radius'", "0", "greater than 0"],
    ),
    "unknown alpha": (
        {"platform__alpha": "wheels"},
        ["'alpha'", "'wheels'", "'wheel-rates'", "'paper'"],
    ),
    "lock that matches nothing": ({"urdf__lock": ["hand_*"]}, ["'urdf.lock'", "'hand_*'", *JOINTS]),
    "locked wheel": ({"urdf__lock": ["phi_*"]}, ["'urdf.lock'", "phi_1", "phi_2"]),
    "locked arm": (
        {"urdf__lock": ["y_*"]},
        ["'urdf.lock'", "no joint is left for the arm"],
    ),
    "tip that is no link": ({"arm__tip": "hand"}, ["'arm.tip'", "'hand'", "arm_3", "tip"]),
    "rest beyond a limit": ({"rest__y_2": 2.0}, ["'rest.y_2'", "2", "-1.5708 to 1.5708"]),
    "rest of no joint": ({"rest__y_4": 0.0}, ["'rest'", "'y_4'", *JOINTS]),
    "rest that is no number": ({"rest__y_2": float("nan")}, ["'rest.y_2'", "nan", "finite"]),
    "criterion of no joint": (
        {"criterion__weights": {"y_4": 1.0}},
        ["'criterion.weights'", "'y_4'", *JOINTS],
    ),
    "negative criterion": (
        {"criterion__weights": {"y_1": -1.0}},
        ["'criterion.weights.y_1'", "-1", "above 0"],
    ),
    "text for a number": ({"criterion__platform": "big"}, ["'criterion.platform'", "'big'"]),
}


@pytest.mark.parametrize("what", WRONG)
def test_message_names_field_found_and_allowed(what):
    changes, named = WRONG[what]
    with pytest.raises(SpecError) as caught:
        mm.load_robot(description(**changes))
    message = str(caught.value)
    assert "\n" not in message
    for text in named:
        assert text in message


@pytest.mark.parametrize("what", [key for key in WRONG if key not in ("rest that is no number",)])
def test_message_names_the_robot_or_its_file(what, tmp_path):
    changes, _ = WRONG[what]
    content = description(**changes)
    if content["urdf"].get("path") == "youbot.urdf":
        content["urdf"]["path"] = str(ROBOTS / "youbot.urdf")
    file = tmp_path / "mine.toml"
    file.write_text(toml(content), encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        mm.load_robot(file)
    assert str(file) in str(caught.value) or "'youbot'" in str(caught.value)


def test_all_wrong_fields_are_told_at_once():
    with pytest.raises(SpecError) as caught:
        mm.load_robot(description(colour="red", criterion__default=-1.0, arm__tip=None))
    for field in ("'colour'", "'criterion.default'", "'arm.tip'"):
        assert field in str(caught.value)


def test_unknown_platform_type_is_answered_with_the_known_ones():
    with pytest.raises(
        SpecError, match=r"'platform.type': unknown platform type 'diferential'; did you mean 'diff"
    ):
        mm.load_robot(description(platform__type="diferential"))


def test_file_that_is_not_there(tmp_path):
    file = tmp_path / "none.toml"
    with pytest.raises(SpecError, match=f"{re.escape(str(file))}: No such file"):
        mm.load_robot(file)


@pytest.mark.parametrize(
    "text", ["schema = 1\nname ?", "<robot/>", "\x00\x01", "name = 'a'\nname = 'b'"]
)
def test_file_that_is_not_toml(tmp_path, text):
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError, match=r"bad\.toml is not valid TOML: "):
        mm.load_robot(file)


def test_file_that_is_not_even_text(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_bytes(b"\xff\xfe\x80")
    with pytest.raises(SpecError, match=r"bad\.toml is not valid TOML: "):
        mm.load_robot(file)


def test_registering_refuses_what_loading_would():
    with pytest.raises(SpecError, match="'colour'"):
        mm.register_robot(description(colour="red"))
    assert "colour" not in mm.list_robots()


BAD_URDFS = {
    "no XML": ("<robot name='r'><link", "not valid XML"),
    "no robot": ("<sdf/>", "starts with <sdf>, not with <robot>"),
    "two roots": (
        youbot_urdf().replace("</robot>", '<link name="loose"/></robot>'),
        "2 root links (platform, loose); allowed: one",
    ),
    "floating joint": (
        youbot_urdf().replace('name="tip_mount" type="fixed"', 'name="tip_mount" type="floating"'),
        "'tip_mount' is 'floating'; allowed: fixed, revolute, prismatic, continuous",
    ),
    "joint with a name that is kept": (
        youbot_urdf().replace('"tip_mount"', '"base_theta"'),
        "'base_theta': this name is kept",
    ),
    "joint without a child": (
        youbot_urdf().replace('<child link="arm_3"/>', ""),
        "y_3",
    ),
    "no inertia": (
        re.sub(r"<inertial>.*?</inertial>", "", youbot_urdf(), flags=re.DOTALL),
        "M is not positive definite",
    ),
}


@pytest.mark.parametrize("what", BAD_URDFS)
def test_bad_urdf_is_refused_with_the_reason(what, tmp_path):
    text, reason = BAD_URDFS[what]
    with pytest.raises(SpecError, match=re.escape(reason)):
        mm.load_robot(youbot_with_urdf(tmp_path, text))


@pytest.mark.parametrize("what", BAD_URDFS)
def test_bad_urdf_is_named(what, tmp_path):
    """The message says which file is meant: the URDF, or the robot's description."""
    text, _ = BAD_URDFS[what]
    with pytest.raises(SpecError) as caught:
        mm.load_robot(youbot_with_urdf(tmp_path, text))
    assert "changed.urdf" in str(caught.value) or "'youbot'" in str(caught.value)


def test_joint_that_follows_another_has_no_motor(tmp_path):
    text = (ROBOTS / "youbot.urdf").read_text()
    limit = '<limit lower="-2.5482"'
    assert limit in text
    (tmp_path / "a.urdf").write_text(text.replace(limit, '<mimic joint="y_2"/>' + limit))
    with pytest.raises(SpecError, match=r"\[rest\]: y_3 is .*; allowed with the other coordinates"):
        mm.load_robot({**description(urdf__path="a.urdf"), "folder": tmp_path})
    rest = {name: value for name, value in description()["rest"].items() if name != "y_3"}
    robot = mm.load_robot({**description(urdf__path="a.urdf"), "folder": tmp_path, "rest": rest})
    assert (robot.nz, robot.k) == (4, 4)
    assert robot.velocity_names[-1] == "y_2"
    y_2, y_3 = (robot.joint_names.index(name) for name in ("y_2", "y_3"))
    assert robot.q_rest[y_3] == robot.q_rest[y_2]
    held = {**description(urdf__path="a.urdf", urdf__lock=["y_3"]), "folder": tmp_path}
    assert mm.load_robot(held).nz == 4


def test_tip_that_the_arm_does_not_move_is_refused():
    with pytest.raises(SpecError, match="'wheel_1', which no joint of the arm moves"):
        mm.load_robot(description(arm__tip="wheel_1"))


@pytest.mark.parametrize("mass", ["-2.496", "nan", "inf", "heavy", ""])
def test_mass_that_cannot_be_names_its_link(tmp_path, mass):
    text = (ROBOTS / "youbot.urdf").read_text()
    (tmp_path / "a.urdf").write_text(text.replace('<mass value="2.496"', f'<mass value="{mass}"'))
    with pytest.raises(SpecError) as caught:
        mm.load_robot({**description(urdf__path="a.urdf"), "folder": tmp_path})
    for part in ("a.urdf", "'arm_3'", repr(mass), "0 or more"):
        assert part in str(caught.value)


def test_links_that_are_offered_as_tips_are_those_of_the_urdf():
    links = re.findall(r'<link name="([^"]+)"', youbot_urdf())
    with pytest.raises(SpecError) as caught:
        mm.load_robot(description(arm__tip="tpi"))
    offered = re.search(r"its links: ([^;]*)", str(caught.value))
    assert offered is not None
    assert offered[1].split(", ") == links


def test_velocities_without_inertia_are_named_by_their_share(monkeypatch):
    """Those that take part by more than 0.3 in the direction that has none."""
    direction = np.array([0.8, 0.34, 0.29, 0.29, 0.0])
    direction[-1] = np.sqrt(1.0 - direction @ direction)
    monkeypatch.setattr(
        mm.MobileManipulator,
        "reduced_inertia",
        lambda robot, q: np.eye(5) - 1.5 * np.outer(direction, direction),
    )
    with pytest.raises(mm.MobmanError, match=r"at rest: moving alpha_1, alpha_2 meets no inertia"):
        mm.load_robot("youbot")
