"""Friction on the motors' axes."""

from __future__ import annotations

import numpy as np
import pytest
from support.runs import Torque
from support.settings import setting
from support.states import random_states

import mobman as mm
from mobman.errors import SpecError
from mobman.simulation.integrator import RungeKutta
from mobman.simulation.scenario import Scenario

LEVEL, VELOCITY, VISCOUS = 0.4, 0.05, 0.3
BOTH = [
    {"type": "viscous", "torque": VISCOUS},
    {"type": "coulomb", "torque": LEVEL, "velocity": VELOCITY},
]


def _plant(robot, *friction, disturbances=()):
    scenario = Scenario(name="s", friction=list(friction), disturbances=list(disturbances))
    return scenario.make_plant(setting(robot), robot)


def _torque(robot, q, z, plant):
    """The friction torque of the axes that explains the acceleration."""
    m, bias, b = robot.dynamics(q, z)
    z_dot = plant.acceleration(0.0, q, z, np.zeros(robot.nz))
    return np.linalg.solve(b, m @ z_dot + bias)


def test_still_axes_have_none(robot):
    q = robot.q_rest
    assert np.abs(_torque(robot, q, np.zeros(robot.nz), _plant(robot, *BOTH))).max() < 1e-7


def test_friction_is_against_the_rates_of_the_axes(robot):
    """-c w - level tanh(w / velocity), w = B^T z."""
    plant = _plant(robot, *BOTH)
    for q, z in random_states(robot, 10):
        rate = robot.dynamics(q, z).B.T @ z
        expected = -VISCOUS * rate - LEVEL * np.tanh(rate / VELOCITY)
        assert np.allclose(_torque(robot, q, z, plant), expected, atol=1e-6)
        assert expected @ rate <= 0.0


def test_coulomb_is_its_level_on_a_turning_axis(youbot):
    plant = _plant(youbot, BOTH[1])
    z = np.array([3.0, -3.0, 2.0, -2.0, 1.0])
    found = _torque(youbot, youbot.q_rest, z, plant)
    rate = youbot.dynamics(youbot.q_rest, z).B.T @ z
    assert np.abs(rate).min() > 10 * VELOCITY
    assert np.allclose(found, -LEVEL * np.sign(rate), atol=1e-9)


def test_wheels_axis_turns_at_the_wheels_rate(tiago):
    """phi' of the wheels is B^T z of the platform's part: its motors are on the wheels."""
    z = np.arange(1.0, tiago.nz + 1.0)
    q_dot = tiago.velocity_map(tiago.q_rest) @ z
    wheels = [tiago.joint_names.index(wheel.joint) for wheel in tiago.platform.wheels]
    rate = tiago.dynamics(tiago.q_rest, z).B.T @ z
    assert np.allclose(sorted(q_dot[wheels]), sorted(rate[:2]))


def test_acceleration_is_in_the_measure_of_the_axes(youbot):
    inertia = youbot.motor_inertia(youbot.q_rest)
    relative = _plant(youbot, {"type": "viscous", "acceleration": VISCOUS})
    absolute = _plant(youbot, {"type": "viscous", "torque": (VISCOUS * inertia).tolist()})
    for q, z in random_states(youbot, 3):
        one, other = (p.acceleration(0.0, q, z, np.zeros(5)) for p in (relative, absolute))
        assert np.allclose(one, other, rtol=1e-12)


def test_friction_acts_in_every_stage_beside_the_disturbance(youbot):
    """A step against the formula, with accelerations that are asked for one by one."""
    push = {"type": "sinusoid", "torque": 0.2, "frequency": 20.0}
    plant, other = (_plant(youbot, *BOTH, disturbances=[push]) for _ in range(2))
    random, h, torque = np.random.default_rng(1), 0.01, np.ones(5)
    q_0, z_0 = youbot.q_rest.copy(), 0.3 * random.standard_normal(5)
    plant.v[:] = torque
    integrator = RungeKutta(plant, q_0, z_0, h)
    integrator.evaluate(0.1)
    integrator.step(0.1)
    q, z, slopes = q_0, z_0, []
    for fraction, later in ((0.0, 0.5), (0.5, 0.5), (0.5, 1.0), (1.0, 0.0)):
        q_slope = youbot.velocity_map(q) @ z
        z_slope = other.acceleration(0.1 + fraction * h, q, z, torque)
        slopes.append(np.concatenate((q_slope, z_slope)))
        q, z = q_0 + later * h * q_slope, z_0 + later * h * z_slope
    mean = (slopes[0] + 2.0 * (slopes[1] + slopes[2]) + slopes[3]) / 6.0
    end = np.concatenate((plant.now.q, plant.now.z))
    assert np.allclose(end, np.concatenate((q_0, z_0)) + h * mean, atol=1e-13)


@pytest.mark.parametrize("name", ["youbot", "tiago"])
def test_energy_that_is_lost_is_the_work_of_friction(name, request):
    """Without motors: the arm falls and slows; what the energy loses, friction took."""
    robot = request.getfixturevalue(name)
    friction = [{"type": "viscous", "acceleration": 2.0}, {"type": "coulomb", "acceleration": 0.5}]
    record = mm.simulate(
        robot, Torque(lambda t: np.zeros(robot.nz)), "circle", duration=0.4,
        scenario=Scenario(name="s", friction=friction),
    )  # fmt: skip
    lost = robot.energy(record.q[0], record.z[0]) - robot.energy(record.q[-1], record.z[-1])
    rate = np.array([robot.dynamics(q, z).B.T @ z for q, z in zip(record.q, record.z, strict=True)])
    resistance = robot.motor_inertia(robot.q_rest) * (2.0 * rate + 0.5 * np.tanh(rate / 0.05))
    power = (resistance * rate).sum(axis=1)
    assert lost > 1e-2
    assert np.isclose(np.trapezoid(power, record.t), lost, rtol=1e-4)
    assert record.metrics["energy_residual"] < 1e-7


def test_all_axes_slow_as_the_exponential_under_friction_of_the_robots_own_inertia():
    """M z' = -c M z, where nothing else acts: a platform alone that goes straight on."""
    robot = mm.load_robot("youbot")
    q, c = robot.q_rest, 5.0
    m, _, b = robot.dynamics(q, np.zeros(5))
    straight = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    weight = (m @ straight)[:2] / (b @ b.T @ straight)[:2]  # of the wheels, going straight
    assert np.isclose(*weight)
    coefficient = [c * weight[0], c * weight[1], 0.0, 0.0, 0.0]
    plant = _plant(robot, {"type": "viscous", "torque": coefficient})
    hold = np.linalg.solve(b, robot.dynamics(q, np.zeros(5)).bias)
    z_dot = plant.acceleration(0.0, q, 0.1 * straight, hold)
    # the arm swings as the platform slows; what drives that is M z' + c M z on the wheels' rows
    assert np.allclose((m @ z_dot)[:2], -c * 0.1 * (m @ straight)[:2], rtol=1e-6)


def test_friction_too_steep_to_follow_is_refused(youbot):
    steep = Scenario(name="s", friction=[{"type": "coulomb", "torque": 1.0, "velocity": 1e-6}])
    with pytest.raises(SpecError, match=r"friction slows .*'youbot'.* steps of 2e-05 s"):
        mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.01, scenario=steep)


def test_steep_friction_is_followed_in_shorter_steps(youbot):
    """At the longest step and at a fifth of it, the same motion to the order of the method."""
    friction = [{"type": "coulomb", "torque": 0.3, "velocity": 0.002}]
    ends = []
    for dt in (1e-3, 2e-4):
        record = mm.simulate(
            youbot,
            Torque(lambda t: np.full(5, 0.5)),
            "circle",
            duration=0.05,
            dt=dt,
            scenario=Scenario(name="s", friction=friction),
        )
        assert record.ok
        ends.append(record.q[-1])
    plant = _plant(youbot, *friction)
    assert plant.friction_decay(youbot.q_rest) > 2500.0
    assert np.allclose(*ends, rtol=0.0, atol=1e-6)
    assert not np.allclose(ends[0], youbot.q_rest, rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("scenario", ["friction", "realistic"])
def test_shipped_friction_can_be_followed_by_every_robot(robot, scenario):
    loaded = mm.load_scenario(scenario)
    plant = loaded.make_plant(setting(robot), loaded.true_robot(setting(robot)))
    assert 0.0 < plant.friction_decay(robot.q_rest) < 1000.0  # of 2500 at 1 ms


def test_no_friction_is_none_bit_for_bit(youbot):
    none = Scenario(name="s", friction=[{"type": "coulomb", "torque": 0.0}])
    one, other = (
        mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.05, scenario=some)
        for some in (none, None)
    )
    assert np.array_equal(one.q, other.q)
    assert np.array_equal(one.torque, other.torque)
