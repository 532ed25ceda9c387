"""Tasks of full pose and pointing: errors, their rates, and the closed loop."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.differences import derivative, relative
from support.task_errors import errors_at

import mobman as mm
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import SingularityError, UsageError
from mobman.model.criterion import Posture
from mobman.simulation.rerun import verify
from mobman.tasks.task import task_map_of
from mobman.viewer.view import make_scene

WOBBLING = ("pose-circle", {"orientation": "wobble"})
TURNING = ("pose-circle", {"orientation": "turn"})
POINTING = ("pointing-circle", {"orientation": "wobble", "axis": "-y"})


class Fixed:
    """A pose, or a position and a direction, that stays."""

    def __init__(self, p_d):
        self.p_d = np.array(p_d)

    def desired(self, t):
        return (self.p_d, *np.zeros((3, 6)))


def _made(robot, task):
    name, parameters = task
    return mm.make_task(name, robot, **parameters)


def _rotation(quaternion):
    return pin.Quaternion(*quaternion).toRotationMatrix()


@pytest.mark.parametrize("task", [WOBBLING, TURNING, POINTING, ("pose", {})], ids=lambda t: t[0])
def test_rates_of_the_tasks(robot, task):
    """p_d' to p_d''' are the derivatives; Omega_d is the angular velocity of the quaternion."""
    made = _made(robot, task)
    for t in (0.3, 2.1):
        now = made.desired(t)
        p_dot = derivative(lambda s, t=t: made.desired(t + s)[0])
        assert relative(now[1][:3], p_dot[:3]) < 1e-9
        if len(now[0]) == 7:
            turning = derivative(lambda s, t=t: _rotation(made.desired(t + s)[0][3:]))
            omega = pin.unSkew(turning @ _rotation(now[0][3:]).T)
            assert relative(now[1][3:], omega) < 1e-9
        else:
            assert relative(now[1][3:], p_dot[3:]) < 1e-9
        assert abs(np.linalg.norm(now[0][3:]) - 1.0) < 1e-12
        for order in (1, 2):
            rate = derivative(lambda s, t=t, k=order: made.desired(t + s)[k])
            assert relative(now[order + 1], rate) < 1e-9


@pytest.mark.parametrize("task", [WOBBLING, POINTING], ids=["pose", "pointing"])
@pytest.mark.parametrize("extended", [False, True], ids=["tip", "extended"])
def test_rates_of_the_errors(robot, task, extended):
    """e' and e'' along the motion and the task's own time."""
    random, made = np.random.default_rng(92), _made(robot, task)
    if robot.nz < task_map_of(made).m:  # such runs are refused, see below
        pytest.skip(f"{robot.nz} degrees of freedom")
    space = TaskSpace(robot, made, Posture.of(robot) if extended else None)
    states, least = [], []
    for _ in range(6):
        q = robot.q_rest + 0.3 * random.standard_normal(robot.nq)
        z, z_dot = random.standard_normal((2, robot.nz))
        tip = robot.tip_kinematics(q, z)
        j = np.vstack([space.task_map.jacobian(tip), robot.constraint_matrix(q)])
        states.append((q, z, z_dot))
        least.append(np.linalg.svd(j, compute_uv=False)[-1])
    if max(least) < 1e-12:
        # no joint rolls the tip: youbot's and turtlebot3_omx's bend in one vertical plane
        pytest.skip("singular everywhere")
    for (q, z, z_dot), sigma in zip(states, least, strict=True):
        # Below it f_a bends too sharply for any step. Small wheels alone make sigma small: in the
        # directions that only they move it is about their radius, 0.0475 m on youbot_mecanum.
        if sigma < min(2e-2, 0.9 * max(least)):
            continue
        q_dot = robot.velocity_map(q) @ z
        now = errors_at(space, 0.7, q, z)

        def at(s, q=q, z=z, d=q_dot, a=z_dot):
            # from the middle outwards and back: signs and axes are carried from call to call
            for part in (0.0, 0.5, 1.0):
                errors = errors_at(space, 0.7 + part * s, q + part * s * d, z + s * a)
            errors_at(space, 0.7, q, z)
            return errors

        h = 5e-4 / max(1.0, np.abs(q_dot[:3]).max())
        m = space.task_map.m
        e_dot = derivative(lambda s, at=at: at(s).e, h)
        e_ddot = derivative(lambda s, at=at: at(s).e_dot, h)
        assert relative(now.e_dot[:m], e_dot[:m]) < 1e-9
        assert relative(now.e_dot, e_dot) < 1e-6
        assert relative(now.J @ z_dot + now.J_dot_z - now.p_ddot, e_ddot) < 1e-6


@pytest.mark.parametrize("angle", [0.0, 0.5, 2.8, 3.4, 6.0])
def test_error_is_twice_the_sine_of_half_the_angle(tiago, angle):
    """Beyond half a turn the error is that of the shorter way."""
    first = tiago.tip_pose(tiago.q_rest)
    axis = np.array([0.6, 0.0, 0.8])
    away = pin.exp3(angle * axis) @ first.rotation
    x, y, z, w = pin.Quaternion(away).coeffs()
    space = TaskSpace(tiago, Fixed([*first.translation, w, x, y, z]))
    space.at(0.0, tiago.q_rest, np.zeros(tiago.nz))
    shorter = angle if angle < np.pi else angle - 2.0 * np.pi
    assert np.allclose(space.f[3:], -2.0 * np.sin(0.5 * shorter) * axis, atol=1e-12)
    assert np.allclose(space.f[:3], first.translation, atol=1e-12)
    # pointing: as far as a turn about an axis across it
    d = pin.exp3(angle * first.rotation[:, 0]) @ first.rotation[:, 2]
    space = TaskSpace(tiago, Fixed([*first.translation, *d]))
    space.at(0.0, tiago.q_rest, np.zeros(tiago.nz))
    assert np.isclose(np.linalg.norm(space.f[3:]), 2.0 * abs(np.sin(0.5 * shorter)), atol=1e-12)


def test_sign_of_the_quaternion_does_not_matter(tiago):
    first = tiago.tip_pose(tiago.q_rest)
    x, y, z, w = pin.Quaternion(pin.exp3(np.array([0.3, -1.0, 0.2])) @ first.rotation).coeffs()
    found = []
    for sign in (1.0, -1.0):
        space = TaskSpace(tiago, Fixed([*first.translation, *(sign * np.array([w, x, y, z]))]))
        space.at(0.0, tiago.q_rest, np.zeros(tiago.nz))
        found.append(space.f.copy())
    assert np.array_equal(*found)


@pytest.mark.parametrize("kind", ["pose", "pointing"])
@pytest.mark.parametrize("law", ["tsm", "damped-least-squares"])
def test_half_a_turn_ends_a_law_as_singular(tiago, kind, law):
    first = tiago.tip_pose(tiago.q_rest)
    away = pin.exp3(np.pi * first.rotation[:, 0]) @ first.rotation
    x, y, z, w = pin.Quaternion(away).coeffs()
    turned = [w, x, y, z] if kind == "pose" else away[:, 2]
    record = mm.simulate(tiago, law, Fixed([*first.translation, *turned]), duration=0.01)
    assert record.status == "singular"
    assert "half a turn" in record.message


def test_error_that_passes_half_a_turn_does_not_jump(tiago):
    """Its quaternion goes on with the sign that it had, and the law ends there."""
    first, z = tiago.tip_pose(tiago.q_rest), np.zeros(tiago.nz)

    class Turning:
        def desired(self, t):
            omega = np.array([0.0, 0.0, 1.0])
            x, y, z, w = pin.Quaternion(pin.exp3(t * omega) @ first.rotation).coeffs()
            none = np.zeros(6)
            return (
                np.array([*first.translation, w, x, y, z]),
                np.array([0.0, 0, 0, *omega]),
                none,
                none,
            )

    space = TaskSpace(tiago, Turning())
    for t in np.arange(0.0, 3.14, 0.02):
        space.at(t, tiago.q_rest, z)
        assert np.isclose(space.f[5], -2.0 * np.sin(0.5 * t), atol=1e-12)
    with pytest.raises(SingularityError, match="half a turn"):
        space.at(3.15, tiago.q_rest, z)
    assert np.isclose(space.f[5] if abs(space.f[5]) > 1.9 else np.nan, -2.0, atol=1e-3)


def test_desired_quaternion_of_another_length_ends_the_run(tiago):
    first = tiago.tip_pose(tiago.q_rest)

    class Growing:
        def desired(self, t):
            quaternion = np.array([1.0, 0.0, 0.0, 0.0]) * (1.0 + t)
            return (np.array([*first.translation, *quaternion]), *np.zeros((3, 6)))

    record = mm.simulate(tiago, "pseudo-inverse", Growing(), duration=0.01)
    assert record.status == "diverged"
    assert "at t = 0.001 s: the desired quaternion, or axis, is not of length 1" in record.message


def test_robot_with_too_few_degrees_of_freedom_is_refused():
    robot = mm.load_robot("youbot")
    with pytest.raises(UsageError, match="'youbot' has 5 degrees of freedom for a task of 6"):
        mm.simulate(robot, "tsm", "pose-circle", duration=0.01)


@pytest.mark.parametrize("law", mm.list_controllers())
@pytest.mark.parametrize("task", ["pose-circle", "pointing-circle", "pose"])
def test_every_law_takes_them(tiago, law, task):
    record = mm.simulate(tiago, law, task, duration=0.1)
    assert record.status == "ok", record.message
    assert record.task_error.shape[1] == {"pointing-circle": 5}.get(task, 6)
    assert record.tip_position.shape == record.tip_desired.shape == (101, 3)
    start = 0.0 if task == "pose" else 0.1
    assert np.isclose(np.linalg.norm(record.task_error[0, :3]), start, atol=1e-9)


def test_pose_is_reached_and_held(tiago):
    """tsm from rest to rest: |e| stays at rounding, and the last pose is that asked for."""
    turned = pin.exp3(np.array([0.2, -0.3, 0.4])) @ tiago.tip_pose(tiago.q_rest).rotation
    x, y, z, w = pin.Quaternion(turned).coeffs()
    where = tiago.tip_pose(tiago.q_rest).translation + np.array([0.2, 0.1, -0.1])
    task = mm.make_task(
        "pose", tiago, position=where.tolist(), orientation=[w, x, y, z], travel=1.0
    )
    record = mm.simulate(tiago, "tsm", task, duration=1.8)
    assert record.status == "ok", record.message
    last = tiago.tip_pose(record.q[-1])
    assert np.abs(last.translation - where).max() < 1e-6
    assert np.abs(pin.log3(last.rotation @ turned.T)).max() < 1e-6
    assert record.metrics["orientation_error_final"] < 1e-6


def test_records_hold_the_orientation(tiago, tmp_path):
    for name, columns in (("pose-circle", 4), ("pointing-circle", 3)):
        record = mm.simulate(tiago, "pseudo-inverse", name, duration=0.05)
        assert record.tip_orientation.shape == record.tip_desired_orientation.shape == (51, columns)
        frame = tiago.tip_pose(record.q[-1]).rotation
        shown = record.tip_orientation[-1]
        expected = frame if columns == 4 else frame[:, 2]
        assert np.allclose(_rotation(shown) if columns == 4 else shown, expected, atol=1e-12)
        angle = 2.0 * np.arcsin(0.5 * np.linalg.norm(record.task_error[-1, 3:]))
        assert np.isclose(record.metrics["orientation_error_final"], angle, atol=1e-15)
        assert np.isclose(
            record.metrics["task_error_final"], np.linalg.norm(record.task_error[-1, :3])
        )
        again = mm.load_record(record.save(tmp_path / f"{name}.h5"))
        for field in ("task_error", "tip_orientation", "tip_desired_orientation", "tip_position"):
            assert np.array_equal(getattr(again, field), getattr(record, field))
        assert again.metrics == pytest.approx(record.metrics, nan_ok=True)
        frame = record.to_pandas()
        assert sum(place.startswith("error/task/") for place in frame) == columns + 2
    assert (
        "orientation_error_final"
        not in mm.simulate(tiago, "pseudo-inverse", "circle", duration=0.01).metrics
    )


def test_records_of_poses_are_repeated_to_the_last_bit(tiago, tmp_path):
    for name in ("pose", "pose-circle", "pointing-circle"):
        record = mm.simulate(tiago, "pseudo-inverse", name, duration=0.02)
        found = verify(record.save(tmp_path / f"{name}.h5"))
        assert found.identical
        assert {"tip/orientation", "tip/desired_orientation"} <= {
            one.name for one in found.compared
        }


def test_replay_shows_the_desired_frame_and_the_angle(tiago):
    for name, columns in (("pose-circle", 4), ("pointing-circle", 3)):
        record = mm.simulate(tiago, "pseudo-inverse", name, duration=0.05)
        shown = make_scene(record).content["runs"][0]["motion"]
        frames = shown["t"]["shape"][0]
        assert shown["turn"]["shape"] == [frames, columns]
        assert shown["angle"]["shape"] == [frames]
        assert shown["error"]["shape"] == [frames]


def test_terminal_sliding_mode_settles_in_position_and_orientation(tiago):
    """By the times of the paper's gains, at twice the usual sampling period."""
    record = mm.simulate(tiago, "tsm", "pose-circle", duration=3.6, dt=2e-3)
    assert record.status == "ok", record.message
    assert record.metrics["settling_time_1e-4"] < 2.5
    assert record.metrics["orientation_settling_time_1e-4"] < 3.5


@pytest.mark.slow
@pytest.mark.parametrize("orientation", ["hold", "turn", "wobble"])
def test_whole_run_of_every_orientation(tiago, orientation):
    task = mm.make_task("pose-circle", tiago, orientation=orientation)
    record = mm.simulate(tiago, "tsm", task, duration=10.0)
    assert record.status == "ok", record.message
    assert np.isclose(record.task_error[0, 3:] @ record.task_error[0, 3:], (2 * np.sin(0.25)) ** 2)
    assert record.metrics["settling_time_1e-4"] < 2.5
    assert record.metrics["orientation_settling_time_1e-4"] < 3.5
    assert record.metrics["task_error_max"] < 1e-7
    assert record.metrics["orientation_error_max"] < 1e-6
    assert record.metrics["success"] == 1.0
