"""Replays: what is drawn at each instant against the record, on every registered robot."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest

import mobman as mm
from mobman.viewer.scene import frames
from mobman.viewer.view import make_scene
from tests.support.poses import drawn, largest_difference
from tests.support.runs import Torque

TOLERANCE = 1e-6


def _go_to(page, time):
    page.evaluate("time => mobman.setTime(time)", float(time))


def _of(record, time):
    """The sample at a time."""
    return int(np.argmin(np.abs(record.t - time)))


def test_playing_moves_the_robot_to_the_recorded_poses(replay):
    robot, record, page = replay
    _go_to(page, 0.0)
    assert largest_difference(page, robot, record.q[0]) <= TOLERANCE
    page.click("#play")
    page.wait_for_function("mobman.time() > 0.1", timeout=20_000)
    page.evaluate("mobman.pause()")
    assert page.evaluate("mobman.playing()") is False
    time = page.evaluate("mobman.time()")
    q = np.array(
        [np.interp(time, record.t, column) for column in record.q.T]
    )  # samples are 1 ms apart
    assert largest_difference(page, robot, q) <= 1e-4
    for frame in page.evaluate("mobman.frameTimes()")[1::7]:
        _go_to(page, frame)
        assert largest_difference(page, robot, record.q[_of(record, frame)]) <= TOLERANCE


def test_it_is_where_it_was_between_the_frames_too(replay):
    robot, record, page = replay
    times = np.array(page.evaluate("mobman.frameTimes()"))
    middle = 0.5 * (times[len(times) // 2] + times[len(times) // 2 + 1])
    sample = _of(record, middle)
    _go_to(page, record.t[sample])
    assert largest_difference(page, robot, record.q[sample]) <= 2e-4
    _go_to(page, 1e9)
    assert page.evaluate("mobman.time()") == record.t[-1]
    assert largest_difference(page, robot, record.q[-1]) <= TOLERANCE


def test_wheels_turn_by_phi_and_the_base_follows_theta(replay):
    robot, record, page = replay
    model = robot.model
    for frame in page.evaluate("mobman.frameTimes()")[::12]:
        _go_to(page, frame)
        q = record.q[_of(record, frame)]
        for wheel in robot.platform.wheels:
            index = model.getJointId(wheel.joint)
            parent = model.names[model.parents[index]]
            poses = drawn(page, [parent, wheel.joint])
            turn = np.linalg.inv(poses[parent] @ model.jointPlacements[index].homogeneous)
            turn = (turn @ poses[wheel.joint])[:3, :3]
            angle = float(np.linalg.norm(pin.log3(turn)))
            phi = q[robot.joint_names.index(wheel.joint)]
            assert angle == pytest.approx(abs(math.remainder(phi, math.tau)), abs=TOLERANCE)
        if "base_theta" in robot.joint_names:
            base = drawn(page, ["base_theta"])["base_theta"]
            theta = q[robot.joint_names.index("base_theta")]
            heading = math.atan2(base[1, 0], base[0, 0])
            assert math.remainder(heading - theta, math.tau) == pytest.approx(0.0, abs=TOLERANCE)
            assert base[:2, 3] == pytest.approx(q[:2], abs=TOLERANCE)


def test_tip_lies_on_its_trail(replay):
    _, record, page = replay
    for frame in page.evaluate("mobman.frameTimes()")[3::9]:
        _go_to(page, frame)
        tip = drawn(page, ["tip"])["tip"][:3, 3]
        trail = np.array(page.evaluate("mobman.trail()"))
        assert tip == pytest.approx(record.tip_position[_of(record, frame)], abs=TOLERANCE)
        assert trail[-1] == pytest.approx(tip, abs=1e-5)  # single precision, for the graphics card
    shown = [_of(record, time) for time in page.evaluate("mobman.frameTimes()")[: len(trail)]]
    assert trail == pytest.approx(record.tip_position[shown], abs=1e-5)


def test_overlay_tells_what_runs_and_the_error(replay):
    _, record, page = replay
    _go_to(page, record.t[-1])
    text = page.inner_text("#info")
    for word in (record.robot, record.controller, record.task, record.scenario):
        assert word in text
    shown = float(page.inner_text("#info td.number").removesuffix(" m"))
    assert shown == pytest.approx(np.linalg.norm(record.task_error[-1]), rel=0.05)
    assert "10" in page.inner_text("#legend")


def test_torques_are_drawn_on_the_joints(replay):
    robot, record, page = replay
    page.click("#show-efforts")
    _go_to(page, 0.3)
    found = page.evaluate(
        """mobman.app.runs[0].efforts.map(e => [e.joint.name, e.group.visible,
            Math.sign(new MeshCat.THREE.Vector3(0, 0, 1).applyQuaternion(e.group.quaternion)
                .dot(e.joint.direction)), e.group.scale.x / e.size])"""
    )
    peaks = page.evaluate(
        """Object.fromEntries(mobman.app.runs[0].robot.joints.map(
            j => [j.name, mobman.app.runs[0].motion.peaks[j.q]]))"""
    )
    sample = _of(record, page.evaluate("mobman.frameTimes().filter(t => t <= 0.3).pop()"))
    effort = robot.actuation(record.q[sample]) @ record.torque[sample]
    assert {name for name, *_ in found} >= {robot.joint_names[i] for i in robot.arm_index}
    for name, visible, sign, share in found:
        if visible:
            i = robot.joint_names.index(name)
            assert sign == np.sign(effort[i])
            assert share == pytest.approx(np.sqrt(abs(effort[i]) / peaks[name]), rel=1e-4)
    assert any(visible for _, visible, *_ in found)
    page.click("#show-efforts")


def test_far_and_fast_runs_are_exact(runs, opened, tmp_path):
    """Tens of metres away, wheels turned a hundred times; rates that the frames miss are bridged."""
    robot, record = mm.load_robot("youbot"), runs("youbot")
    t = np.arange(0.0, 20.0005, 1e-3)
    z = np.zeros((len(t), robot.nz))
    q = np.zeros((len(t), robot.nq))
    for i in range(robot.nq):
        q[:, i] = (i + 1) * 10.0 * np.sin(0.3 * t + i)
    long = _stretched(record, t, q, z)
    file = tmp_path / "far.html"
    with opened(mm.view(long, html=file).url) as page:
        for time in (0.0, 7.5, 20.0):
            sample = _of(long, page.evaluate("t => mobman.frameTimes().find(f => f >= t)", time))
            _go_to(page, long.t[sample])
            assert largest_difference(page, robot, q[sample]) <= TOLERANCE


def _stretched(record, t, q, z):
    n = len(t)
    return dataclasses.replace(
        record,
        t=t,
        q=q,
        z=z,
        torque=np.zeros_like(z),
        tip_position=np.zeros((n, 3)),
        tip_desired=np.zeros((n, 3)),
        task_error=np.full((n, 3), 1e-4),
        auxiliary_error=np.zeros((n, record.auxiliary_error.shape[1])),
        compute_time=np.zeros(n),
    )


def test_a_minute_of_a_large_robot_is_a_small_page(runs, tmp_path):
    record = runs("tiago")
    t = np.arange(0.0, 60.0005, 1e-3)
    rows = np.resize(np.arange(len(record.t)), len(t))
    long = _stretched(record, t, record.q[rows], record.z[rows])
    file = tmp_path / "long.html"
    with mm.view(long, html=file) as view:
        count = view.scene.content["runs"][0]["motion"]["t"]["shape"][0]
    assert 3500 <= count <= 3700, "not at the rate of a display"
    assert file.stat().st_size < 12e6


def test_frames_are_samples_at_the_rate_of_a_display():
    t = np.arange(0.0, 2.0, 1e-3)
    kept = frames(t)
    assert kept[0] == 0
    assert kept[-1] == len(t) - 1
    assert np.diff(t[kept]).max() <= 1.0 / 60.0 + 1e-3
    assert len(kept) <= 2.0 * 60.0 + 2
    slow = np.linspace(0.0, 2.0, 21)
    assert frames(slow).tolist() == list(range(21))
    assert len(frames(t, 50)) == 50
    assert frames(np.array([0.5])).tolist() == [0]


def test_a_failed_run_opens_at_its_failure(runs):
    record = dataclasses.replace(
        runs("youbot"), status="diverged", message="at 0.6 s: |z| is large"
    )
    scene = make_scene(record)
    assert scene.content["start"] == record.t[-1]
    assert make_scene(record, time=0.1).content["start"] == 0.1
    assert make_scene(runs("youbot")).content["start"] == 0.0


def test_planar_runs_are_drawn_at_the_tips_height(runs):
    robot, record = mm.load_robot("youbot"), runs("youbot")
    flat = dataclasses.replace(
        record,
        tip_position=record.tip_position[:, :2],
        tip_desired=record.tip_desired[:, :2],
        task_error=record.task_error[:, :2],
    )
    from mobman.viewer.scene import motion

    moved = motion(flat, robot)
    assert moved.tip == pytest.approx(motion(record, robot).tip, abs=1e-12)
    assert motion(flat, None).tip[:, 2] == pytest.approx(0.0)


def test_joint_beyond_its_limits_is_red_while_it_is(opened, tmp_path):
    robot = mm.load_robot("youbot")
    joint = robot.joint_names.index("y_1")
    start, hold = robot.q_rest.copy(), robot.dynamics(robot.q_rest, np.zeros(5))
    start[joint] = robot.limits.upper[joint] + 0.02  # and turns back within its limits
    torque = np.linalg.solve(hold.B, hold.bias) - [0.0, 0.0, 0.5, 0.0, 0.0]
    record = mm.simulate(robot, Torque(lambda t: torque), "circle", duration=0.5, q0=start)
    assert record.q[-1, joint] < robot.limits.upper[joint] - 0.02
    with opened(mm.view(record, html=tmp_path / "run.html").url) as page:
        colours = (
            "() => mobman.app.runs[0].robot.layers.visual.filter(({userData}) => userData.joint === "
            f"{robot.model.getJointId('y_1')}).map((mesh) => mesh.material.color.getHex())"
        )
        _go_to(page, 0.0)
        assert page.evaluate("mobman.beyond()") == ["y_1"]
        assert "beyond limits: y_1" in page.inner_text("#info table")
        red = page.evaluate(colours)
        assert len(set(red)) == 1
        _go_to(page, 0.5)
        assert page.evaluate("mobman.beyond()") == []
        assert "beyond" not in page.inner_text("#info table")
        assert red[0] not in page.evaluate(colours)
        _go_to(page, 0.0)
        assert page.evaluate(colours) == red
