"""From the commanded torque to the one that acts: saturation, rate, delay."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.runs import Torque
from support.settings import setting

import mobman as mm
from mobman.simulation.actuation import ActuationChain, Stage
from mobman.simulation.scenario import Scenario

LARGE = 1e9


def _run(robot, function, *actuation, duration=0.05, dt=1e-3, law=None):
    scenario = Scenario(name="s", actuation=list(actuation))
    return mm.simulate(
        robot, law or Torque(function), "circle", duration=duration, dt=dt, scenario=scenario
    )


def _wave(nz, size=5.0):
    return lambda t: size * np.sin(60.0 * t + np.arange(nz))


def _limits(**fields):
    return {"type": "saturation", **fields}


@pytest.mark.parametrize("name", ["youbot", "tiago"])
def test_torque_stays_within_its_limit(name, request):
    robot = request.getfixturevalue(name)
    record = _run(robot, _wave(robot.nz), _limits(torque=2.0))
    applied = record.signals["torque_applied"]
    assert np.array_equal(applied, np.clip(record.torque, -2.0, 2.0))
    assert np.abs(record.torque).max() > 4.0  # what was commanded is kept
    cut = (np.abs(record.torque) > 2.0).any(axis=1)
    assert record.metrics["saturation_share"] == cut.mean()
    assert record.metrics["saturation_start"] == record.t[np.argmax(cut)]
    assert record.metrics["torque_peak"] == 2.0  # of what acts


def test_plant_feels_what_is_applied(youbot):
    function = _wave(5)
    cut = _run(youbot, function, _limits(torque=2.0))
    given = mm.simulate(
        youbot, Torque(lambda t: np.clip(function(t), -2.0, 2.0)), "circle", duration=0.05
    )
    assert np.array_equal(cut.q, given.q)
    assert np.array_equal(cut.z, given.z)
    assert cut.metrics["energy_residual"] == given.metrics["energy_residual"] < 1e-9
    assert cut.metrics["torque_energy"] == given.metrics["torque_energy"]


def test_first_saturation_is_told(youbot):
    record = _run(
        youbot, lambda t: np.full(5, 3.0 if 0.0195 < t < 0.0245 else 0.0), _limits(torque=2.0)
    )
    assert np.isclose(record.metrics["saturation_start"], 0.02)
    assert np.isclose(record.metrics["saturation_share"], 5 / 51)


def test_run_without_limits_is_never_saturated(youbot):
    metrics = mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.02).metrics
    assert (metrics["saturation_share"], metrics["saturation_start"]) == (0.0, 0.02)


def test_limits_are_those_of_the_urdf_or_of_an_acceleration(robot):
    """factor x effort; where there is none, holding torque + acceleration x inertia."""
    stage = Scenario(name="s", actuation=[_limits(factor=0.5, acceleration=20.0)]).actuation[0]
    level = stage.level(setting(robot))
    stated = np.isfinite(robot.limits.torque)
    assert np.array_equal(level[stated], 0.5 * robot.limits.torque[stated])
    _, bias, b = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    holding = np.abs(np.linalg.solve(b, bias))
    expected = holding + 20.0 * robot.motor_inertia(robot.q_rest)
    assert np.allclose(level[~stated], expected[~stated])


def test_motors_without_a_limit_are_free(youbot):
    record = _run(youbot, lambda t: np.full(5, 50.0), _limits(factor=0.1), duration=0.005)
    applied = record.signals["torque_applied"][0]
    assert np.allclose(applied, [50.0, 50.0, 0.95, 0.95, 0.6])


def test_rate_is_bounded_and_follows_without_error_below_it(youbot):
    rate = {"type": "rate-limit", "torque": 10.0, "rise_time": 0.01}  # 1 N m a tick
    record = _run(youbot, lambda t: np.full(5, 4.5 if t > 0.0095 else 0.0), rate)
    applied = record.signals["torque_applied"][:, 0]
    expected = np.interp(np.arange(51), [9, 13, 14], [0.0, 4.0, 4.5])
    assert np.allclose(applied, expected, atol=1e-12)
    assert np.isclose(record.metrics["saturation_share"], 4 / 51)
    slow = _run(youbot, lambda t: np.full(5, 10.0 * t), rate)
    assert np.array_equal(slow.signals["torque_applied"], slow.torque)


def test_rate_limit_starts_from_no_torque(youbot):
    record = _run(
        youbot, lambda t: np.ones(5), {"type": "rate-limit", "torque": 1.0, "rise_time": 0.01}
    )
    assert np.allclose(
        record.signals["torque_applied"][:, 0], np.minimum(1.0, np.arange(1, 52) / 10)
    )


@pytest.mark.parametrize("ticks", [1, 3])
def test_delay_of_whole_ticks_shifts_the_torques(youbot, ticks):
    record = _run(youbot, _wave(5), {"type": "delay", "delay": ticks * 1e-3})
    applied = record.signals["torque_applied"]
    assert not applied[:ticks].any()
    assert np.array_equal(applied[ticks:], record.torque[:-ticks])


def test_delays_add_up(youbot):
    one = _run(youbot, _wave(5), {"type": "delay", "delay": 3e-3})
    two = _run(youbot, _wave(5), *[{"type": "delay", "delay": 1.5e-3}] * 2)
    assert np.array_equal(one.q, two.q)


@pytest.mark.parametrize("name", ["youbot", "tiago"])
@pytest.mark.parametrize("dt", [1e-3, 4e-3])
def test_delay_of_a_fraction_of_a_tick_acts_within_it(name, dt, request):
    """2.5 ticks, against a run of half the period, in which these are whole ones."""
    robot = request.getfixturevalue(name)
    wave = _wave(robot.nz, 0.5)
    late = {"type": "delay", "delay": 2.5 * dt}
    record = _run(robot, wave, late, duration=10 * dt, dt=dt)
    # the same commands, each held for two of the short ticks
    same = Torque(lambda t: wave(math.floor(t / dt + 1e-6) * dt))
    fine = _run(robot, None, late, duration=10 * dt, dt=dt / 2, law=same)
    assert np.array_equal(record.torque, fine.torque[::2])
    assert np.allclose(record.q, fine.q[::2], atol=1e-9)
    assert np.allclose(record.z, fine.z[::2], atol=1e-7)
    assert np.abs(record.z - _run(robot, wave, duration=10 * dt, dt=dt).z).max() > 1e-4
    # and the record has its mean over each tick
    applied, halves = record.signals["torque_applied"], fine.signals["torque_applied"]
    assert np.allclose(applied[:-1], 0.5 * (halves[:-1:2] + halves[1::2]), atol=1e-14)
    assert record.metrics["energy_residual"] < 1e-5


def test_exact_acceleration_is_under_the_torque_that_acts(youbot):
    from support.listening import Listener

    listener = Listener(_wave(5))
    record = _run(youbot, None, {"type": "delay", "delay": 1.4e-3}, law=listener, duration=0.01)
    for k in range(2, 11):  # just before tick k, the command of tick k - 2 acts
        m, bias, b = youbot.dynamics(record.q[k], record.z[k])
        expected = np.linalg.solve(m, b @ record.torque[k - 2] - bias)
        assert np.allclose(listener.z_dot[k], expected, atol=1e-8)


def test_saturation_comes_before_or_after_the_rate_as_listed(youbot):
    limit, rate = _limits(torque=1.0), {"type": "rate-limit", "torque": 1.0, "rise_time": 0.002}

    def function(t):
        return np.full(5, 3.0 if t < 0.0095 else 0.0)

    first, last = _run(youbot, function, limit, rate), _run(youbot, function, rate, limit)
    # the rate limit behind the saturation begins to fall at once; before it, from 3
    assert first.signals["torque_applied"][10, 0] == 0.5
    assert last.signals["torque_applied"][10, 0] == 1.0


@pytest.mark.parametrize(
    "actuation",
    [
        {"type": "delay", "delay": 0.0},
        _limits(torque=LARGE),
        {"type": "rate-limit", "torque": LARGE, "rise_time": 1e-3},
        _limits(factor=1.0),  # of the wheels, which have no limit, and far above for the arm
    ],
)
@pytest.mark.parametrize("law", ["tsm", "pseudo-inverse"])
def test_what_limits_nothing_is_none_bit_for_bit(youbot, actuation, law):
    if actuation.get("factor"):
        actuation = {**actuation, "factor": LARGE}
    controller = mm.make_controller(law, **({"a": 0.2, "A": 0.2} if law == "tsm" else {}))
    found = _run(youbot, None, actuation, law=controller)
    expected = mm.simulate(youbot, controller, "circle", duration=0.05)
    assert np.array_equal(found.q, expected.q)
    assert np.array_equal(found.z, expected.z)
    assert np.array_equal(found.torque, expected.torque)
    assert ("torque_applied" in found.signals) == (actuation["type"] != "delay")


@pytest.mark.parametrize("delay", [1.0, 0.0505, 1e12])
def test_delay_longer_than_the_run_is_no_torque_at_all(youbot, delay):
    record = _run(youbot, _wave(5), {"type": "delay", "delay": delay})
    expected = mm.simulate(youbot, Torque(lambda t: np.zeros(5)), "circle", duration=0.05)
    assert record.ok
    assert np.allclose(record.q, expected.q, atol=1e-12)
    assert not record.signals["torque_applied"][:-1].any()  # from the last tick nothing follows


def test_delay_too_short_to_tell_is_none(youbot):
    record = _run(youbot, _wave(5), {"type": "delay", "delay": 1e-12})
    assert np.array_equal(record.q, _run(youbot, _wave(5)).q)


def test_applied_torque_is_in_the_file(youbot, tmp_path):
    record = _run(youbot, _wave(5), _limits(torque=2.0))
    again = mm.load_record(record.save(tmp_path / "run.h5"))
    assert np.array_equal(again.signals["torque_applied"], record.signals["torque_applied"])
    assert np.array_equal(again.torque, record.torque)


def test_run_that_diverges_under_a_delay_says_when(youbot):
    record = _run(youbot, lambda t: np.full(5, 1e7), {"type": "delay", "delay": 1.5e-3})
    assert record.status == "diverged"
    assert "t = 0.00" in record.message


def test_a_stage_that_does_not_tell_whether_it_met_a_limit_is_named():
    chain = ActuationChain([Stage(apply=lambda torque: torque)], 1e-3, 2)
    with pytest.raises(mm.MobmanError, match=r"lambda.* gave array.*whether it met a limit"):
        chain.take(np.zeros(2))
