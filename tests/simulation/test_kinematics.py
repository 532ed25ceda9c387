"""Wrong dimensions: of links, tools and wheels; tips that are measured, and motors that give less."""

from __future__ import annotations

import numpy as np
import pytest
from support.settings import setting
from support.states import random_states
from support.variants import description

import mobman as mm
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import SpecError
from mobman.model.dynamics import Buffers
from mobman.simulation import rerun
from mobman.simulation.sensors import MeasuredTip, encoders

WHEELED = [
    *("tiago_no_hand", "youbot", "jackal_z1", "hunter_ur10", "youbot_mecanum", "lekiwi_so101"),
    *("ranger_xarm7", "hsr"),
]


def _true(robot, *pieces, seed=0):
    return mm.Scenario(name="s", kinematics=list(pieces)).true_robot(setting(robot, seed))


def _wrong(share, **fields):
    spreads = {"radius_spread": share, "track_spread": share}
    pieces = [
        {"type": "links", "spread": share},
        {"type": "tool", "spread": share},
        {"type": "wheels", **spreads},
    ]
    return mm.Scenario(name="wrong", kinematics=pieces, **fields)


def _places(robot, q):
    """Positions of the arm's joints, one after the other, and of the tip."""
    robot.tip_pose(q)
    joints = [i for i in range(1, robot.nq + 1) if robot.model.joints[i].idx_q in robot.arm.joints]
    tip = robot.tip_pose(q).translation
    return joints, [robot.data.oMi[i].translation.copy() for i in joints], tip


def test_links_are_longer_by_the_factor():
    robot = mm.load_robot("tiago_no_hand")
    true = _true(robot, {"type": "links", "factor": 1.1, "links": "arm_[4-6]_joint"})
    longer = {f"arm_{i}_joint" for i in (4, 5, 6)}
    for q, _ in random_states(robot, 3):
        joints, before, _ = _places(robot, q)
        _, after, _ = _places(true, q)
        for k in range(1, len(joints)):
            factor = 1.1 if robot.model.names[joints[k]] in longer else 1.0
            old = np.linalg.norm(before[k] - before[k - 1])
            assert np.linalg.norm(after[k] - after[k - 1]) == pytest.approx(factor * old, abs=1e-12)
        assert true.reduced_inertia(q).shape == robot.reduced_inertia(q).shape
    assert [link.mass for link in true.model.inertias] == [
        link.mass for link in robot.model.inertias
    ]


def test_each_link_has_a_draw_of_its_own_whatever_is_chosen(youbot):
    every = _true(youbot, {"type": "links", "spread": 0.1})
    one = _true(youbot, {"type": "links", "spread": 0.1, "links": "y_3"})
    index = youbot.model.getJointId("y_3")
    ratios = [
        np.linalg.norm(true.model.jointPlacements[i].translation)
        / np.linalg.norm(youbot.model.jointPlacements[i].translation)
        for true in (every, one)
        for i in (index - 1, index)
    ]
    assert ratios[1] == ratios[3] != ratios[0]
    assert ratios[2] == 1.0
    assert max(abs(ratio - 1.0) for ratio in ratios) < 0.1


@pytest.mark.parametrize("name", ["tiago_no_hand", "youbot"])  # a lift, and axes that are no z
def test_other_zeros_are_those_of_a_robot_that_is_elsewhere(name):
    robot = mm.load_robot(name)
    true = _true(robot, {"type": "zeros", "offset": 0.1})
    for q, _ in random_states(robot, 3):
        elsewhere = q.copy()
        elsewhere[robot.arm.joints] += 0.1
        assert np.allclose(true.tip_pose(q), robot.tip_pose(elsewhere), atol=1e-12)


def test_another_tool_moves_the_tip_alone(youbot):
    true = _true(youbot, {"type": "tool", "factor": 1.5, "offset": [0.0, 0.02, 0.0]})
    for q, _ in random_states(youbot, 3):
        joints, places, tip = _places(youbot, q)
        _, same, moved = _places(true, q)
        assert np.allclose(places, same, atol=1e-14)
        pose = youbot.tip_pose(q)
        shift = pose.rotation @ [0.0, 0.02, 0.0] + 0.5 * (tip - places[-1])
        assert np.allclose(moved - tip, shift, atol=1e-12)
        assert joints


@pytest.mark.parametrize("name", WHEELED)
def test_other_wheels_are_those_of_a_robot_that_has_them(name):
    fields = description(name)["platform"]
    other = {"wheel_radius": 1.07 * fields["wheel_radius"]}
    if "half_track" in fields:
        other["half_track"] = 0.95 * fields["half_track"]
    track = 0.95 if "half_track" in fields else 1.0
    nominal = mm.load_robot(name)
    true = _true(nominal, {"type": "wheels", "radius": 1.07, "track": track})
    changes = {f"platform__{field}": value for field, value in other.items()}
    built = mm.load_robot(description(name, **changes))
    for q, z in random_states(nominal, 3):
        q = built.consistent(q)
        assert np.allclose(true.velocity_map(q), built.velocity_map(q), rtol=1e-12, atol=1e-12)
        assert np.allclose(true.constraint_matrix(q) @ true.velocity_map(q), 0.0, atol=1e-12)
        # the motors' torques are those of a controller that knows nothing of it: B = C^T B'
        expected = true.velocity_map(q).T @ nominal.actuation(q)
        assert np.allclose(true.dynamics(q, z).B, expected, rtol=1e-12, atol=1e-12)
        # a larger wheel lifts what is on it, where it does not belong to the body's numbers
        lift = np.array([0.0, 0.0, 0.07 * fields["wheel_radius"]])
        assert np.allclose(true.tip_pose(q).translation, nominal.tip_pose(q).translation + lift)
        if "body" in fields:
            continue
        assert np.allclose(true.tip_pose(q), built.tip_pose(q), atol=1e-12)
        if track == 1.0:  # the wheels of the other one are where they were
            assert np.allclose(true.dynamics(q, z).M, built.dynamics(q, z).M, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", WHEELED)
def test_encoders_tell_what_fits_their_rates(name):
    nominal = mm.load_robot(name)
    true = _true(nominal, {"type": "wheels", "radius": 0.9, "track": 1.1})
    measure = mm.Scenario(name="s").measurement(setting(nominal), true)
    own = [i for i, joint in enumerate(nominal.joint_names) if not joint.startswith("base_")]
    for q, z in random_states(nominal, 3):
        q = true.consistent(q)
        _, told, _ = measure(q, z, np.zeros(nominal.nz))
        rates, seen = true.velocity_map(q)[own] @ z, nominal.velocity_map(q)[own] @ told
        if name not in ("ranger_xarm7", "hunter_ur10"):  # wheels that do not fit its track
            assert np.allclose(rates, seen, rtol=1e-9, atol=1e-9)
        residual = nominal.velocity_map(q)[own].T @ (seen - rates)
        assert (
            np.abs(residual).max()
            < 1e-6 * np.abs(rates).max() * np.abs(nominal.velocity_map(q)[own]).max()
        )
    # along a motion z' is the rate of z
    tell, dt = encoders(nominal, true, 1e-5), 1e-5
    z, z_dot = np.random.default_rng(1).standard_normal((2, nominal.nz))
    q = nominal.q_rest
    ticks = []
    for _ in range(3):
        ticks.append(tell(q, z, z_dot))
        q, z = q + dt * true.velocity_map(q) @ z, z + dt * z_dot
    difference = (ticks[2][0] - ticks[1][0]) / dt
    assert np.allclose(difference, ticks[2][1], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("name", ["kmr_iiwa", "fixed_panda"])
def test_no_wheels_are_as_they_were(name):
    robot = mm.load_robot(name)
    assert _true(robot, {"type": "wheels", "radius": 1.1}) is robot


@pytest.mark.parametrize("task", ["circle", "pose-circle", "pointing-circle"])
def test_errors_of_a_measured_tip_are_those_of_the_true_robot(task):
    """A law's f - p_d and J z - p_d' on the wrong model are e and e' of the true one."""
    robot = mm.load_robot("tiago_no_hand")
    true = _wrong(0.1).true_robot(setting(robot))
    aim = mm.make_task(task, robot)
    told = MeasuredTip(aim, robot)
    assert told.period == aim.period
    now, random = Buffers(true), np.random.default_rng(3)
    for t in (0.3, 1.7):
        q = robot.q_rest + 0.1 * random.standard_normal(robot.nq)
        z = random.standard_normal(robot.nz)
        now.q[:], now.z[:] = q, z
        now.velocity()
        now.run_jacobians()
        now.tip_kinematics()
        told.look(q, z, now, now.q_dot)
        expected, found = TaskSpace(true, aim), TaskSpace(robot, told)
        for space in (expected, found):
            space.at(t, q, z)
        e, e_true = (space.f - space.p_d[0] for space in (found, expected))
        rate, true_rate = (space.J @ z - space.p_d[1] for space in (found, expected))
        assert np.abs(expected.f[:3] - (found.f[:3])).max() > 1e-3
        assert np.allclose(e[:3], e_true[:3], atol=1e-12)
        assert np.allclose(rate[:3], true_rate[:3], atol=1e-12)
        if task == "pose-circle":
            assert np.allclose(e, e_true, atol=1e-9)
            assert np.allclose(rate, true_rate, atol=1e-9)
        elif task == "pointing-circle":  # in other axes
            assert e[3:] @ e[3:] == pytest.approx(e_true[3:] @ e_true[3:], abs=1e-9)
            assert e[3:] @ rate[3:] == pytest.approx(e_true[3:] @ true_rate[3:], abs=1e-9)
        # by desired() it is the same as by an entry
        parts = told.desired(t)
        assert np.allclose(parts[0][:3], aim.desired(t)[0][:3] - now.tip + found.f[:3], atol=1e-12)


def test_a_measured_tip_makes_good_what_the_model_errs_by(youbot):
    runs = [
        mm.simulate(youbot, "tsm", "circle", duration=6.0, scenario=_wrong(0.03, tip=tip))
        for tip in ("measured", "modelled")
    ]
    measured, modelled = (np.abs(run.task_error[-1000:]).max() for run in runs)
    assert all(run.ok for run in runs)
    assert measured < 1e-5
    assert modelled > 1e-3


def test_such_runs_are_the_same_to_the_last_bit(tmp_path):
    record = mm.simulate(
        "youbot_mecanum", "tsm", "pose-circle", duration=0.03, scenario="uncertain-kinematics"
    )
    path = tmp_path / "run.h5"
    record.save(path)
    assert record.ok
    assert not rerun.verify(path).differences


def test_the_usual_robot_leaves_no_trace_in_a_scenario():
    fields = mm.load_scenario("heavier").model_dump(mode="json")
    assert not {"kinematics", "tip"} & set(fields)
    assert {"kinematics", "tip"} <= set(
        mm.load_scenario("uncertain-kinematics").model_dump(mode="json")
    )


def test_motors_give_a_share_of_what_they_are_commanded(youbot):
    factor = [0.5, 0.6, 1.0, 1.5, 1.9]
    late = mm.Scenario(name="s", actuation=[{"type": "gain", "factor": factor}])
    record = mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.02, scenario=late)
    assert np.allclose(record.signals["torque_applied"], record.torque * factor, rtol=1e-14)
    with pytest.raises(SpecError, match="must be above 0"):
        mm.Scenario(name="s", actuation=[{"type": "gain", "factor": 0.0}])
    with pytest.raises(SpecError, match="fits no joint of the arm"):
        _true(youbot, {"type": "links", "links": "elbow"})
