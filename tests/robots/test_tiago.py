"""The TIAGo robots: what is locked, and whether wheel data and arms are what they should be."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm

ARM = [f"arm_{i}_joint" for i in range(1, 8)]
RIGHT = [f"arm_right_{i}_joint" for i in range(1, 8)]
LEFT = [f"arm_left_{i}_joint" for i in range(1, 8)]


@pytest.fixture(scope="module", params=["tiago", "tiago_no_hand", "tiago_dual"])
def any_tiago(request):
    return mm.load_robot(request.param)


def test_only_torso_and_arms_move(any_tiago):
    arms = [*RIGHT, *LEFT] if any_tiago.name == "tiago_dual" else ARM
    moving = {any_tiago.joint_names[i] for i in any_tiago.arm_index}
    assert moving == {"torso_lift_joint", *arms}


def test_wheel_data_are_the_pmb2s(any_tiago):
    assert np.isclose(any_tiago.platform.radius, 0.0985)
    assert np.isclose(any_tiago.platform.half_track, 0.2022, atol=5e-4)


def test_tip_hangs_on_the_last_joint_of_its_arm(any_tiago):
    last = "arm_right_7_joint" if any_tiago.name == "tiago_dual" else "arm_7_joint"
    frame = any_tiago.model.frames[any_tiago.model.getFrameId(any_tiago.tip)]
    assert any_tiago.model.names[frame.parentJoint] == last


def test_right_tip_of_the_dual_arm_does_not_mind_the_left_arm():
    robot = mm.load_robot("tiago_dual")
    columns = robot.tip_jacobian(robot.q_rest)
    left = [robot.joint_names.index(name) for name in LEFT]
    right = [robot.joint_names.index(name) for name in RIGHT]
    assert not columns[:, left].any()
    assert all(np.linalg.norm(columns[:, right], axis=0) > 0.1)


def test_locked_hand_keeps_its_mass():
    """What does not move still has to be carried."""
    import pinocchio as pin

    with_hand = pin.computeTotalMass(mm.load_robot("tiago").model)
    without = pin.computeTotalMass(mm.load_robot("tiago_no_hand").model)
    assert 0.5 < with_hand - without < 3.0
