"""Slotine and Li's law: its regressor, its Lyapunov function, and what it learns."""

from __future__ import annotations

import numpy as np
from support.states import random_states

import mobman as mm
from mobman.controllers.adaptive import Regressor, nominal_parameters
from mobman.model.dynamics import Buffers


def _regressor(robot, q, z, z_r, z_r_dot):
    now = Buffers(robot)
    now.q[:], now.z[:] = q, z
    now.velocity()
    regressor = Regressor(robot, now, np.array(z_r_dot))
    regressor.z_r[:] = z_r
    regressor.evaluate()
    return regressor.Y.copy()


def test_regressor_is_the_reduced_dynamics(robot):
    """Y theta = M z' + Pz + G where the reference is the motion itself."""
    random = np.random.default_rng(40)
    theta = nominal_parameters(robot)
    for q, z in random_states(robot, 5):
        z_dot = random.standard_normal(robot.nz)
        M, bias, _ = robot.dynamics(q, z)
        force = M @ z_dot + bias
        found = _regressor(robot, q, z, z, z_dot) @ theta
        assert np.abs(found - force).max() < 1e-9 * np.abs(force).max()


def test_inertia_rate_less_twice_the_coriolis_matrix_is_skew_symmetric(robot):
    """x^T (M' - 2 P) x = 0 for every x, by a central difference of M along the motion."""
    random, theta, h = np.random.default_rng(41), nominal_parameters(robot), 1e-5
    for q, z in random_states(robot, 3):
        x, none = random.standard_normal(robot.nz), np.zeros(robot.nz)
        q_dot = robot.velocity_map(q) @ z
        M_rate = (robot.reduced_inertia(q + h * q_dot) - robot.reduced_inertia(q - h * q_dot)) / (
            2.0 * h
        )
        P_x = (_regressor(robot, q, z, x, none) - _regressor(robot, q, z, none, none)) @ theta
        power = x @ M_rate @ x
        assert abs(power - 2.0 * x @ P_x) < 1e-6 * max(abs(power), np.abs(M_rate).max() * x @ x)


def _learned(youbot, rate, duration):
    """A run on a plant 1.3 times as heavy, on a path that excites."""
    model = youbot.model.copy()
    for inertia in model.inertias:
        inertia.mass *= 1.3
        inertia.inertia = 1.3 * inertia.inertia
    true, law = youbot.with_model(model), mm.make_controller("adaptive")
    task = mm.make_task("lissajous", youbot, rate=rate)
    record = mm.simulate(youbot, law, task, plant=true, duration=duration)
    assert record.ok, record.message
    return record, law, true


def test_torques_that_do_not_act_teach_it_nothing():
    """With stiff gains its first torques are beyond the limits, for which it was lost."""
    gains = {"K_p": 4871.0, "K_v": 350.1, "k_d": 332.1, "omega": 3.995}
    law = mm.make_controller("adaptive", **gains)
    record = mm.simulate("tiago_no_hand", law, "circle", duration=4.0, scenario="real-limits")
    assert record.metrics["saturation_share"] > 0.0
    assert record.metrics["task_error_final"] < 1e-6


def test_lyapunov_function_decreases(youbot):
    """V = (s^T M s + error^T Gamma^-1 error)/2, with the true M and parameters."""
    record, law, true = _learned(youbot, 1.0, 3.0)
    known = law.Gamma > 0.0  # the rest are of bodies without mass
    s, theta = (record.signals[f"adaptation/{name}"] for name in ("s", "theta"))
    errors = theta - nominal_parameters(true)
    assert not errors[:, ~known].any()
    V = 0.5 * (errors[:, known] ** 2 / law.Gamma[known]).sum(axis=1)
    V += [0.5 * a @ true.reduced_inertia(q) @ a for q, a in zip(record.q, s, strict=True)]
    assert np.diff(V).max() < 0.0
    assert V[-1] < V[0] - 0.3


def test_parameters_converge_where_the_motion_shows_them(youbot):
    """The forces that the estimate predicts at random states go to the true ones."""
    record, _, true = _learned(youbot, 3.0, 6.0)
    random, nominal = np.random.default_rng(42), nominal_parameters(youbot)
    before, after = [], []
    theta = record.signals["adaptation/theta"][-1]
    for q, _ in random_states(youbot, 20):
        q = youbot.q_rest + 0.3 * (q - youbot.q_rest)
        none, z_dot = np.zeros(youbot.nz), random.standard_normal(youbot.nz)
        Y = _regressor(youbot, q, none, none, z_dot)
        force = Y @ nominal_parameters(true)
        before.append(np.linalg.norm(Y @ nominal - force))
        after.append(np.linalg.norm(Y @ theta - force))
    assert np.mean(after) < 0.3 * np.mean(before)
