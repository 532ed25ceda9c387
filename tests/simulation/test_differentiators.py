"""z' from z: a difference, a filtered one, Levant's differentiator."""

from __future__ import annotations

import numpy as np
import pytest
from support.settings import estimator

import mobman as mm
from mobman.simulation.scenario import Scenario

DT = 1e-3
T = np.arange(0.0, 4.0, DT)


def _estimate(signal, **source):
    estimate = estimator(["z"], DT, **source)
    true = np.array([np.nan])  # not to be looked at
    return np.array([estimate(np.array([value]), true)[0] for value in signal])


def _levant(signal, bound):
    return _estimate(signal, type="robust-differentiator", lipschitz=bound)


def _filtered(signal, cutoff):
    return _estimate(signal, type="filtered-difference", cutoff=cutoff)


@pytest.mark.parametrize(("frequency", "gain"), [(1.0, 0.99875), (20.0, 0.70711), (60.0, 0.31623)])
def test_filter_has_its_gain(frequency, gain):
    """Of a first-order low pass: 1/sqrt(1 + (f/f_c)^2)."""
    w = 2.0 * np.pi * frequency
    found = _filtered(np.sin(w * T) / w, 20.0)[2000:]
    spectrum = 2.0 / len(found) * abs(found @ np.exp(-1j * w * T[2000:]))
    assert np.isclose(spectrum, gain, rtol=0.07)


def test_filter_answers_a_step_with_the_exponential():
    slope = np.where(T < 1.0, 0.0, 3.0 * (T - 1.0))
    late = T[1001:1200] - 1.0
    expected = 3.0 * (1.0 - np.exp(-2.0 * np.pi * 20.0 * late))
    assert np.allclose(_filtered(slope, 20.0)[1001:1200], expected, atol=1e-9)


def test_filter_that_lets_all_through_is_the_difference():
    signal = np.sin(3.0 * T)
    difference = _estimate(signal, type="backward-difference")
    assert np.array_equal(_filtered(signal, 1e6), difference)


@pytest.mark.parametrize("kind", ["filtered-difference", "robust-differentiator"])
def test_first_tick_is_zero(kind):
    parameter = {"cutoff": 20.0} if kind.startswith("f") else {"lipschitz": 10.0}
    assert _estimate([5.0, 5.0], type=kind, **parameter)[0] == 0.0


def test_levants_is_exact_after_a_finite_time():
    """|z''| <= 4: then only the delay of half a tick is left."""
    found = _levant(np.sin(2.0 * T), 5.0)
    exact = 2.0 * np.cos(2.0 * T)
    assert np.abs(found - exact)[:100].max() > 1.0  # it starts from 0
    assert np.abs(found - exact)[1500:].max() < 4.0 * DT
    assert np.allclose(found[1500:], np.diff(np.sin(2.0 * T))[1499:] / DT, atol=1e-12)


def test_levants_does_not_chatter():
    """The explicit one has steps of 1.1 L dt for ever."""
    found = _levant(2.0 * T, 100.0)[1000:]
    assert np.allclose(found, 2.0, atol=1e-9)
    assert np.abs(np.diff(found)).max() < 1e-9


def test_levants_solves_the_implicit_equations():
    """Put into the discretised equations, off the surface and on it."""
    bound, random = 7.0, np.random.default_rng(0)
    signal = np.cumsum(random.standard_normal(200)) * 1e-4
    estimate = estimator(["z"], DT, type="robust-differentiator", lipschitz=bound)
    on = off = 0
    rate, value = 0.0, signal[0]
    estimate(signal[:1], signal[:1])
    for z in signal[1:]:
        found = estimate(np.array([z]), np.array([0.0]))[0]
        n = (rate - found) / (1.1 * bound * DT)  # the sign that the second equation used
        assert abs(n) <= 1.0 + 1e-12
        if abs(n) < 1.0 - 1e-9:  # on the surface: sigma = 0
            sigma, on = 0.0, on + 1
        else:
            # value + dt (rate+ - 1.5 sqrt(L |sigma|) n) = z + sigma, by bisection
            low, high = 0.0, 1.0
            for _ in range(80):
                middle = 0.5 * (low + high)
                left = n * (value + DT * found - z) - 1.5 * DT * np.sqrt(bound * middle) - middle
                low, high = (middle, high) if left > 0.0 else (low, middle)
            sigma, off = n * low, off + 1
        left = value + DT * (found - 1.5 * np.sqrt(bound * abs(sigma)) * n)
        assert np.isclose(left, z + sigma, atol=1e-12)
        rate, value = found, z + sigma
    assert on > 5
    assert off > 5


@pytest.mark.parametrize("size", [1e-4, 1e-3])
def test_levants_under_noise_is_as_good_as_its_theorem(size):
    """Of the order of sqrt(L eps), where a difference is of the order of eps/dt."""
    bound = 5.0
    noise = np.random.default_rng(0).uniform(-size, size, len(T))
    signal, exact = np.sin(2.0 * T) + noise, 2.0 * np.cos(2.0 * T)
    error = np.abs(_levant(signal, bound) - exact)[2000:].max()
    assert error < 2.0 * np.sqrt(bound * size)
    difference = _estimate(signal, type="backward-difference")
    assert np.abs(difference - exact)[2000:].max() > 4.0 * error


def test_each_component_may_have_its_bound(youbot):
    bounds = [1.0, 10.0, 100.0, 1e3, 1e4]
    estimate = estimator(youbot.velocity_names, DT, type="robust-differentiator", lipschitz=bounds)
    estimate(np.zeros(5), np.zeros(5))
    jumped = estimate(np.full(5, 100.0), np.zeros(5))
    assert np.allclose(jumped, 1.1 * DT * np.array(bounds))


@pytest.mark.parametrize("name", ["youbot", "tiago_no_hand"])
def test_controller_hears_the_estimate_of_its_run(name):
    from support.listening import Listener

    robot = mm.load_robot(name)
    listener = Listener(lambda t: np.full(robot.nz, 0.05 * np.sin(20.0 * t)))
    source = {"type": "filtered-difference", "cutoff": 30.0}
    mm.simulate(
        robot, listener, "circle", duration=0.05, scenario=Scenario(name="s", acceleration=source)
    )
    estimate = estimator(robot.velocity_names, DT, **source)
    expected = [estimate(z, z) for z in listener.z]
    assert np.array_equal(listener.z_dot, expected)
