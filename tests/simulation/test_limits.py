"""The robot's own limits in metrics, words and reports."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.runs import Torque

import mobman as mm
from mobman.simulation.limits import ALLOWED, limit_remarks, limits_in_the_way
from mobman.simulation.scenario import Scenario


def _run(robot, function, duration=0.05, **fields):
    return mm.simulate(robot, Torque(function), "circle", duration=duration, **fields)


def _push(robot, size):
    """What holds the robot at rest, and as much again as some accelerations."""
    _, bias, b = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    hold = np.linalg.solve(b, bias)
    push = size * robot.motor_inertia(robot.q_rest)
    return lambda t: hold + push


def test_metrics_are_those_of_the_urdfs_numbers(robot):
    """Against the definitions, tick by tick, with the model's own numbers."""
    record = _run(robot, _push(robot, 300.0))
    model, stated = robot.model, lambda x: np.where((x <= 0.0) | (x > 1e8), np.inf, x)
    excess = np.maximum(model.lowerPositionLimit - record.q, record.q - model.upperPositionLimit)
    rate_limit = stated(model.velocityLimit)
    for name in robot.platform.base_joints:
        rate_limit[robot.joint_names.index(name)] = np.inf
    rates = np.array([robot.velocity_map(q) @ z for q, z in zip(record.q, record.z, strict=True)])
    speed = (np.abs(rates) / rate_limit).max(axis=1)
    effort = (np.abs(record.torque) / robot.limits.torque).max(axis=1)
    found = record.metrics
    assert found["position_limit_excess"] == pytest.approx(max(excess.max(), 0.0))
    assert found["velocity_limit_ratio"] == pytest.approx(speed.max())
    assert found["torque_limit_ratio"] == pytest.approx(effort.max())
    beyond = (excess.max(axis=1) > 0.0) | (speed > 1.0) | (effort > 1.0)
    assert found["time_beyond_limits"] == pytest.approx(beyond.mean())
    assert speed.max() > 1.0  # so that it is no comparison of zeros
    # an arm's joint is as fast as its own entry of z
    arm = np.abs(record.z[:, robot.n_alpha :]) / robot.limits.velocity[robot.n_alpha :]
    assert found["velocity_limit_ratio"] >= arm.max() * (1 - 1e-12)


def test_robot_within_its_limits_has_nothing_to_say(youbot):
    record = _run(youbot, _push(youbot, 0.0), duration=0.01)
    assert youbot.limits.torque[2] < 9.55  # the youBot of the paper cannot hold its own arm
    assert [r.split(" reached ")[0] for r in limit_remarks(record, youbot)] == ["y_2"]
    still = mm.load_robot("tiago_no_hand")
    record = _run(still, _push(still, 0.0), duration=0.01)
    assert all(record.metrics[name] <= most for name, most in ALLOWED.items())
    assert 0.0 < record.metrics["torque_limit_ratio"] <= 1.0
    assert list(limit_remarks(record, still)) == []


def test_robot_without_limits_keeps_to_them():
    robot = mm.load_robot("youbot").copy()
    for bound, none in (
        (robot.model.effortLimit, 0.0),
        (robot.model.velocityLimit, 0.0),
        (robot.model.lowerPositionLimit, -1e9),
        (robot.model.upperPositionLimit, 1e9),
    ):
        bound[:] = none
    record = _run(robot, lambda t: np.full(5, 30.0))
    assert {name: record.metrics[name] for name in ALLOWED} == dict.fromkeys(ALLOWED, 0.0)
    assert list(limit_remarks(record, robot)) == []


def test_remark_says_which_joint_by_how_much_and_when(youbot):
    model = youbot.model
    start = youbot.q_rest.copy()
    joint = youbot.joint_names.index("y_1")
    start[joint] = model.upperPositionLimit[joint] + 0.25  # and it stays about there
    record = _run(youbot, _push(youbot, 0.0), duration=0.01, q0=start)
    (remark, *_) = limit_remarks(record, youbot)
    assert remark.startswith("y_1 left its limits by 0.25 rad at t = ")
    assert record.metrics["time_beyond_limits"] == 1.0


def test_remarks_of_the_wheels_and_of_what_slides():
    tiago = mm.load_robot("tiago_no_hand")
    start = tiago.q_rest.copy()
    start[tiago.joint_names.index("torso_lift_joint")] = 0.45
    record = _run(tiago, _push(tiago, 0.0), duration=0.01, q0=start)
    (remark, *_) = limit_remarks(record, tiago)
    assert remark.startswith("torso_lift_joint left its limits by 0.1 m at t = ")
    fast = _run(tiago, lambda t: np.array([100.0, 100.0, *_push(tiago, 0.0)(t)[2:]]))
    remarks = "\n".join(limit_remarks(fast, tiago))
    assert "alpha_1 reached 16.7 times its torque limit at t = 0 s" in remarks
    assert "alpha_2" not in remarks
    assert "1 other motor went beyond theirs" in remarks


def test_what_acts_counts_not_what_is_commanded(youbot):
    cut = Scenario(name="s", actuation=[{"type": "saturation", "factor": 1.0}])
    record = _run(youbot, lambda t: np.full(5, 30.0), scenario=cut)
    assert record.metrics["torque_limit_ratio"] == 1.0
    assert not any("torque limit" in remark for remark in limit_remarks(record, youbot))


def test_slipping_wheels_turn_as_fast_as_they_roll():
    """The limit is of the wheel, not of the way that the platform goes."""
    tiago = mm.load_robot("tiago_no_hand")
    push = _push(tiago, 30.0)
    slip = Scenario(name="s", slip=[{"type": "longitudinal", "ratio": 0.5}])
    metrics = (_run(tiago, push, scenario=some).metrics for some in (None, slip))
    one, other = (found["velocity_limit_ratio"] for found in metrics)
    assert one == pytest.approx(other)
    assert one > 1.0


def test_limits_that_no_law_can_help_are_said(youbot):
    """The paper's youBot cannot hold its arm, and as soon as it can, there is nothing to say."""
    weak = mm.simulate(youbot, "tsm", "circle", duration=0.1, scenario="real-limits")
    said = "y_2 cannot hold the robot where it starts: that takes 9.55 of 9.5 N m"
    assert list(limits_in_the_way(weak, youbot)) == [said]
    strong = youbot.copy()
    strong.model.effortLimit[:] *= 1.02
    held = mm.simulate(strong, "tsm", "circle", duration=0.1, scenario="real-limits")
    assert held.metrics["torque_limit_ratio"] < 1.0
    assert list(limits_in_the_way(held, strong)) == []


@pytest.mark.parametrize(("factor", "said"), [(1.02, []), (0.5, ["9.55 of 4.75 N m"])])
def test_motor_that_cannot_hold_is_told_by_the_limit_that_acts(youbot, factor, said):
    saturation = [{"type": "saturation", "factor": factor}]
    scenario = Scenario(name="s", actuation=saturation)
    record = mm.simulate(youbot, "tsm", "circle", duration=0.1, scenario=scenario)
    assert record.metrics["torque_limit_ratio"] > 0.4
    found = [line for line in limits_in_the_way(record, youbot) if line.startswith("y_2 ")]
    assert [line.partition("that takes ")[2] for line in found] == said


def test_holding_torque_is_the_gradient_of_the_potential_energy(robot):
    held, step, still = robot.holding_torque(robot.q_rest), 1e-6, np.zeros(robot.nz)
    C, B = robot.velocity_map(robot.q_rest), robot.actuation(robot.q_rest)
    gradient = [
        (robot.energy(robot.q_rest + d, still) - robot.energy(robot.q_rest - d, still)) / (2 * step)
        for d in step * C.T
    ]
    assert C.T @ B @ held == pytest.approx(gradient, abs=1e-4)


def test_slides_are_lengths(robot):
    for name, slides in zip(robot.joint_names, robot.slides, strict=True):
        joint = robot.model.joints[robot.model.getJointId(name)]
        data = robot.model.createData()
        axis = pin.computeJointJacobian(robot.model, data, robot.q_rest, joint.id)[:, joint.idx_v]
        assert slides == (np.abs(axis[3:]).max() < 1e-9)


def test_the_joint_that_is_first_at_its_stop_is_named():
    robot = mm.load_robot("stretch")
    joint = robot.joint_names.index("joint_wrist_yaw")
    start = robot.q_rest.copy()
    start[joint] = robot.limits.upper[joint] - 1e-3
    push = np.zeros(robot.nz)
    push[robot.velocity_names.index("joint_wrist_yaw")] = 1.0
    law = Torque(lambda t: push)
    stopped, free = (
        mm.simulate(robot, law, "circle", duration=0.1, q0=start, scenario=one)
        for one in ("real-limits", "nominal")
    )
    tick = int((stopped.q[:, joint] > robot.limits.upper[joint] + 1e-6).argmax())
    assert tick > 0
    said = f"joint_wrist_yaw was the first joint at its stop, at t = {stopped.t[tick]:.3g} s"
    assert list(limits_in_the_way(stopped, robot)) == [said]
    assert free.q[tick, joint] > robot.limits.upper[joint]
    assert list(limits_in_the_way(free, robot)) == []
