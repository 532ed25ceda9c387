"""Disturbance torques: value, seeding, and how strong they are."""

from __future__ import annotations

import numpy as np
import pytest
from support.settings import motors

from mobman.errors import SpecError
from mobman.simulation.disturbances import disturbances
from mobman.simulation.scenario import Scenario

INERTIA = np.array([2.0, 0.5, 0.1])


def _start(*sources, seed=0, inertia=INERTIA):
    scenario = Scenario(name="test", disturbances=list(sources))
    return scenario.disturbance(motors(inertia, seed))


SOURCES = {
    "constant": {"type": "constant", "torque": 0.4},
    "sinusoid": {"type": "sinusoid", "torque": 0.4, "frequency": 0.5},
    "steps": {"type": "steps", "torque": 0.4, "interval": 0.25},
}
TIMES = np.arange(0.0, 4.0, 0.01)


def _history(torque):
    return np.array([torque(t) for t in TIMES])


def test_kinds_are_found_by_name():
    assert set(disturbances.names()) >= set(SOURCES)


def test_no_disturbances_is_none():
    assert _start() is None


def test_constant_does_not_change():
    assert np.array_equal(_history(_start(SOURCES["constant"])), np.full((len(TIMES), 3), 0.4))


def test_sinusoid_has_its_amplitude_and_frequency():
    values = _history(_start(SOURCES["sinusoid"]))
    assert np.allclose(np.abs(values).max(axis=0), 0.4, atol=1e-3)
    # of 0.5 Hz: d'' = -(pi)^2 d, and a period of 2 s
    assert np.allclose(values[200:], values[:200], atol=1e-12)
    second = np.diff(values, 2, axis=0) / 0.01**2
    assert np.allclose(second, -(np.pi**2) * values[1:-1], atol=1e-3)


def test_phases_of_the_motors_differ():
    first = _start(SOURCES["sinusoid"])(0.0)
    assert len(set(first.round(6))) == 3


def test_steps_hold_a_level_for_their_interval_and_start_from_zero():
    values = _history(_start(SOURCES["steps"])).reshape(16, 25, 3)
    assert np.ptp(values, axis=1).max() == 0.0
    levels = values[:, 0]
    assert not levels[0].any()
    assert np.all(np.abs(levels) <= 0.4)
    assert np.all(np.abs(np.diff(levels, axis=0)).max(axis=1) > 0.0)
    assert levels.std() > 0.1


def test_steps_do_not_depend_on_the_order_in_which_they_are_asked():
    forward, backward = _start(SOURCES["steps"]), _start(SOURCES["steps"])
    last = backward(3.9)
    assert np.array_equal(forward(0.3), backward(0.3))
    assert np.array_equal(forward(3.9), last)


@pytest.mark.parametrize("kind", ["sinusoid", "steps"])
def test_seed_decides(kind):
    one, same, other = (_history(_start(SOURCES[kind], seed=s)) for s in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.allclose(one, other)


def test_disturbances_add_up_and_do_not_change_each_other():
    both = _history(_start(SOURCES["sinusoid"], SOURCES["constant"]))
    alone = _history(_start(SOURCES["sinusoid"]))
    assert np.allclose(both, alone + 0.4, atol=1e-14)
    # steps draw their levels as they go, and yet another one beside them changes none of these
    added = _history(_start(SOURCES["steps"], SOURCES["sinusoid"]))
    added = added - _history(_start(SOURCES["steps"]))
    assert np.allclose(added[200:], added[:200], atol=1e-12)


def test_two_of_a_kind_are_not_the_same():
    twice = _history(_start(SOURCES["sinusoid"], SOURCES["sinusoid"]))
    assert not np.allclose(twice, 2.0 * _history(_start(SOURCES["sinusoid"])), atol=0.05)


@pytest.mark.parametrize("kind", SOURCES)
def test_amplitude_may_differ_from_motor_to_motor(kind):
    values = _history(_start({**SOURCES[kind], "torque": [1.0, 0.0, 0.1]}))
    assert not values[:, 1].any()
    assert 0.0 < np.abs(values[:, 2]).max() <= 0.1


@pytest.mark.parametrize("kind", SOURCES)
def test_amplitude_may_be_an_acceleration(kind):
    """In the measure of what each motor's axis feels."""
    source = dict(SOURCES[kind])
    plain = _history(_start(source))
    source["acceleration"] = source.pop("torque")
    assert np.allclose(_history(_start(source)), plain * INERTIA)


def test_acceleration_is_what_the_axis_gets(youbot):
    """At rest, without gravity: the motor's own axis accelerates so when the others are held."""
    inertia = youbot.motor_inertia(youbot.q_rest)
    m, _, b = youbot.dynamics(youbot.q_rest, np.zeros(5))
    # phi' = (2/R) alpha: kinetic energy of one wheel's rate alone, and of one joint's
    rates = np.linalg.inv(b)
    for i in range(5):
        z = rates[:, i]
        assert np.isclose(inertia[i], z @ m @ z)


NOISE = {"type": "noise", "torque": 0.4, "band": [2.0, 10.0]}


def test_noise_is_in_its_band_with_its_root_mean_square():
    times = np.arange(0.0, 200.0, 0.01)
    torque = _start(NOISE)
    values = np.array([torque(t) for t in times])
    assert np.allclose(np.sqrt((values**2).mean(axis=0)), 0.4, rtol=0.05)
    power = np.abs(np.fft.rfft(values * np.hanning(len(values))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(times), 0.01)
    outside = (frequency < 1.9) | (frequency > 10.1)
    assert power[outside].sum() < 1e-4 * power.sum()
    # flat within it: each quarter of the band has a quarter of the power
    for low in (2.0, 4.0, 6.0, 8.0):
        quarter = power[(frequency >= low) & (frequency < low + 2.0)].sum()
        assert np.isclose(quarter / power.sum(), 0.25, atol=0.03)
    assert np.abs(np.corrcoef(values.T) - np.eye(3)).max() < 0.1


def test_noise_is_a_function_of_time_and_the_seed():
    one, other = _start(NOISE), _start(NOISE)
    later = other(3.0)
    assert np.array_equal(one(1.0), other(1.0))
    assert np.array_equal(one(3.0), later)
    assert not np.allclose(one(1.0), _start(NOISE, seed=1)(1.0))


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_growing_is_its_amplitude_at_its_time_and_has_no_bound(power):
    torque = _start({"type": "growing", "torque": 0.4, "time": 5.0, "power": power})
    assert not torque(0.0).any()
    assert np.allclose(np.abs(torque(5.0)), 0.4)
    assert np.allclose(torque(50.0), 10.0**power * torque(5.0))
    signs = {float(np.sign(s)) for seed in range(5) for s in
             _start({"type": "growing", "torque": 0.4, "time": 5.0}, seed=seed)(1.0)}  # fmt: skip
    assert signs == {-1.0, 1.0}


@pytest.mark.parametrize(
    ("source", "named"),
    [
        ({"type": "constant"}, ["'constant'", "exactly one of 'torque' or 'acceleration'"]),
        (
            {"type": "constant", "torque": 1.0, "acceleration": 1.0},
            ["exactly one of 'torque' or 'acceleration'"],
        ),
        ({"type": "sinusoid", "torque": 1.0}, ["'sinusoid'", "'frequency'", "missing"]),
        ({**SOURCES["sinusoid"], "frequency": 0.0}, ["'frequency'", "0", "greater than 0"]),
        ({**SOURCES["steps"], "interval": -1.0}, ["'interval'", "-1"]),
        ({**SOURCES["steps"], "period": 1.0}, ["'period'", "unknown", "interval"]),
        ({"type": "constant", "torque": "strong"}, ["torque", "'strong'"]),
        ({"type": "constant", "torque": [1.0, 2.0]}, ["2 entries", "3 motors"]),
    ],
)
def test_wrong_parameters_are_told(source, named):
    with pytest.raises(SpecError) as caught:
        _start(source)
    for text in named:
        assert text in str(caught.value)


def test_misspelt_kind_is_answered_with_the_nearest_name():
    with pytest.raises(
        SpecError, match="unknown disturbance type 'sinus'; did you mean 'sinusoid'"
    ):
        _start({"type": "sinus", "torque": 1.0})
