"""Noise and encoders: what the controller is told, and that nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest
from support.listening import Listener
from support.settings import setting

import mobman as mm
from mobman.simulation.scenario import Scenario

DT = 1e-3


def _measure(robot, *sensors, seed=0, acceleration="exact"):
    scenario = Scenario(name="s", sensors=list(sensors), acceleration=acceleration)
    return scenario.measurement(setting(robot, seed, DT), robot)


def _errors(robot, ticks=4000, seed=0, **noise):
    """What is measured less what is, of q, z and z', at one state over and over."""
    take = _measure(robot, {"type": "noise", **noise}, seed=seed)
    q, z = robot.q_rest, np.ones(robot.nz)
    parts = zip(*(take(q, z, 2.0 * z) for _ in range(ticks)), strict=True)
    return [np.array(part) - true for part, true in zip(parts, (q, z, 2.0 * z), strict=True)]


@pytest.mark.parametrize("name", ["youbot", "tiago"])
def test_noise_is_white_and_has_its_deviations(name, request):
    robot = request.getfixturevalue(name)
    q, z, z_dot = _errors(robot, position=1e-3, pose=5e-3, velocity=2e-2, acceleration=0.3)
    pose = [robot.joint_names.index(joint) for joint in robot.platform.base_joints]
    others = np.setdiff1d(np.arange(robot.nq), pose)
    for errors, deviation in (
        (q[:, others], 1e-3), (q[:, pose], 5e-3), (z, 2e-2), (z_dot, 0.3)
    ):  # fmt: skip
        assert np.allclose(errors.std(axis=0), deviation, rtol=0.06)
        assert np.abs(errors.mean(axis=0)).max() < 5.0 * deviation / np.sqrt(len(errors))
        assert 2.9 * deviation < np.abs(errors).max() < 6.0 * deviation
        correlation = np.corrcoef(errors[1:].T, errors[:-1].T)
        off = correlation[~np.eye(len(correlation), dtype=bool)]
        assert np.abs(off).max() < 0.1  # neither in time nor from joint to joint


def test_deviations_may_differ_from_joint_to_joint(youbot):
    position = [0.0, 0.0, 0.0, 0.0, 0.0, 1e-3, 0.0, 2e-3]
    q, z, z_dot = _errors(youbot, position=position)
    assert np.allclose(q.std(axis=0), position, rtol=0.1)
    assert not z.any()
    assert not z_dot.any()


def test_robot_without_a_pose_needs_none(fixed_robot):
    q, _, _ = _errors(fixed_robot, ticks=500, position=1e-3, pose=1.0)
    assert np.allclose(q.std(axis=0), 1e-3, rtol=0.3)


def test_noise_of_z_goes_into_a_difference_of_it(youbot):
    noise = {"type": "noise", "velocity": 1e-4}
    take = _measure(youbot, noise, acceleration="backward-difference")
    taken = [take(youbot.q_rest, np.zeros(5), np.zeros(5)) for _ in range(2000)]
    z, z_dot = (np.array([some[i] for some in taken]) for i in (1, 2))
    assert np.allclose(z_dot[1:], np.diff(z, axis=0) / DT)
    assert np.allclose(z_dot.std(axis=0), np.sqrt(2.0) * 1e-4 / DT, rtol=0.1)


def test_true_state_is_what_is_recorded(youbot):
    listener = Listener(lambda t: np.full(5, 0.1))
    noise = {"type": "noise", "position": 1e-2, "velocity": 1e-2}
    record = mm.simulate(
        youbot, listener, "circle", duration=0.02, scenario=Scenario(name="s", sensors=[noise])
    )
    quiet = mm.simulate(youbot, Listener(lambda t: np.full(5, 0.1)), "circle", duration=0.02)
    assert np.array_equal(record.q, quiet.q)
    assert 5e-3 < (listener.z - record.z).std() < 2e-2


@pytest.mark.parametrize(
    "sensor",
    [
        {"type": "noise"},
        {"type": "noise", "position": [0.0] * 8, "velocity": 0.0},
        {"type": "quantisation", "resolution": 0.0},
    ],
)
@pytest.mark.parametrize("law", ["tsm", "pseudo-inverse"])
def test_no_error_is_none_bit_for_bit(youbot, sensor, law):
    controller = mm.make_controller(law, **({"a": 0.2, "A": 0.2} if law == "tsm" else {}))
    options = {"duration": 0.05, "seed": 1}
    found = mm.simulate(
        youbot, controller, "circle", scenario=Scenario(name="s", sensors=[sensor]), **options
    )
    expected = mm.simulate(youbot, controller, "circle", **options)
    assert np.array_equal(found.q, expected.q)
    assert np.array_equal(found.torque, expected.torque)


RESOLUTION = 2.0 * np.pi / 2**12


@pytest.mark.parametrize("name", ["youbot", "tiago"])
def test_encoders_round_to_the_nearest_multiple(name, request):
    robot = request.getfixturevalue(name)
    take = _measure(robot, {"type": "quantisation", "resolution": RESOLUTION})
    random = np.random.default_rng(0)
    pose = [robot.joint_names.index(joint) for joint in robot.platform.base_joints]
    others = np.setdiff1d(np.arange(robot.nq), pose)
    for _ in range(20):
        q, z = random.standard_normal(robot.nq), random.standard_normal(robot.nz)
        found, z_found, _ = take(q, z, z)
        steps = found[others] / RESOLUTION
        assert np.allclose(steps, np.round(steps), atol=1e-9)
        assert np.abs(found - q).max() <= RESOLUTION / 2 * (1.0 + 1e-9)
        assert np.array_equal(found[pose], q[pose])
        assert np.array_equal(z_found, z)


def test_pose_may_be_rounded_too(youbot):
    sensor = {"type": "quantisation", "resolution": 0.0, "pose": [0.01, 0.01, 0.1]}
    q = youbot.q_rest + 0.0123456
    found = _measure(youbot, sensor)(q, np.zeros(5), np.zeros(5))[0]
    resolution = np.array([0.01, 0.01, 0.1])
    assert np.allclose(found[:3], resolution * np.round(q[:3] / resolution))
    assert not np.allclose(found[:3], q[:3])
    assert np.array_equal(found[3:], q[3:])


@pytest.mark.parametrize("name", ["youbot", "tiago_no_hand", "hunter_ur10", "ridgeback_panda"])
def test_z_from_differences_of_the_encoders(name):
    """As z: with fine encoders it is z half a tick ago, whatever the platform."""
    robot = mm.load_robot(name)
    sensor = {"type": "quantisation", "resolution": 1e-12, "velocity": "difference"}
    take = _measure(robot, sensor)
    z = 0.3 * np.random.default_rng(1).standard_normal(robot.nz)
    q, h = robot.q_rest.copy(), DT / 20
    assert not take(q, z, z)[1].any()  # at rest before the first tick
    for _ in range(3):
        for _ in range(20):  # the middle of each short step
            half = q + 0.5 * h * robot.velocity_map(q) @ z
            q = q + h * robot.velocity_map(half) @ z
        assert np.allclose(take(q, z, z)[1], z, atol=1e-3)


def test_difference_of_rounded_angles_moves_in_steps(youbot):
    sensor = {"type": "quantisation", "resolution": RESOLUTION, "velocity": "difference"}
    take = _measure(youbot, sensor)
    q = youbot.q_rest.copy()
    velocities = []
    for _ in range(50):
        q[-1] += 0.3 * RESOLUTION
        velocities.append(take(q, np.zeros(5), np.zeros(5))[1][-1])
    assert {round(v * DT / RESOLUTION, 6) for v in velocities[1:]} == {0.0, 1.0}
    assert np.isclose(np.mean(velocities[1:]) * DT / RESOLUTION, 0.3, atol=0.03)


def test_wheels_tell_the_platforms_speed_where_the_pose_slips(youbot):
    """Encoders are on the wheels: they do not see that the platform stays behind."""
    listener = Listener(lambda t: np.array([0.3, 0.3, 0.0, 0.0, 0.0]))
    scenario = Scenario(
        name="s",
        sensors=[{"type": "quantisation", "resolution": 1e-10, "velocity": "difference"}],
        slip=[{"type": "longitudinal", "ratio": 0.5}],
    )
    record = mm.simulate(youbot, listener, "circle", duration=0.05, scenario=scenario)
    middle = 0.5 * (record.z[1:] + record.z[:-1])
    assert np.allclose(listener.z[1:, :2], middle[:, :2], rtol=1e-3, atol=1e-5)


def test_order_of_the_sensors_is_that_of_the_list(youbot):
    noise = {"type": "noise", "position": 1e-3}
    encoder = {"type": "quantisation", "resolution": 0.1}
    q = youbot.q_rest
    rounded_last = _measure(youbot, noise, encoder)(q, np.zeros(5), np.zeros(5))[0][3:]
    noisy_last = _measure(youbot, encoder, noise)(q, np.zeros(5), np.zeros(5))[0][3:]
    assert np.allclose(rounded_last / 0.1, np.round(rounded_last / 0.1))
    assert not np.allclose(noisy_last / 0.1, np.round(noisy_last / 0.1), atol=1e-5)
