"""``tsm`` on the paper's robot, task and gains: 10 s at a sampling period of 1 ms."""

from __future__ import annotations

import numpy as np
import pytest
from support.errors import largest_after, size_at

import mobman as mm
from mobman.controllers.gains import CriterionGains
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.task_map import TaskMap


@pytest.fixture(scope="module")
def record():
    return mm.simulate("youbot", mm.make_controller("tsm", a=0.2, A=0.2), "paper", duration=10.0)


def test_run_is_completed(record):
    assert (record.status, record.message) == ("ok", "")
    assert record.metrics["success"] == 1.0
    assert len(record.t) == 10_001


def test_tip_settles_in_finite_time(record):
    assert record.metrics["settling_time_1e-4"] <= 5.5
    assert record.metrics["settling_time_1e-6"] <= 6.0
    assert largest_after(record, 7.0) < 1e-8
    assert record.metrics["task_error_max"] < 1e-8


@pytest.mark.parametrize(
    ("time", "error"), [(0, 4.05), (1, 1.83), (2, 0.64), (3, 0.155), (4, 2.0e-2)]
)
def test_reaching_is_that_of_an_independent_implementation(record, time, error):
    """Whose inertias were approximate: the law makes the motion depend little on them."""
    assert np.isclose(size_at(record, time), error, rtol=0.03)


def test_auxiliary_errors_vanish(record):
    """The transversality conditions hold: the motion is locally optimal."""
    assert largest_after(record, 5.0, record.auxiliary_error) < 1e-6
    assert record.metrics["auxiliary_error_max"] < 1e-6


def test_torques_are_continuous(record):
    """No step above 1 % of the peak after the first second."""
    assert record.metrics["torque_step"] < 0.01
    steps = np.abs(np.diff(record.torque, axis=0))[record.t[1:] > 1.0]
    assert steps.max() < 0.01 * np.abs(record.torque).max()
    # and the peak is of the size of what carrying and accelerating the robot takes
    assert record.metrics["torque_peak"] < 50.0


def test_sliding_variables_reach_zero_and_stay(record):
    for name in ("sliding/s", "sliding/S"):
        assert record.signals[name].shape == (10_001, 5)
        late = np.abs(record.signals[name][record.t >= 7.0]).max()
        assert late < 1e-2 * np.abs(record.signals[name]).max()


def test_bound_a_holds_once_the_robot_moves(record, youbot):
    """lambda_min(J J^T) is 0.0023 at the start and above a = 0.2 from half a second on."""
    assert np.isclose(record.metrics["lambda_min"], 0.0023, atol=1e-4)
    task = mm.make_task("paper", youbot)
    criterion, complement = CriterionGains().criterion(youbot, task), None
    for i in range(500, 10_001, 100):
        q, z = record.q[i], record.z[i]
        now = extended_kinematics(youbot, TaskMap(), criterion, q, z, complement)
        complement = now.complement
        assert 0.23 < np.linalg.svd(now.J, compute_uv=False)[-1] ** 2 < 0.3


def test_simulation_keeps_to_its_own_laws(record, youbot):
    assert record.metrics["constraint_residual"] < 1e-12
    assert record.metrics["energy_residual"] < 1e-8
    # q' = C z: the positions are the integral of the velocities (trapezium, h^2/12 q''')
    q_dot = np.array([youbot.velocity_map(q) @ z for q, z in zip(record.q, record.z, strict=True)])
    travelled = 0.5e-3 * (q_dot[1:] + q_dot[:-1]).sum(axis=0)
    moved = record.q[-1] - record.q[0]
    assert np.allclose(travelled, moved, atol=1e-4 * np.abs(moved).max())


def test_platform_does_not_skid(record):
    """The velocity across the heading, from the recorded positions alone."""
    x, y, theta = record.q[:, :3].T
    speed = np.hypot(np.gradient(x, 1e-3), np.gradient(y, 1e-3))
    across = np.gradient(y, 1e-3) * np.cos(theta) - np.gradient(x, 1e-3) * np.sin(theta)
    assert speed.max() > 1.0
    assert np.abs(across[1:-1]).max() < 1e-4 * speed.max()


def test_wheels_roll(record):
    """R (phi_1 + phi_2)/2 is the distance along the heading, R (phi_1 - phi_2)/(2 W) the turning."""
    phi_1, phi_2 = (record.q - record.q[0])[:, 3:5].T
    turned = record.q[:, 2] - record.q[0, 2]
    assert np.allclose(turned, 0.05 * (phi_1 - phi_2) / (2 * 0.158), atol=1e-9)
