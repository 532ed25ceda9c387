"""How z' is measured."""

from __future__ import annotations

import numpy as np
from support.settings import estimator

import mobman as mm
from mobman.simulation.scenario import Scenario

DT = 1e-2


class Listener:
    """A controller that only listens."""

    def __init__(self, torque):
        self.torque = torque
        self.heard = []

    def reset(self, robot, task, dt):
        self.heard = []

    def step(self, t, q, z, z_dot):
        self.heard.append((t, q, z, z_dot))
        return self.torque


def test_exact_is_the_true_one():
    true = np.array([1.0, 2.0])
    assert np.array_equal(estimator([], DT, type="exact")(np.zeros(2), true), true)


def test_backward_difference_lags_by_half_a_tick():
    estimate = estimator([], DT, type="backward-difference")
    z = [np.array([np.sin(3.0 * k * DT)]) for k in range(5)]
    found = [estimate(value, np.array([np.nan])) for value in z]
    assert not found[0].any()
    for k in range(1, 5):
        assert np.allclose(found[k], (z[k] - z[k - 1]) / DT)


def test_exact_acceleration_is_that_under_the_torque_held_until_now(youbot):
    """What a sensor would show just before the tick: torques change at ticks, z does not."""
    controller = Listener(np.full(5, 0.2))
    mm.simulate(youbot, controller, "circle", duration=0.02)
    _, q, z, z_dot = controller.heard[0]
    m, bias, b = youbot.dynamics(q, z)
    assert np.allclose(z_dot, np.linalg.solve(m, -bias))  # v = 0 until the first tick
    for _, q, z, z_dot in controller.heard[1:]:
        m, bias, b = youbot.dynamics(q, z)
        assert np.allclose(z_dot, np.linalg.solve(m, b @ controller.torque - bias), atol=1e-9)


def test_controller_hears_differences_where_the_scenario_says_so(youbot):
    controller = Listener(np.full(5, 0.2))
    scenario = Scenario(name="differences", acceleration="backward-difference")
    mm.simulate(youbot, controller, "circle", duration=0.02, scenario=scenario)
    z = np.array([heard[2] for heard in controller.heard])
    z_dot = np.array([heard[3] for heard in controller.heard])
    assert not z_dot[0].any()
    assert np.allclose(z_dot[1:], np.diff(z, axis=0) / 1e-3, atol=1e-9)
