"""Every check fires on a robot that is wrong in its way, and does not on one that is not."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from support.variants import description, youbot_urdf, youbot_with_urdf

import mobman as mm
from mobman.checks.checks import list_checks, run_checks

WHEEL_MASS = '<mass value="1.4"/>'
ARM_3 = '<mass value="2.496"/>'
ARM_3_MOMENTS = 'ixx="0.0016" iyy="0.0118" izz="0.0118"'
LIMIT_2 = '<limit lower="-1.5708" upper="1.5708" effort="9.5" velocity="1.5708"/>'
TIP = '<link name="tip"/>'
WHEEL_SHAPE = '<geometry><cylinder radius="0.05" length="0.044"/></geometry>'
_MASSES = dict.fromkeys(re.findall(r'<mass value="([^"]*)"', youbot_urdf()))
WHEEL_1 = re.search(r'<link name="wheel_1">.*?</link>', youbot_urdf(), re.DOTALL).group()


def without_inertial(text):
    return re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)


# what is done to the youBot: replacements in its URDF, changes of its TOML; what is found, and the
# words of what is found and of the fix
FIRES = {
    "track that is not the URDF's": (
        {}, {"platform__half_track": 0.079},
        "constraints", "warning", ["phi_1", "turns"], ["platform.half_track", "0.158"],
    ),
    "radius far from the wheel's": (
        {}, {"platform__wheel_radius": 0.06},
        "wheel-radius", "wrong", ["phi_1", "0.06", "0.05 m in the collision"],
        ["platform.wheel_radius", "0.05", "wheel_1"],
    ),
    "radius a little off": (
        {}, {"platform__wheel_radius": 0.0525},
        "wheel-radius", "warning", ["phi_2", "0.0525"], ["platform.wheel_radius"],
    ),
    "wheels without geometry": (
        {WHEEL_1: re.sub(r"<(visual|collision)>.*?</\1>", "", WHEEL_1)}, {},
        "wheel-radius", "warning", ["phi_1", "no round geometry"], ["data sheet"],
    ),
    "wheel named for the other side": (
        {'"phi_2"': '"left_wheel"', '"phi_1"': '"right_wheel"'},
        {"platform__heading": math.pi, "platform__right_wheel": "left_wheel",
         "platform__left_wheel": "right_wheel"},
        "ground", "warning", ["left_wheel", "on the right"], ["platform.heading"],
    ),
    "bumper in the ground": (
        {'<box size="0.57 0.36 0.10"/>': '<box size="0.57 0.36 0.2"/>'}, {},
        "ground", "warning", ["platform", "-16 mm"], ["<origin>"],
    ),
    "chassis far in the ground": (
        {'<box size="0.57 0.36 0.10"/>': '<box size="0.57 0.36 0.4"/>'}, {},
        "ground", "wrong", ["platform", "-116 mm"], ["platform.wheel_radius"],
    ),
    "arm in the ground": (
        {}, {"rest__y_2": 1.2},
        "ground", "warning", ["arm_3"], ["[rest]"],
    ),
    "wheels of 100 kg": (
        {WHEEL_MASS: '<mass value="100"/>'}, {},
        "inertias", "warning", ["wheel_1", "100 kg for"], ["<mass>", "changed.urdf", "grams"],
    ),
    "wheels heavier than the chassis": (
        {WHEEL_MASS: '<mass value="100"/>'}, {},
        "inertias", "warning", ["heavier than the chassis", "19.8"], ["wheel_1", "changed.urdf"],
    ),
    "arm of feathers": (
        {ARM_3: '<mass value="0.035"/>'}, {},
        "inertias", "warning", ["arm_3", "0.035 kg"], ["<mass>", "changed.urdf"],
    ),
    "wheels without mass": (
        {WHEEL_1: without_inertial(WHEEL_1)}, {},
        "inertias", "warning", ["moves without mass", "wheel_1"], ["<inertial>", "changed.urdf"],
    ),
    "negative moment": (
        {f'{ARM_3_MOMENTS} ixy="0"': f'{ARM_3_MOMENTS} ixy="0.02"'}, {},
        "inertias", "wrong", ["negative", "arm_3"], ["<inertia>", "changed.urdf"],
    ),
    "no moments": (
        {ARM_3_MOMENTS: 'ixx="0" iyy="0" izz="0"'}, {},
        "inertias", "warning", ["without all moments", "y_3"], ["<inertia>", "arm_3"],
    ),
    "moments of no body": (
        {ARM_3_MOMENTS: 'ixx="0.0016" iyy="0.0118" izz="0.118"'}, {},
        "inertias", "warning", ["add up", "arm_3"], ["<inertia>", "changed.urdf"],
    ),
    "centre of mass in millimetres": (
        {'<origin xyz="0.181 0 0"/>': '<origin xyz="181 0 0"/>'}, {},
        "inertias", "warning", ["centre of mass", "arm_3"], ["<origin>", "changed.urdf"],
    ),
    "link of micrograms": (
        {ARM_3: '<mass value="1e-12"/>', ARM_3_MOMENTS: 'ixx="1e-15" iyy="1e-15" izz="1e-15"'}, {},
        "inertias", "warning", ["'y_3' feels an inertia of"], ["<inertial>", "changed.urdf"],
    ),
    "next to nothing between two joints on one axis": (
        {'<mass value="1.39"/>': '<mass value="1e-13"/>',
         'ixx="0.0029525" iyy="0.0060091" izz="0.0058821"': 'ixx="1e-13" iyy="1e-13" izz="1e-13"',
         '<origin xyz="0.033 0 0"/><axis xyz="0 1 0"/>':
         '<origin xyz="0 0 0"/><axis xyz="0 0 1"/>'}, {},
        "inertias", "wrong", ["condition"], ["<inertial>", "changed.urdf"],
    ),
    "moments without mass": (
        {TIP: '<link name="tip"><inertial><mass value="0"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
              'iyz="0" izz="1"/></inertial></link>'}, {},
        "inertias", "warning", ["moments of inertia without mass", "tip"], ["<mass>", "changed.urdf"],
    ),
    "a robot of grams": (
        {f'<mass value="{mass}"/>': '<mass value="0.001"/>' for mass in _MASSES}, {},
        "inertias", "warning", ["the robot weighs 0.0", "kg in all"], ["<mass>", "changed.urdf"],
    ),
    "rest in degrees where there is no limit": (
        {LIMIT_2: LIMIT_2.replace('"-1.5708"', '"-inf"').replace('"1.5708"', '"inf"', 1)},
        {"rest__y_2": 90.0},
        "limits", "warning", ["y_2", "rests at 90 rad"], ["rest.y_2", "degrees"],
    ),
    "no effort": (
        {LIMIT_2: LIMIT_2.replace("9.5", "0")}, {},
        "limits", "warning", ["no effort", "y_2"], ["effort", "<limit>"],
    ),
    "no velocity": (
        {LIMIT_2: LIMIT_2.replace('velocity="1.5708"', 'velocity="0"')}, {},
        "limits", "warning", ["no velocity", "y_2"], ["velocity", "<limit>"],
    ),
    "joint that cannot move": (
        {LIMIT_2: LIMIT_2.replace("-1.5708", "0").replace("1.5708", "0", 1)}, {"rest__y_2": 0.0},
        "limits", "wrong", ["y_2", "cannot move"], ["<limit", "urdf.lock"],
    ),
    "rest at a limit": (
        {}, {"rest__y_2": -1.57},
        "limits", "warning", ["at a limit", "y_2", "-1.57"], ["[rest]"],
    ),
    "limits in degrees": (
        {LIMIT_2: LIMIT_2.replace("1.5708", "90")}, {},
        "limits", "warning", ["y_2", "90 rad"], ["degrees"],
    ),
    "velocity in degrees": (
        {LIMIT_2: LIMIT_2.replace('velocity="1.5708"', 'velocity="180"')}, {},
        "limits", "warning", ["y_2", "180 rad/s"], ["degrees"],
    ),
    "missing mesh": (
        {TIP: '<link name="tip"><visual><geometry><mesh filename="package://none/a.stl"/></geometry>'
              "</visual></link>"}, {},
        "meshes", "warning", ["1 mesh missing", "package://none/a.stl", "tip", "visual"],
        ["urdf.packages"],
    ),
    "tip below the ground": (
        {}, {"rest__y_2": 1.2},
        "reach", "wrong", ["tip", "below the ground"], ["[rest]"],
    ),
    "tip in the chassis": (
        {'<origin xyz="0.342 0 0"/>': '<origin xyz="-0.53 0 -0.14"/>'},
        {"rest__y_2": 0.0, "rest__y_3": 0.0},
        "reach", "warning", ["inside the box", "platform"], ["[rest]", "arm.tip"],
    ),
    "arm straight up": (
        {}, {"rest__y_2": -math.pi / 2, "rest__y_3": 0.0},
        "singularities", "wrong", ["singular at rest"], ["[rest]"],
    ),
    "weights of no size": (
        {}, {"criterion__platform": 1e-12, "criterion__default": 1e-12,
             "criterion__weights": {"y_1": 1.0}},
        "singularities", "warning", ["the criterion", "nearly singular at rest"], ["[criterion]"],
    ),
    "weights of the paper": (
        {}, {"criterion__platform": 0.001, "criterion__default": 0.05, "criterion__wheels": 0.05},
        "weights", "warning", ["after 100 m", "'phi_1'", "'base_x'"], ["'heading' to 1e-09"],
    ),
    "heading that is held too hard": (
        {}, {"criterion__heading": 0.5},
        "weights", "warning", ["badly conditioned", "0.5 could be 1e-09"], ["'heading' to 1e-09"],
    ),
    "posture that the motors cannot hold": (
        {}, {},
        "gravity", "warning", ["cannot hold", "y_2", "9.5 N m"], ["[rest]", "effort", "youbot.urdf"],
    ),
    "wheels out of balance": (
        {'<inertial>\n      <mass value="1.4"/>':
         '<inertial><origin xyz="0.01 0 0"/>\n      <mass value="1.4"/>'}, {},
        "gravity", "warning", ["drives the platform", "alpha_1"], ["wheels", "changed.urdf"],
    ),
    "run that asks too much": (
        {}, {},
        "closed-loop", "warning", ["effort", "y_2"], ["effort", "youbot.urdf"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", FIRES)
def test_check_fires_with_what_is_found_and_a_fix(what, tmp_path):
    replaced, changes, check, status, found, fix = FIRES[what]
    text = youbot_urdf()
    for old, new in replaced.items():
        assert old in text, old
        text = text.replace(old, new)
    content = youbot_with_urdf(tmp_path, text, **changes) if replaced else description(**changes)
    findings = run_checks(mm.load_robot(content), only=[check])
    matching = [
        item
        for item in findings
        if item.check == check
        and item.status == status
        and all(word in item.found for word in found)
        and all(word in item.fix for word in fix)
    ]
    assert matching, findings


@pytest.mark.parametrize(
    ("name", "check"),
    [
        *(("youbot", check) for check in (
            "constraints", "derivatives", "ground", "inertias", "meshes", "reach", "singularities",
            "weights", "wheel-radius",
        )),
        ("husky_ur5", "closed-loop"),
        *(("tiago_no_hand", check) for check in ("gravity", "limits", "meshes")),
    ],
)  # fmt: skip
def test_check_does_not_fire_where_nothing_is_wrong(name, check):
    findings = run_checks(mm.load_robot(name), only=[check])
    assert findings
    assert {item.status for item in findings} == {"ok"}, findings


def test_every_check_fires_somewhere_and_is_silent_somewhere():
    """So that a new check comes with its own."""
    # test_platforms.py here, tests/simulation/test_singular_runs.py, tests/model/test_followers.py,
    # tests/robots/inference/test_real_files.py
    elsewhere = {"criterion", "derivatives", "fold", "following", "urdf"}
    assert {row[2] for row in FIRES.values()} | elsewhere == {item.name for item in list_checks()}


def test_robots_that_come_with_mobman_have_nothing_wrong(robot):
    findings = run_checks(robot, simulation=robot.name == "youbot")
    assert [item for item in findings if item.status == "wrong"] == []
    assert all(bool(item.fix) == (item.status != "ok") for item in findings)


def test_no_robot_that_comes_with_mobman_is_called_singular(robot):
    """All of them follow the circle, with weights of wheels that are small by design."""
    only = ["singularities", "criterion", "weights"]
    assert [item.status for item in run_checks(robot, only=only)] == ["ok"] * 3


def test_factor_on_all_weights_changes_no_conditioning():
    changes = {
        "criterion__platform": 1e-11,
        "criterion__default": 5e-10,
        "criterion__weights": {"y_1": 1e-12},
    }
    findings = run_checks(mm.load_robot(description(**changes)), only=["singularities"])
    assert [item.status for item in findings] == ["ok"]


@pytest.mark.parametrize("kind", ["continuous", "revolute"])
def test_wheels_with_huge_limits_are_not_in_degrees(tmp_path, kind):
    limit = '<limit lower="-1e6" upper="1e6" effort="5" velocity="20"/>'
    text, count = re.subn(
        r'(<joint name="phi_\d" type=")continuous(">.*?)</joint>',
        lambda found: f"{found[1]}{kind}{found[2]}{limit}</joint>",
        youbot_urdf(),
        flags=re.DOTALL,
    )
    assert count == 2
    findings = run_checks(mm.load_robot(youbot_with_urdf(tmp_path, text)), only=["limits"])
    assert [item.status for item in findings] == ["ok"], findings


def test_gravity_that_does_not_pull_down():
    robot = mm.load_robot("youbot")
    robot.model.gravity.linear = np.array([9.81, 0.0, 0.0])
    findings = run_checks(robot, only=["gravity"])
    assert any(item.status == "wrong" and "gravity is [9.81" in item.found for item in findings)


def test_gravity_term_that_is_no_gradient(monkeypatch):
    robot = mm.load_robot("youbot")
    own = robot.dynamics
    monkeypatch.setattr(
        robot, "dynamics", lambda q, z: own(q, z)._replace(bias=own(q, z).bias + 1.0)
    )
    findings = run_checks(robot, only=["gravity"])
    assert any(item.status == "wrong" and "gradient" in item.found for item in findings)


def test_run_that_diverges_is_wrong(monkeypatch):
    """As it is where the law's gains do not cover the robot."""
    from mobman.checks import closed_loop

    own = closed_loop.simulate
    monkeypatch.setattr(
        closed_loop,
        "simulate",
        lambda robot, _, task, duration: own(
            robot,
            mm.make_controller("tsm", discretization="explicit", a=1e-3),
            task,
            duration=duration,
            dt=1e-2,
        ),
    )
    (finding,) = run_checks(mm.load_robot("youbot"), only=["closed-loop"])
    assert finding.status == "wrong"
    assert "diverged at t =" in finding.found
