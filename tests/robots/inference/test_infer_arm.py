"""The arm, its tip, what is locked, and the rest posture."""

from __future__ import annotations

import math
from fnmatch import fnmatchcase

import numpy as np
import pytest
from made_urdf import Robot, differential
from support.differences import jacobian

from mobman.robots.incoming.describe import patterns
from mobman.robots.infer.findings import Undecided
from mobman.robots.infer.kinematics import Chain, Tree


def reasons(found):
    return {joint: lock.why for lock in found.locks for joint in lock.joints}


def test_one_arm_is_taken_with_the_frame_named_for_it(inferred):
    robot = differential().arm(tip="tool0")
    robot.link("camera_optical_frame").joint(
        "camera_fixed", "fixed", "arm_6_link", "camera_optical_frame", (0, 0, 0.1)
    )
    found = inferred(robot)
    assert found.arm.tip.value == "tool0"
    assert [joint.name for joint in found.arm.joints] == [f"arm_{i}_joint" for i in range(1, 7)]
    assert found.arm.reach == pytest.approx(0.15 + 4 * 0.2 + 0.1)
    assert found.locks == ()


def test_without_a_named_frame_the_last_link_is_the_tip(inferred):
    assert inferred(differential().arm()).arm.tip.value == "arm_6_link"


def test_a_frame_between_the_fingers_is_better_than_their_base(inferred):
    robot = differential().arm(tip="ee_arm_link").fingers("ee_arm_link")
    robot.link("ee_gripper_link", mass=0)
    robot.joint("ee_fixed", "fixed", "ee_arm_link", "ee_gripper_link", (0.08, 0, 0))
    assert inferred(robot).arm.tip.value == "ee_gripper_link"


@pytest.mark.parametrize("mimic", [True, False])
def test_fingers_are_locked_and_their_palm_is_the_tip(inferred, mimic):
    robot = differential().arm(tip="gripper_base").fingers("gripper_base", mimic=mimic)
    found = inferred(robot)
    assert found.arm.tip.value == "gripper_base"
    assert reasons(found) == {"finger_left_joint": "fingers", "finger_right_joint": "fingers"}


def test_fingers_without_telling_names_and_of_several_joints(inferred):
    robot = differential().arm()
    for i in range(3):
        robot.link(f"p{i}", mass=0.1).link(f"d{i}", mass=0.1)
        robot.joint(
            f"a{i}", "revolute", "arm_6_link", f"p{i}", (0.04, 0.02 * i, 0), limits=(0, 1.2)
        )
        robot.joint(f"b{i}", "revolute", f"p{i}", f"d{i}", (0.04, 0, 0), limits=(0, 1.2))
    found = inferred(robot)
    assert found.arm.tip.value == "arm_6_link"
    assert set(reasons(found)) == {f"{letter}{i}" for letter in "ab" for i in range(3)}
    assert len(found.arm.joints) == 6


def test_a_wrist_that_carries_a_fixed_jaw_belongs_to_the_arm(inferred):
    robot = differential().arm(joints=4).link("fixed_jaw").link("moving_jaw")
    robot.joint(
        "wrist_roll",
        "revolute",
        "arm_4_link",
        "fixed_jaw",
        (0.1, 0, 0),
        axis="1 0 0",
        limits=(-3, 3),
    )
    robot.joint("grip", "revolute", "fixed_jaw", "moving_jaw", (0.03, 0, 0), limits=(0, 1.5))
    found = inferred(robot)
    assert [joint.name for joint in found.arm.joints][-1] == "wrist_roll"
    assert reasons(found) == {"grip": "fingers"}


def torso(robot):
    robot.link("torso")
    return robot.joint(
        "torso_lift", "prismatic", "base_link", "torso", (0, 0, 0.3), limits=(0.0, 0.4)
    )


def test_a_head_is_locked_and_a_lift_belongs_to_the_arm(inferred):
    robot = torso(differential()).arm(parent="torso", tip="tool0")
    robot.link("pan").link("head_camera")
    robot.joint("head_pan", "revolute", "torso", "pan", (0, 0, 0.5), limits=(-1, 1))
    robot.joint(
        "head_tilt", "revolute", "pan", "head_camera", (0, 0, 0.1), axis="0 1 0", limits=(-1, 1)
    )
    found = inferred(robot)
    assert found.arm.joints[0].name == "torso_lift"
    assert reasons(found) == {"head_pan": "head", "head_tilt": "head"}


def dual():
    robot = torso(differential())
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.arm(f"{side}_", (0.1, y, 0.3), parent="torso", tip=f"{side}_tool0")
    return robot


def test_two_arms_ask_for_a_tip(inferred):
    with pytest.raises(Undecided) as caught:
        inferred(dual())
    for word in ("--tip", "right_tool0", "left_tool0", "7 joints", "6 of its own", "reach 1.05 m"):
        assert word in str(caught.value)


def test_the_other_arm_is_locked_by_a_pattern_of_its_own(inferred):
    found = inferred(dual(), tip="right_tool0")
    assert [joint.name for joint in found.arm.joints] == [
        "torso_lift",
        *(f"right_arm_{i}_joint" for i in range(1, 7)),
    ]
    (lock,) = found.locks
    assert "another arm" in lock.why
    assert patterns(lock.joints, found.joints) == ["left_arm_*"]


def test_what_is_asked_for_comes_in_one_message(inferred):
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.arm(f"{side}_", (0.1, y, 0.3))
    with pytest.raises(Undecided, match=r"--right-wheel.*--platform.*; and .*--tip"):
        inferred(robot)


@pytest.mark.parametrize(
    ("tip", "message"), [("nothing", "is no link"), ("base_link", "is moved by no joint")]
)
def test_a_tip_that_cannot_be(inferred, tip, message):
    with pytest.raises(Undecided, match=f"--tip '{tip}' {message}.*tool0"):
        inferred(differential().arm(tip="tool0"), tip=tip)


def test_no_arm(inferred):
    with pytest.raises(Undecided, match="no arm was found"):
        inferred(differential())


def telescope():
    """A lift, four slides one after the other towards the right, a wrist."""
    robot = differential().link("lift")
    robot.joint("lift_joint", "prismatic", "base_link", "lift", (0, 0, 0.2), limits=(0.0, 1.1))
    parent = "lift"
    for i in range(4):
        robot.link(f"slide_{i}")
        robot.joint(
            f"slide_{i}_joint",
            "prismatic",
            parent,
            f"slide_{i}",
            (0, -0.01, 0),
            axis="0 -1 0",
            limits=(0.0, 0.13),
        )
        parent = f"slide_{i}"
    robot.link("wrist").link("grasp_center", mass=0)
    robot.joint("wrist_yaw", "revolute", parent, "wrist", (0.05, -0.1, 0), limits=(-1.75, 4.0))
    return robot.joint("grasp_fixed", "fixed", "wrist", "grasp_center", (0.2, 0, 0))


def test_a_telescoping_arm(inferred):
    found = inferred(telescope())
    assert len(found.arm.joints) == 6
    assert found.arm.tip.value == "grasp_center"
    slides = [found.rest[f"slide_{i}_joint"].value for i in range(4)]
    assert all(0.02 < value < 0.11 for value in slides)
    # a slide's whole way weighs as much as a radian
    assert found.weights["slide_0_joint"].value == pytest.approx(0.05 / 0.13**2, rel=0.05)


def test_mimic_joints_that_follow_the_arm_are_free(inferred):
    """And what they follow rests where they are inside their limits."""
    robot = torso(differential()).link("cover")
    robot.joint(
        "cover_joint",
        "prismatic",
        "torso",
        "cover",
        (0, 0, 0),
        limits=(0.1, 0.4),
        mimic="torso_lift",
    )
    found = inferred(robot.arm(parent="torso"))
    assert found.following == ("cover_joint",)
    assert "cover_joint" not in reasons(found) | found.rest
    assert 0.1 < found.rest["torso_lift"].value < 0.4


def test_locks_of_the_user_come_on_top(inferred):
    found = inferred(torso(differential()).arm(parent="torso"), lock=("torso_*",))
    assert found.arm.joints[0].name == "arm_1_joint"
    assert reasons(found) == {"torso_lift": "as asked for"}


def placed(found, tmp_path):
    tree = Tree(found.urdf.parse(), found.urdf)
    chain = Chain(tree, found.arm.joints, found.arm.tip.value, {})
    return chain, np.array([[found.rest[joint.name].value for joint in found.arm.joints]])


@pytest.mark.parametrize(
    "build",
    [
        lambda: differential().arm(tip="tool0"),
        telescope,
        lambda: torso(differential()).arm(parent="torso", joints=7),
    ],
)
def test_rest_is_inside_the_limits_regular_and_above_the_ground(inferred, tmp_path, build):
    found = inferred(build())
    for joint in found.arm.joints:
        value = found.rest[joint.name].value
        assert joint.lower + 0.05 * joint.width < value < joint.upper - 0.05 * joint.width
    chain, q = placed(found, tmp_path)
    values = np.linalg.svd(chain.places(q)[3][0], compute_uv=False)
    some = np.random.default_rng(1).uniform(-0.5, 0.5, (200, q.shape[1]))
    zero = np.linalg.svd(chain.places(0 * q)[3][0], compute_uv=False)[2]
    assert values[2] > max(0.1, zero), some.shape
    _, _, tip, _ = chain.places(q)
    assert tip[0, 2] > 0.2
    assert tip[0, 0] > -0.1


def test_rest_is_the_same_every_time(inferred):
    one, other = (inferred(differential().arm(tip="tool0")).rest for _ in range(2))
    assert one == other


def test_chain_agrees_with_pinocchio(inferred, tmp_path):
    import pinocchio as pin

    found = inferred(torso(differential()).arm(parent="torso", tip="tool0"))
    chain, _ = placed(found, tmp_path)
    model = pin.buildModelFromUrdf(str(found.urdf.path))
    data = model.createData()
    q = np.random.default_rng(3).uniform(-1.0, 1.0, len(found.arm.joints))
    whole = pin.neutral(model)
    columns = []
    for joint, value in zip(found.arm.joints, q, strict=True):
        own = model.joints[model.getJointId(joint.name)]
        whole[own.idx_q] = value
        columns.append(own.idx_v)
    frame = model.getFrameId("tool0")
    jacobian = pin.computeFrameJacobian(model, data, whole, frame, pin.LOCAL_WORLD_ALIGNED)
    pin.updateFramePlacements(model, data)
    assert chain.places(q[None])[2][0] == pytest.approx(data.oMf[frame].translation, abs=1e-12)
    assert chain.places(q[None])[3][0] == pytest.approx(jacobian[:3, columns], abs=1e-12)


@pytest.mark.parametrize(
    ("wanted", "others", "expected"),
    [
        (["hand_thumb_joint", "hand_index_joint"], ["arm_joint"], ["hand_*"]),
        (["l_arm_1", "l_arm_2"], ["l_leg", "r_arm_1"], ["l_arm_*"]),
        (["fl_caster_wheel", "br_caster_wheel"], ["fl_wheel", "x"], ["*_caster_wheel"]),
        (["a", "b"], ["c"], ["a", "b"]),
        (["odd[1]_x", "odd[1]_y"], ["odd1_x"], ["odd[[]1]_*"]),
        (["j1", "j2"], ["j3"], ["j1", "j2"]),
    ],
)
def test_patterns(wanted, others, expected):
    found = patterns(wanted, [*wanted, *others])
    assert found == expected
    for name in (*wanted, *others):
        assert any(fnmatchcase(name, pattern) for pattern in found) == (name in wanted)


def test_held_joints_with_odd_limits(inferred):
    robot = differential().arm(tip="tool0").link("flap")
    robot.joint(
        "flap_joint",
        "revolute",
        "base_link",
        "flap",
        (0, 0, 0.2),
        axis="0 1 0",
        limits=(-2.0, -0.5),
    )
    found = inferred(robot)
    assert found.rest["flap_joint"].value == -0.5
    assert math.isfinite(found.rest["arm_1_joint"].value)


def following(multiplier, limits=(0.0, 0.3)):
    """A telescope whose second slide follows the first."""
    robot = torso(differential()).link("inner").link("outer")
    robot.joint(
        "inner_joint", "prismatic", "torso", "inner", (0, 0, 0), axis="1 0 0", limits=(0.0, 0.3)
    )
    robot.joint(
        "outer_joint", "prismatic", "inner", "outer", (0, 0, 0), axis="1 0 0", limits=limits,
        mimic={"joint": "inner_joint", "multiplier": multiplier, "offset": 0.01},
    )  # fmt: skip
    return robot.arm(parent="outer", xyz=(0.1, 0, 0), joints=4, tip="tool0")


@pytest.mark.parametrize(("multiplier", "limits"), [(0.5, (0.0, 0.3)), (3.0, (0.0, 0.1))])
def test_a_telescope_keeps_its_reach(inferred, multiplier, limits):
    found, stiff = inferred(following(multiplier, limits)), inferred(following(0.0, limits))
    assert found.following == ("outer_joint",)
    assert found.uncertain == ()
    assert 0.0 <= multiplier * found.rest["inner_joint"].value + 0.01 <= limits[1]
    way = min(0.3 * multiplier, limits[1])
    assert found.arm.reach == pytest.approx(stiff.arm.reach + way)


def test_a_mimic_joint_is_held_where_a_locked_master_takes_it(inferred):
    found = inferred(following(0.5), lock=("inner_joint",))
    assert found.rest["outer_joint"].value == pytest.approx(0.01)
    (doubt,) = found.uncertain
    assert "outer_joint follows inner_joint by <mimic>" in doubt
    assert "takes 0.15 m of reach" in doubt


def test_a_levelled_wrist_keeps_its_tip(inferred):
    """What is behind a mimic joint at the end of an arm is the arm's, too."""
    robot = differential().arm(joints=3).link("level").link("tool0")
    robot.joint(
        "level_joint", "revolute", "arm_3_link", "level", (0.2, 0, 0), axis="0 1 0",
        limits=(-2.0, 2.0), mimic={"joint": "arm_3_joint", "multiplier": -1.0},
    )  # fmt: skip
    found = inferred(robot.joint("t", "fixed", "level", "tool0", (0.1, 0, 0)))
    assert found.arm.tip.value == "tool0"
    assert [joint.name for joint in found.arm.joints] == [f"arm_{i}_joint" for i in (1, 2, 3)]
    assert found.following == ("level_joint",)
    (doubt,) = inferred(robot, lock=("arm_3_joint",), tip="tool0").uncertain
    assert "level_joint follows arm_3_joint by <mimic>" in doubt
    assert "takes 4 rad of turning" in doubt


def test_mimic_joints_beside_the_arm_take_nothing_of_it(inferred):
    found = inferred(differential().arm(tip="tool0").fingers("tool0"))
    assert found.uncertain == ()


def test_a_circle_of_mimic_joints_ends(inferred):
    robot = differential().arm(tip="tool0")
    for one, other in (("a", "b"), ("b", "a")):
        robot.link(f"flap_{one}")
        robot.joint(
            one, "revolute", "base_link", f"flap_{one}", (0, 0, 0.2), axis="0 1 0",
            limits=(-1, 1), mimic={"joint": other, "offset": 0.25},
        )  # fmt: skip
    assert all(abs(inferred(robot).rest[name].value) <= 1.0 for name in "ab")


def test_chains_agree_with_pinocchio(inferred):
    import pinocchio as pin

    found = inferred(following(0.5))
    joints = found.arm.joints
    chain = Chain(Tree(found.urdf.parse(), found.urdf), joints, "tool0", {})
    model = pin.buildModelFromUrdf(str(found.urdf.path))
    data, q = model.createData(), pin.neutral(model)
    values = np.random.default_rng(2).uniform(-1.0, 1.0, len(joints))
    names = [joint.name for joint in joints]
    outer = 0.5 * values[names.index("inner_joint")] + 0.01
    for name, value in zip([*names, "outer_joint"], [*values, outer], strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    expected = data.oMf[model.getFrameId("tool0")].translation
    assert chain.places(values[None])[2][0] == pytest.approx(expected, abs=1e-12)
    moved = chain.places(values[None])[3][0]
    slopes = jacobian(lambda at: chain.places(at[None])[2][0], values, 1e-3)
    assert moved == pytest.approx(slopes, abs=1e-9)


def test_a_tip_is_better_than_the_jaw_that_it_is_on(inferred):
    robot = differential().arm(joints=5, tip="gripper_jaw").link("moving_jaw")
    robot.joint("grip", "revolute", "gripper_jaw", "moving_jaw", (0.03, 0, 0), limits=(0, 1.5))
    robot.link("jaw_tip", mass=0).joint("tip_f", "fixed", "gripper_jaw", "jaw_tip", (0.1, 0, 0))
    assert inferred(robot).arm.tip.value == "jaw_tip"


def test_an_arm_of_one_joint(inferred):
    found = inferred(differential().arm(joints=1, tip="tool0"), platform="fixed", lock=("wheel_*",))
    assert [joint.name for joint in found.arm.joints] == ["arm_1_joint"]


def test_a_robot_of_one_joint(inferred):
    robot = Robot().arm(joints=1, tip="tool0")
    assert inferred(robot, platform="fixed").arm.reach == pytest.approx(0.1)


def with_a_gauge(robot):
    """Behind the last joint a gauge that turns between 0 and 0, and a tool on it."""
    robot.link("gauge").link("tool0")
    robot.joint("gauge_joint", "revolute", "arm_5_link", "gauge", (0.1, 0, 0), limits=(0, 0))
    return robot.joint("tool_fixed", "fixed", "gauge", "tool0", (0.1, 0, 0))


def test_limits_that_leave_no_way_fix_a_joint(inferred):
    found = inferred(with_a_gauge(differential().arm(joints=5)))
    assert [joint.name for joint in found.arm.joints] == [f"arm_{i}_joint" for i in range(1, 6)]
    assert found.arm.tip.value == "tool0"
    assert reasons(found) == {"gauge_joint": "both limits are 0"}
    (doubt,) = found.uncertain
    assert "gauge_joint cannot move" in doubt


def test_limits_that_nobody_has_written_fix_nothing(inferred):
    robot = with_a_gauge(differential().arm(joints=5))
    for limit in robot.xml.iter("limit"):
        limit.attrib.update(lower="0", upper="0")
    assert len(inferred(robot).arm.joints) == 6


def test_an_arm_that_no_limit_lets_move_is_told_as_such(inferred):
    robot = torso(differential()).arm(parent="torso", joints=3)
    for limit in list(robot.xml.iter("limit"))[1:]:
        limit.attrib.update(lower="0", upper="0")
    with pytest.raises(Undecided, match=r"no arm was found.*arm_1_joint, .* both limits are 0"):
        inferred(robot, lock=("torso_lift",))


def test_what_turns_between_no_limits_may_be_a_wheel_or_a_finger(inferred):
    robot = Robot().arm(tip="gripper_base").fingers("gripper_base", mimic=False)
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.link(f"{side}_wheel_link", collision=[Robot.tyre(0.1)])
        robot.joint(
            f"{side}_wheel", "revolute", "base_link", f"{side}_wheel_link", (0, y, 0.1),
            axis="0 1 0", limits=(0, 0),
        )  # fmt: skip
    for limit in robot.xml.iter("limit"):
        if limit.get("lower") == "0.0":
            limit.set("upper", "0")
    found = inferred(robot)
    assert found.platform.type.value == "differential"
    assert set(reasons(found).values()) == {"fingers"}
    assert found.arm.tip.value == "gripper_base"


def test_the_point_between_the_fingers_is_better_than_their_base(inferred):
    """As MuJoCo's models of grippers call it."""
    robot = (
        differential().arm(tip="gripper_base").fingers("gripper_base").link("pinch_site", mass=0)
    )
    robot.joint("site_fixed", "fixed", "arm_6_link", "pinch_site", (0.2, 0, 0))
    assert inferred(robot).arm.tip.value == "pinch_site"
