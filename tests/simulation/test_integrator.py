"""Runge-Kutta on the plant: order, work, and disturbances that change within a step."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.simulation.integrator import State, rk4_step
from mobman.simulation.plant import Plant


def _start(robot):
    random = np.random.default_rng(80)
    return State(robot.q_rest.copy(), 0.5 * random.standard_normal(robot.nz), 0.0)


def _run(plant, torque, duration, steps):
    state, h = _start(plant.robot), duration / steps
    for i in range(steps):
        state = rk4_step(plant, i * h, state, torque, h)
    return state


@pytest.mark.parametrize("name", ["youbot", "tiago"])
def test_error_falls_with_the_fourth_power_of_the_step(name, request):
    """Without control: the arm falls, the platform rolls."""
    robot = request.getfixturevalue(name)
    plant, none = Plant(robot), np.zeros(robot.nz)
    exact = np.concatenate(_run(plant, none, 0.16, 512)[:2])
    errors = [
        np.linalg.norm(np.concatenate(_run(plant, none, 0.16, steps)[:2]) - exact)
        for steps in (32, 64, 128)
    ]
    orders = np.log2(errors[:-1]) - np.log2(errors[1:])
    assert np.all(np.abs(orders - 4.0) < 0.2)
    assert errors[-1] > 1e-13  # or rounding errors would be what is measured


def test_energy_is_conserved_without_control(youbot):
    plant, start = Plant(youbot), _start(youbot)
    end = _run(plant, np.zeros(youbot.nz), 0.3, 300)
    before, after = (youbot.energy(state.q, state.z) for state in (start, end))
    assert abs(after - before) < 1e-9 * max(1.0, abs(before))
    # and there is something to conserve: the kinetic energy alone does change
    kinetic = [
        0.5 * state.z @ youbot.dynamics(state.q, state.z).M @ state.z for state in (start, end)
    ]
    assert abs(kinetic[1] - kinetic[0]) > 0.1


def test_work_is_what_the_energy_gains(youbot):
    plant = Plant(youbot, lambda t: np.array([0.1, -0.1, 0.3, 0.0, 0.2]) * np.cos(5.0 * t))
    torque = np.array([0.5, 0.4, 0.3, -0.2, 0.1])
    start, end = _start(youbot), _run(plant, torque, 0.3, 300)
    gained = youbot.energy(end.q, end.z) - youbot.energy(start.q, start.z)
    assert np.isclose(end.work, gained, rtol=1e-7)
    assert abs(gained) > 1e-2


def test_disturbance_is_taken_at_the_times_within_the_step(youbot):
    times = []

    def note(t):
        times.append(t)
        return np.zeros(youbot.nz)

    rk4_step(Plant(youbot, note), 2.0, _start(youbot), np.zeros(youbot.nz), 0.1)
    assert np.allclose(times, [2.0, 2.05, 2.05, 2.1])


def test_known_instant_saves_an_evaluation_and_changes_nothing(youbot):
    plant, state, torque = Plant(youbot), _start(youbot), np.ones(youbot.nz)
    one = rk4_step(plant, 0.0, state, torque, 1e-3)
    other = rk4_step(plant, 0.0, state, torque, 1e-3, plant.at(0.0, state.q, state.z))
    for part, same in zip(one, other, strict=True):
        assert np.array_equal(part, same)
