"""Sliding modes of the first and second order, on scalar plants and on robots."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.errors import largest_after

import mobman as mm
from mobman.controllers.robust import twist, unit_vector_acceleration
from mobman.controllers.task_errors import Tracking


def _twisted(dt, L, end=1.5):
    """sigma of sigma' = u + 40 + 8 sin 10 t from 1 on, and w at the end."""
    sigma, w, rows = 1.0, np.zeros(1), []
    for tick in range(round(end / dt)):
        t = tick * dt
        rows.append(sigma)
        u = twist(sigma, L, dt, w, 0)
        sigma += dt * (u + 40.0) + 0.8 * (math.cos(10.0 * t) - math.cos(10.0 * (t + dt)))
    return np.array(rows), w[0]


def _settled(sigma, width, dt):
    return (np.flatnonzero(np.abs(sigma) > width)[-1] + 1) * dt


def test_super_twisting_is_there_after_a_finite_time():
    """Five hundred times as close does not take longer, as it would on an exponential."""
    L, times, late = 100.0, [], []
    for dt in (1e-3, 1e-4):
        sigma, w = _twisted(dt, L)
        times.append(_settled(sigma, 10.0 * L * dt**2, dt))
        late.append(np.abs(sigma[len(sigma) // 2 :]).max())
        assert np.isclose(w, -40.0 - 8.0 * math.sin(15.0), atol=0.5)
    assert times[1] < 1.1 * times[0]
    assert times[0] < 1.0
    # of second order: a tenth of the period, a hundredth of the error
    assert late[1] < 0.02 * late[0]


def test_super_twisting_does_not_follow_a_faster_disturbance():
    """The bound L is needed: with one below the rate of 80 /s^2 sigma does not stay at 0."""
    slow, _ = _twisted(1e-3, 20.0)
    fast, _ = _twisted(1e-3, 100.0)
    late = [np.abs(sigma[-500:]).max() for sigma in (slow, fast)]
    assert late[0] > 100.0 * late[1]


def test_unit_vector_reaches_its_layer_in_time():
    """|sigma| falls at least at rho less the unknown acceleration, and stays in the layer."""
    rho, layer, Lambda, dt = 8.0, 0.1, 5.0, 1e-3
    unknown = np.array([3.0, -4.0])
    f, z, none = np.array([0.2, -0.1]), np.array([1.0, 2.0]), np.zeros(2)
    first, wanted, p_d = np.linalg.norm(z + Lambda * f), np.zeros(2), np.zeros((4, 2))
    sizes = []
    for _ in range(4000):
        sizes.append(np.linalg.norm(z + Lambda * f))
        at = Tracking(f, np.eye(2), none, p_d, none, z)
        unit_vector_acceleration(at, Lambda, rho, layer, wanted)
        acceleration = wanted + unknown
        f += dt * z + 0.5 * dt**2 * acceleration
        z += dt * acceleration
    reached = np.flatnonzero(np.array(sizes) > layer)[-1] * dt
    assert reached <= (first - layer) / (rho - 5.0) + 2.0 * dt
    # where it rests: rho sigma/layer is the unknown acceleration
    assert np.isclose(sizes[-1], layer * 5.0 / rho, rtol=1e-3)


def test_super_twisting_rejects_what_the_layer_leaves():
    """Masses x1.3 and 1 kg at the tip, without a measured acceleration."""
    runs = {
        law: mm.simulate("tiago_no_hand", law, "circle", duration=4.0, scenario="heavier")
        for law in ("super-twisting", "first-order-sliding")
    }
    assert all(run.ok for run in runs.values())
    errors = {law: largest_after(run, 3.0) for law, run in runs.items()}
    assert errors["super-twisting"] < 1e-5
    assert errors["first-order-sliding"] < 0.2
    assert errors["super-twisting"] < 1e-3 * errors["first-order-sliding"]


@pytest.mark.parametrize("dt", [1e-3, 5e-3])
def test_layer_is_five_ticks_of_rho(dt, youbot):
    law = mm.make_controller("first-order-sliding", rho=30.0)
    law.reset(youbot, mm.make_task("circle", youbot), dt)
    assert np.isclose(law.settings()["layer"], 5.0 * 30.0 * dt)
