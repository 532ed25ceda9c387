"""Sizes that cannot be, and wheels that are not on one ground: asked for, said, and written down."""

from __future__ import annotations

import pytest
from made_urdf import Robot, differential, four_wheels

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.errors import UsageError
from mobman.robots.infer.findings import Undecided

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def scaled(robot, factor, *, part=""):
    """A made robot with all lengths of its joints and shapes (or those that a name has) scaled."""
    for element in robot.xml:
        if part not in element.get("name", ""):
            continue
        for one in element.iter():
            for field in ("xyz", "size", "radius", "length"):
                if one.tag != "axis" and field in one.attrib:
                    lengths = (factor * float(number) for number in one.get(field).split())
                    one.set(field, " ".join(map(repr, lengths)))
    return robot


ODD = {
    "all in millimetres": (lambda: scaled(differential().arm(tip="tool0"), 1e3), "would be 100 m"),
    "the arm in millimetres": (
        lambda: scaled(differential().arm(tip="tool0"), 1e3, part="arm"), "the arm would reach"
    ),
    "the arm in inches": (
        lambda: scaled(differential().arm(tip="tool0"), 39.37, part="arm"), "the arm would reach"
    ),
    "a base alone on its foot in millimetres": (
        lambda: scaled(Robot().arm(tip="tool0"), 1e3), "the arm would reach"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_another_unit_is_asked_for(inferred, tmp_path, case):
    made, said = ODD[case]
    platform = "fixed" if "foot" in case else None
    with pytest.raises(Undecided, match=f"{said}.*is it in millimetres.*--as-it-is"):
        inferred(made(), platform=platform)
    urdf = made().write(tmp_path / "a.urdf")
    with pytest.raises(UsageError, match="is it in millimetres"):
        mm.load_robot(urdf, platform=platform)
    assert inferred(made(), platform=platform, as_it_is=True).arm.reach > 20.0


def test_what_is_written_all_the_same_is_called_wrong(tmp_path):
    urdf = scaled(differential().arm(tip="tool0"), 1e3).write(tmp_path / "a.urdf")
    robot = mm.load_robot(urdf, as_it_is=True)
    found = run_checks(robot, simulation=False, only=("wheel-radius", "reach"))
    assert {one.check for one in found if one.status == "wrong"} == {"wheel-radius", "reach"}


@pytest.mark.parametrize("lower", ["front", "rear"])
def test_of_pairs_at_two_heights_the_lower_one_drives(inferred, lower):
    robot = four_wheels()
    for joint in robot.xml.iter("joint"):
        if lower not in joint.get("name"):
            origin = joint.find("origin")
            x, y, _ = origin.get("xyz").split()
            origin.set("xyz", f"{x} {y} 0.12")
    found = inferred(robot.arm(tip="tool0"))
    assert [w.name for w in found.platform.driven] == [
        f"{lower}_right_wheel",
        f"{lower}_left_wheel",
    ]


def test_wheels_above_a_low_caster_are_named(inferred):
    robot = differential().caster("caster", (-0.2, 0, 0.0)).arm(tip="tool0")
    with pytest.raises(Undecided) as asked:
        inferred(robot)
    text = str(asked.value)
    for word in ("wheel_right_joint", "wheel_left_joint", "40 mm above", "caster_wheel"):
        assert word in text
    sides = {"right_wheels": ("wheel_right_joint",), "left_wheels": ("wheel_left_joint",)}
    assert inferred(robot, **sides).platform.type.value == "differential"
