"""Runge-Kutta on the plant: order, work, and disturbances that change within a step."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mobman.simulation.integrator import RungeKutta
from mobman.simulation.plant import Plant, accelerate


def _start(robot):
    random = np.random.default_rng(80)
    return SimpleNamespace(
        q=robot.q_rest.copy(), z=0.5 * random.standard_normal(robot.nz), work=0.0
    )


def _integrator(plant, torque, h):
    start = _start(plant.robot)
    plant.v[:] = torque
    return RungeKutta(plant, start.q, start.z, h)


def _state(integrator):
    """A copy of the state, and the work done since the start."""
    now = integrator.plant.now
    return SimpleNamespace(q=now.q.copy(), z=now.z.copy(), work=float(integrator.work[0]))


def _run(plant, torque, duration, steps):
    h = duration / steps
    integrator = _integrator(plant, torque, h)
    for i in range(steps):
        integrator.evaluate(i * h)
        integrator.step(i * h)
    return _state(integrator)


@pytest.mark.parametrize("name", ["youbot", "tiago"])
def test_error_falls_with_the_fourth_power_of_the_step(name, request):
    """Without control: the arm falls, the platform rolls."""
    robot = request.getfixturevalue(name)
    plant, none = Plant(robot), np.zeros(robot.nz)

    def end(steps):
        state = _run(plant, none, 0.16, steps)
        return np.concatenate((state.q, state.z))

    exact = end(512)
    errors = [np.linalg.norm(end(steps) - exact) for steps in (32, 64, 128)]
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
    """Once for each time: both slopes in the middle are under the same one."""
    times = []

    def note(t):
        times.append(t)
        return np.zeros(youbot.nz)

    integrator = _integrator(Plant(youbot, note), np.zeros(youbot.nz), 0.1)
    integrator.evaluate(2.0)
    integrator.step(2.0)
    assert np.allclose(times, [2.0, 2.05, 2.1])


def test_slopes_are_under_the_disturbance_of_their_time(youbot):
    """A step against the formula, with accelerations that are asked for one by one."""
    push = np.array([0.3, -0.2, 0.1, 0.5, -0.4])
    torque, h = np.ones(youbot.nz), 0.01
    plant, other = (Plant(youbot, lambda t: np.cos(200.0 * t) * push) for _ in range(2))
    integrator = _integrator(plant, torque, h)
    integrator.evaluate(0.3)
    integrator.step(0.3)
    start, slopes = _start(youbot), []
    q, z = start.q, start.z
    for fraction, later in ((0.0, 0.5), (0.5, 0.5), (0.5, 1.0), (1.0, 0.0)):
        q_slope = youbot.velocity_map(q) @ z
        z_slope = other.acceleration(0.3 + fraction * h, q, z, torque)
        slopes.append(np.concatenate((q_slope, z_slope)))
        q, z = start.q + later * h * q_slope, start.z + later * h * z_slope
    mean = (slopes[0] + 2.0 * (slopes[1] + slopes[2]) + slopes[3]) / 6.0
    end = _state(integrator)
    expected = np.concatenate((start.q, start.z)) + h * mean
    assert np.allclose(np.concatenate((end.q, end.z)), expected, atol=1e-13)


def test_what_was_evaluated_for_a_measurement_serves_the_step(youbot):
    torque, z_dot = np.ones(youbot.nz), np.zeros(youbot.nz)
    one = _integrator(Plant(youbot), torque, 1e-3)
    one.evaluate(0.0)
    one.step(0.0)
    other = _integrator(Plant(youbot), torque, 1e-3)
    plant = other.plant
    plant.now.run_dynamics()
    assert plant.dynamics() == 0
    accelerate(plant.forces, z_dot, np.zeros(1))
    assert np.abs(z_dot).max() > 0.0
    other.step(0.0)
    for part, same in zip(vars(_state(one)).values(), vars(_state(other)).values(), strict=True):
        assert np.array_equal(part, same)
