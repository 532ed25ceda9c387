"""``mobman robots add`` on robots made at random: it refuses with a reason, or what it writes is true.

The truth is the generator's own (:mod:`varied_robots`): where wheels, axles, the tip and the ground are,
which joints move the tip, how large the wheels are. What is written is loaded, moved, and compared.
"""

from __future__ import annotations

import json
import os
import traceback

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from varied_robots import BASES, FAULTS, Varied

import mobman as mm
from mobman.cli.robots_add import add

FEW, MANY, EACH = 30, int(os.environ.get("MOBMAN_VARIED_ROBOTS", "500")), 25
MILLIMETRE = 1e-3


@pytest.fixture(autouse=True)
def data_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))


def frame_in_world(robot, data, link):
    """Pinocchio's index of a link's frame; the names of some have a prefix."""
    model = robot.model
    ids = [
        i
        for i, f in enumerate(model.frames)
        if f.type == pin.FrameType.BODY and f.name in (link, f"mobman/link/{link}")
    ]
    assert len(ids) == 1, (link, ids)
    return ids[0]


def confirm(varied: Varied, robot, said: dict) -> None:
    """Compare a robot with the truth about it."""
    truth, random = varied.truth, np.random.default_rng(1)
    assert robot.spec.platform.type in truth.types
    parameters = robot.spec.platform.parameters
    if "wheel_radius" in parameters:
        assert abs(parameters["wheel_radius"] - truth.radius) < MILLIMETRE
    assert said["tip"] == truth.tip
    assert abs(said["reach"] - varied.reach()) < MILLIMETRE
    assert sorted(said["arm_joints"]) == sorted(truth.arm)
    if truth.right and not truth.either_way and "right_wheel" in parameters:
        assert [parameters["right_wheel"]] == truth.right
        assert [parameters["left_wheel"]] == truth.left
    if "steering" in parameters:
        assert sorted(parameters["steering"]) == sorted(truth.steering)
    if parameters.get("wheels"):
        assert sorted(parameters["wheels"]) == sorted(w.joint for w in truth.wheels)
    own = {*truth.arm, *truth.steering, *truth.rolling, *(w.joint for w in truth.wheels)}
    free = set(robot.joint_names) - own - {"base_x", "base_y", "base_theta"}
    followers = {n for n, j in varied.joints.items() if j.follows and j.follows[0] in truth.arm}
    assert free <= {"travel_direction", "travel_curvature", *followers}
    assert np.all(robot.q_rest >= robot.limits.lower - 1e-9)
    assert np.all(robot.q_rest <= robot.limits.upper + 1e-9)

    model, data = robot.model, robot.model.createData()
    centres = {
        w.joint: frame_in_world(robot, data, varied.joints[w.joint].child) for w in truth.wheels
    }
    base = frame_in_world(robot, data, "chassis")
    names = robot.joint_names
    for _ in range(3):
        q = robot.q_rest.copy()
        for name in truth.arm:
            q[names.index(name)] += random.uniform(-0.4, 0.4)
        for name in [n for n in names if n.startswith("travel_")]:
            q[names.index(name)] = random.uniform(-0.4, 0.4)
        if truth.steering and "travel_curvature" not in names and not truth.turret:
            q[[names.index(n) for n in parameters["steering"]]] = 0.0
        q = robot.consistent(q)
        at = dict(zip(names, q, strict=True))
        pin.framesForwardKinematics(model, data, q)
        root = data.oMf[base]
        # upright, at the true height, and (where that is told) forward is ahead
        height = root.translation[2]
        assert abs(height + truth.ground) < MILLIMETRE, (height, truth.ground)
        assert root.rotation[:, 2] == pytest.approx([0, 0, 1], abs=1e-6)
        if not truth.either_way:
            assert root.rotation[0, 0] == pytest.approx(1.0, abs=1e-2)
        tip = varied.place_of(truth.tip, at)
        seen = robot.tip_pose(q)
        assert np.linalg.norm(seen.translation - root.act(tip[:3, 3])) < MILLIMETRE
        assert np.abs(seen.rotation - root.rotation @ tip[:3, :3]).max() < 1e-6
        # the point of each wheel on the ground, as the truth has it, against the ground
        z = np.zeros(robot.nz)
        z[: robot.n_alpha] = random.uniform(-1, 1, robot.n_alpha)
        rate = robot.velocity_map(q) @ z
        pin.forwardKinematics(model, data, q, rate)
        for wheel in truth.wheels:
            if wheel.joint not in names:
                continue
            frame = centres[wheel.joint]
            pin.updateFramePlacements(model, data)
            inset = root.rotation @ wheel.inset
            centre = data.oMf[frame].translation + inset
            assert abs(centre[2] - truth.radius) < MILLIMETRE
            moved = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            slip = moved.linear + np.cross(moved.angular, inset - [0, 0, truth.radius])
            along = root.rotation @ wheel.ahead
            if wheel.slips == "mecanum":
                slip = root.rotation @ wheel.roller @ slip
            elif wheel.slips == "sideways":
                slip = along @ slip
            scale = max(1.0, np.abs(rate).max())
            assert np.abs(slip).max() < truth.tolerance * scale, (wheel.joint, slip)
    # where the platform's own point is
    if (
        truth.right
        and robot.platform.base_joints
        and robot.spec.platform.type in ("differential", "car-like")
    ):
        own = [w.centre for w in truth.wheels if w.joint in (*truth.right, *truth.left)]
        axle = root.act(np.mean(own, axis=0))
        assert np.linalg.norm(axle[:2]) < MILLIMETRE
        track = abs(own[0][1] - own[1][1])
        assert abs(2.0 * robot.platform.half_track - track) < MILLIMETRE


def attempt(varied: Varied, *options: str):
    toml = varied.folder / "varied.toml"
    done = CliRunner().invoke(add, [str(varied.urdf), "-o", str(toml), "--json", *options])
    if done.exit_code == 0:
        return mm.load_robot(toml), json.loads(done.output), ""
    error = done.exception
    assert isinstance(error, mm.MobmanError), "".join(traceback.format_exception(error))
    assert error.exit_status == 2
    assert not toml.exists()
    text = str(error)
    assert text
    assert "\n" not in text
    return None, {}, text


def tried(varied: Varied) -> str:
    """Try a made robot; what was asked for, or nothing."""
    truth = varied.truth
    robot, said, asked = attempt(varied)
    if truth.refused:
        assert robot is None, "it must be asked for"
        assert any(word in asked for word in truth.refused), asked
        if not truth.answer:
            return asked
        robot, said, still = attempt(varied, *truth.answer)
        assert robot is not None, still
    else:
        assert robot is not None, asked
    confirm(varied, robot, said)
    for word in truth.said:
        assert any(word in text for text in said["warnings"]), (word, said["warnings"])
    return asked


def seeded(seed: int, folder) -> Varied:
    """Every base and every fault has its turn."""
    bases, faults = list(BASES), ["", *FAULTS]
    return Varied(seed, folder, bases[seed % len(bases)], faults[(seed // 2) % len(faults)])


# Once missed: a turret narrower than its wheels are long, three omni wheels on their side, names of
# wheels against the arm and the root link.
@pytest.mark.parametrize("seed", [*range(FEW), 44, 87, 708])
def test_a_varied_robot_is_taken_truly_or_asked_about(tmp_path, seed):
    tried(seeded(seed, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(FEW, FEW + MANY, EACH))
def test_many_varied_robots_are_taken_truly_or_asked_about(tmp_path, first):
    wrong = {}
    for seed in range(first, first + EACH):
        folder = tmp_path / str(seed)
        folder.mkdir()
        varied = seeded(seed, folder)
        try:
            tried(varied)
        except AssertionError as error:
            wrong[seed, varied.kind, varied.fault] = str(error).splitlines()[0]
    assert not wrong
