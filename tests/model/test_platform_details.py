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


def test_second_derivatives_of_a_users_functions_are_exact_to_rounding():
    """The truncation is 2e-15 of the tenth derivative, which sin(3 x) has 3^10 of."""
    at, along = np.array([0.4]), np.array([1.0])
    found = custom._twice(lambda x: np.sin(3.0 * x), at, along)
    assert found == pytest.approx(-9.0 * np.sin(1.2), abs=4e-15 * 3.0**10)
    first = custom._along(lambda x: np.sin(3.0 * x), at, along)
    assert first == pytest.approx(3.0 * np.cos(1.2), abs=1e-14 * 3.0**9)
