"""Limits of the motors as laws keep to them."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.controllers.motors import (
    LimitedMotors,
    fit_torque,
    plain_limits,
)
from mobman.errors import GainError
from mobman.simulation.scenario import Scenario


def test_torque_moves_towards_the_inner_one_until_it_fits():
    random = np.random.default_rng(1)
    for _ in range(200):
        limit = random.uniform(0.5, 2.0, 6)
        limit[random.integers(6)] = np.inf
        inside = random.uniform(-0.98, 0.98, 6) * np.where(np.isfinite(limit), limit, 3.0)
        wanted = random.normal(0.0, 2.0, 6)
        v = wanted.copy()
        moved = fit_torque(limit, inside, v)
        assert moved == bool((np.abs(wanted) > limit).any())
        assert (np.abs(v) <= limit).all()
        share = (v - inside) / (wanted - inside)
        assert np.allclose(share, share[0], atol=1e-9)
        if moved:  # and no further than it must
            assert np.isclose(np.abs(v) / limit, 1.0).any()
        else:
            assert np.array_equal(v, wanted)


def test_torque_that_is_not_finite_stays_so():
    """A run that diverged is to be seen."""
    v = np.array([np.nan, 1.0])
    fit_torque(np.ones(2), np.zeros(2), v)
    assert np.isnan(v).any()


class _Told(LimitedMotors):
    """Keeps what it is told, and holds the robot."""

    def reset(self, robot, task, dt):
        self.limits = self.torque_limits(robot, None)
        _, bias, b = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
        self.torque = np.linalg.solve(b, bias)

    def step(self, t, q, z, z_dot):
        return self.torque


def _told(robot, *actuation, law=None):
    law = law or _Told()
    scenario = Scenario(name="s", actuation=list(actuation))
    mm.simulate(robot, law, "circle", duration=2e-3, scenario=scenario)
    return law.limits


def test_law_is_told_the_limits_that_act(youbot):
    own = youbot.limits.torque
    assert np.isinf(own[:2]).all()
    cut = {"type": "saturation", "factor": 0.8}
    assert np.array_equal(_told(youbot, cut), 0.8 * own)
    both = _told(youbot, cut, {"type": "saturation", "torque": 5.0})
    assert np.array_equal(both, np.minimum(0.8 * own, 5.0))
    # where nothing says what acts, the robot's own count
    assert np.array_equal(_told(youbot), own)
    assert np.array_equal(_told(youbot, {"type": "delay", "delay": 1e-3}), own)
    law = _Told()
    _told(youbot, cut, law=law)
    assert np.array_equal(_told(youbot, law=law), own)  # not those of the run before


def test_limits_that_are_given_come_first(youbot):
    law = LimitedMotors()
    law.limit_motors(np.ones(5))
    assert np.array_equal(law.torque_limits(youbot, 3), np.full(5, 3.0))
    given = [1.0, None, 2.0, 3.0, None]
    limits = law.torque_limits(youbot, given)
    assert np.array_equal(limits, [1.0, np.inf, 2.0, 3.0, np.inf])
    assert plain_limits(limits) == given
    with pytest.raises(GainError, match="torque_limits has 2 entries; needed: one number, or 5"):
        law.torque_limits(youbot, [1.0, 2.0])


@pytest.mark.parametrize("wrong", [0.0, [1.0, -1.0], "much", [np.nan], True, [[1.0]], np.inf])
def test_limits_that_are_none_are_refused(wrong):
    with pytest.raises(GainError, match=r"torque_limits = .*: must be numbers from 1e-30 to"):
        mm.make_controller("tsm", torque_limits=wrong)


@pytest.mark.parametrize(
    "law", ["computed-torque-integral", "super-twisting", "disturbance-observer"]
)
def test_a_law_learns_nothing_from_a_torque_that_does_not_act(law, youbot):
    """One tick beyond the limits leaves its state as it was, and so the torque after it."""
    task = mm.make_task("circle", youbot)
    q, z = youbot.q_rest.copy(), np.zeros(youbot.nz)
    moved, still = q + 0.3, np.zeros(youbot.nz)
    torques = {}
    for ticks in (1, 60):
        for limit in (1e-3, np.inf):
            controller = mm.make_controller(law)
            controller.limit_motors(np.full(youbot.nz, limit))
            controller.reset(youbot, task, 1e-3)
            for _ in range(ticks):
                controller.step(0.0, moved, z, still)
            torques[ticks, limit] = controller.step(0.0, q, z, still)
    assert np.allclose(torques[1, 1e-3], torques[60, 1e-3], rtol=1e-12)
    assert not np.allclose(torques[1, np.inf], torques[60, np.inf], rtol=1e-3)


def test_twisting_at_the_limits_comes_back():
    """Where w would wind up while the arm waits for its motors."""
    record = mm.simulate("jackal_z1", "super-twisting", "circle", scenario="real-limits", dt=2e-3)
    assert np.linalg.norm(record.task_error[record.t > 8.0], axis=1).max() < 1e-6
