"""Stops at the joints' limits."""

from __future__ import annotations

import numpy as np
import pytest
from support.runs import Torque
from support.settings import setting
from support.states import random_configuration

import mobman as mm
from mobman.simulation.disturbances import JointLimits, least_inertia
from mobman.simulation.scenario import Scenario

STOPS = Scenario(name="s", stops=[{"type": "joint-limits"}])


def _run(robot, torque, q0, duration=0.1, scenario=STOPS):
    return mm.simulate(
        robot, Torque(lambda t: torque), "circle", duration=duration, q0=q0, scenario=scenario
    )


def _depth(robot, q):
    return np.maximum(np.maximum(robot.limits.lower - q, q - robot.limits.upper), 0.0)


def test_stop_never_adds_energy(robot):
    """Without motors, with every joint pressed into a stop: what robot and springs hold never rises."""
    random = np.random.default_rng(3)
    q = random_configuration(robot, random)
    side = random.random(robot.nq) < 0.5
    for bound, sign in (robot.limits.upper, 1.0), (robot.limits.lower, -1.0):
        chosen = np.isfinite(bound) & (side == (sign > 0.0))
        q[chosen] = bound[chosen] + sign * 2e-3
    q = robot.consistent(q)  # joints that follow others
    contact = JointLimits().start(setting(robot))
    record = _run(robot, np.zeros(robot.nz), q)
    assert record.ok, record.message
    held = np.array([robot.energy(a, b) for a, b in zip(record.q, record.z, strict=True)])
    stored = 0.5 * (contact.stiffness * _depth(robot, record.q) ** 2).sum(axis=1)
    total = held + stored
    assert stored[0] > 0.0
    assert np.diff(total).max() <= 1e-7 * np.ptp(total)
    assert total[-1] < total[0] - 0.2 * stored[0]  # and the dampers take a good part of it
    # the stops' work is in it; a step in which a damper lets go has an edge
    assert record.metrics["energy_residual"] < 1e-3


def test_motor_presses_its_joint_in_as_far_as_the_spring_says():
    robot = mm.load_robot("youbot")
    contact = JointLimits().start(setting(robot))
    joint = robot.joint_names.index("y_1")  # about the vertical: gravity does not matter
    torque = np.linalg.solve(*robot.dynamics(robot.q_rest, np.zeros(5))[2:0:-1])
    torque[2] = robot.limits.torque[2]
    q0 = robot.q_rest.copy()
    q0[joint] = robot.limits.upper[joint] - 0.05
    # wheels and the other joints are held by stops of nothing: hold them by inertia for a short time
    record = _run(robot, torque, q0, duration=0.3)
    depth = record.q[:, joint] - robot.limits.upper[joint]
    assert contact.stiffness[joint] * 2e-3 >= robot.limits.torque[2]
    # without damping and with the inertia of all joints at rest, the impact would go as deep as this
    k, speed = contact.stiffness[joint], record.z[:, 2].max()
    inertia = robot.motor_inertia(record.q[-1])[2]
    assert 0.0 < depth.max() < speed * np.sqrt(inertia / k) + 2.0 * torque[2] / k < 0.05
    assert record.metrics["position_limit_excess"] == pytest.approx(
        max(depth.max(), _depth(robot, record.q).max())
    )
    free = _run(robot, torque, q0, duration=0.3, scenario=None)
    assert free.q[-1, joint] > robot.limits.upper[joint] + 0.5


def test_stop_of_a_cars_steering_acts_through_its_platform():
    """The limits are of the knuckles, which are coordinates of the platform."""
    robot = mm.load_robot("hunter_ur10")
    still = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    torque = np.linalg.solve(still.B, still.bias)
    steering = robot.velocity_names.index("delta_dot")
    torque[steering] += 5.0 * robot.motor_inertia(robot.q_rest)[steering]
    record, free = (_run(robot, torque, robot.q_rest, 0.6, some) for some in (STOPS, None))
    knuckles = [robot.joint_names.index(f"steering_{side}") for side in ("left", "right")]
    limit = robot.limits.upper[knuckles].max()
    assert free.q[-1, knuckles].max() > limit + 0.1
    assert limit - 0.05 < record.q[-1, knuckles].max() < limit + 5e-3


def test_least_inertia_is_below_that_of_any_posture(robot):
    random, least = np.random.default_rng(9), least_inertia(robot)
    limited = np.isfinite(robot.limits.lower)
    for _ in range(5):
        q = random_configuration(robot, random)
        C, M = robot.velocity_map(q), robot.dynamics(q, np.zeros(robot.nz)).M
        own = 1.0 / np.diag(C @ np.linalg.solve(M, C.T))[limited]
        assert (own >= 0.5 * least[limited]).all()  # of a sample: the steps leave a factor of 4


def test_robot_away_from_its_limits_feels_no_stop_bit_for_bit(youbot):
    hold = np.linalg.solve(*youbot.dynamics(youbot.q_rest, np.zeros(5))[2:0:-1])
    with_stops, without = (_run(youbot, hold, youbot.q_rest, 0.05, some) for some in (STOPS, None))
    assert np.array_equal(with_stops.q, without.q)
    assert np.array_equal(with_stops.z, without.z)


def test_platform_starts_behind_where_the_task_supposes_it(driving_robot):
    robot = driving_robot
    far = Scenario(name="far", start_offset=1.5)
    near = mm.simulate(robot, Torque(lambda t: np.zeros(robot.nz)), "circle", duration=1e-3)
    away = mm.simulate(
        robot, Torque(lambda t: np.zeros(robot.nz)), "circle", duration=1e-3, scenario=far
    )
    moved = away.q[0] - near.q[0]
    assert np.isclose(np.linalg.norm(moved), 1.5)
    assert np.isclose(np.linalg.norm(moved[robot.platform_index[:2]]), 1.5)
    assert np.array_equal(away.tip_desired, near.tip_desired)
    given = mm.simulate(
        robot, Torque(lambda t: np.zeros(robot.nz)), "circle", duration=1e-3, scenario=far,
        q0=robot.q_rest,
    )  # fmt: skip
    assert np.array_equal(given.q[0], robot.q_rest)
