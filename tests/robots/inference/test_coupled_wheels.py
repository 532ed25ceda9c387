"""Wheels and knuckles that follow each other by <mimic>, as the platform has it or not."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from made_urdf import car, differential, four_wheels

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.errors import SpecError
from mobman.robots.urdf.read import UrdfSources

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def modules():
    robot = four_wheels(())
    for end, x in (("front", 0.3), ("rear", -0.3)):
        for side, y in (("right", -0.2), ("left", 0.2)):
            name = f"{end}_{side}"
            robot.link(f"{name}_fork").joint(
                f"{name}_turn", "revolute", "base_link", f"{name}_fork", (x, y, 0.1),
                limits=(-1.6, 1.6),
            )  # fmt: skip
            robot.wheel(f"{name}_wheel", (0, 0, 0), parent=f"{name}_fork")
    return robot


def loaded(robot, path, *laws, **facts):
    """The robot of a made URDF with joints that follow others, an arm on it."""
    robot.arm(tip="tool0")
    for joint, of, ratio in laws:
        element = next(one for one in robot.xml.iter("joint") if one.get("name") == joint)
        ET.SubElement(element, "mimic", joint=of, multiplier=str(ratio))
    return mm.load_robot(robot.write(path / "robot.urdf"), **facts)


KEPT = {
    "sides of one gear each": (
        four_wheels,
        [("rear_right_wheel", "front_right_wheel", 1), ("rear_left_wheel", "front_left_wheel", 1)],
    ),
    "a telescope of the arm": (differential, [("arm_3_joint", "arm_2_joint", -0.5)]),
}
NOT_KEPT = {
    "a rigid axle": (differential, [("wheel_right_joint", "wheel_left_joint", 1)]),
    "sides of two rates": (four_wheels, [("rear_right_wheel", "front_right_wheel", 0.5)]),
    "both axles steered by one motor": (
        modules,
        [("rear_right_turn", "front_right_turn", -1), ("rear_left_turn", "front_left_turn", -1)],
    ),
    "a wheel that an arm turns": (differential, [("wheel_right_joint", "arm_1_joint", 1)]),
    "a front wheel that turns as a rear one": (car, [("front_right", "rear_right", 1)]),
}


@pytest.mark.parametrize("case", KEPT)
def test_what_the_platform_has_is_taken(tmp_path, case):
    made, laws = KEPT[case]
    robot = loaded(made(), tmp_path, *laws)
    q = robot.consistent(robot.q_rest + 0.1)
    rates = dict(zip(robot.joint_names, robot.velocity_map(q), strict=True))
    for joint, of, ratio in laws:
        assert rates[joint] == pytest.approx(ratio * rates[of])
    (finding,) = run_checks(robot, only=("following",))
    assert finding.status == "ok"
    assert laws[0][0] in finding.found


@pytest.mark.parametrize("case", NOT_KEPT)
def test_what_it_has_not_is_refused(tmp_path, case):
    made, laws = NOT_KEPT[case]
    joint, of, _ratio = laws[0]
    sides = {}
    if made is differential:  # a wheel that follows no wheel is none unless it is named
        sides = {"right_wheels": "wheel_right_joint", "left_wheels": "wheel_left_joint"}
    with pytest.raises(SpecError) as refused:
        loaded(made(), tmp_path, *laws, **sides)
    said = str(refused.value)
    assert joint in said
    assert of in said
    assert "<mimic>" in said
    assert "remove <mimic>" in said


def test_the_check_compares_the_equations_with_the_urdf(tmp_path):
    robot = loaded(differential(), tmp_path)
    (file,) = robot.urdf.files
    law = b'<mimic joint="wheel_left_joint" multiplier="2"/>'
    at = file.content.index(b"/>", file.content.index(b'name="wheel_right_joint"')) + 2
    robot.urdf = UrdfSources((replace(file, kept=file.content[:at] + law + file.content[at:]),))
    (finding,) = run_checks(robot, only=("following",))
    assert finding.status == "wrong"
    assert "wheel_right_joint" in finding.found
    assert "2 of its rate" in finding.found
