"""What a tick costs, counted: how often each of Pinocchio's algorithms runs.

Seconds differ from machine to machine; these numbers do not. One call more is a tick that is slower.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin
import pytest
from support.runs import Torque

import mobman as mm
from mobman.controllers.protocol import controllers

TICKS = 20

PLANT = {"crba": 4, "nonLinearEffects": 4}  # of Runge-Kutta; the first ones serve the measurement
TRANSPOSES = {"crba": 1}  # in world axes, which leaves the Jacobians behind
FULL_MODEL = {**TRANSPOSES, "nonLinearEffects": 1}
MORE = {"adaptive": {"computeJointTorqueRegressor": 2}}
LAWS = {
    name: (FULL_MODEL if "bias" in controllers.get(name).uses else TRANSPOSES) | MORE.get(name, {})
    for name in mm.list_controllers()
}
# of 20 ticks: one solution, with the tip at the ends of eight intervals
PLANS = {"mpc": {"crba": 8}}
LAMBDA_MIN = {"crba": 1}  # the metric, every 10 ms


@pytest.fixture
def calls(monkeypatch):
    """Counts the calls of every function of Pinocchio from here on."""
    counted: Counter[str] = Counter()

    def counting(name, function):
        def count(*arguments, **options):
            counted[name] += 1
            return function(*arguments, **options)

        return count

    functions = [name for name, item in vars(pin).items() if type(item) is type(pin.crba)]
    assert {"crba", "nonLinearEffects", "rnea", "aba", "forwardKinematics"} <= set(functions)
    for name in functions:
        monkeypatch.setattr(pin, name, counting(name, getattr(pin, name)))
    return counted


def _controller(law):
    # bounds are given, since finding them takes hundreds of evaluations
    return mm.make_controller(law, **({"a": 0.2, "A": 0.2} if law.startswith("tsm") else {}))


def _of_more_ticks(calls, robot, controller, dt=1e-3, **options):
    """What twice as many ticks cost more."""
    counts = []
    for ticks in (TICKS, 2 * TICKS):
        calls.clear()
        # a robot of its own: one that was used before holds functions that are not counted
        record = mm.simulate(
            mm.load_robot(robot), controller, "circle", duration=ticks * dt, dt=dt, **options
        )
        assert record.ok, record.message
        counts.append(Counter(calls))
    counts[1].subtract(counts[0])
    return {name: count for name, count in counts[1].items() if count}


def _of_law(law):
    return (TICKS, LAWS[law]), (1, PLANS.get(law, {}))


def _total(*parts):
    """The sum of (times, what is called each time)."""
    total: Counter[str] = Counter()
    for times, names in parts:
        for name, count in names.items():
            total[name] += times * count
    return dict(total)


@pytest.mark.parametrize("robot", ["youbot", "tiago_no_hand"])
@pytest.mark.parametrize("law", LAWS)
def test_tick_of_a_simulation(calls, robot, law):
    found = _of_more_ticks(calls, robot, _controller(law))
    assert found == _total((TICKS, PLANT), *_of_law(law), (TICKS // 10, LAMBDA_MIN))


def test_tick_with_a_controller_that_needs_nothing(calls):
    found = _of_more_ticks(calls, "youbot", Torque(lambda t: np.zeros(5)))
    assert found == _total((TICKS, PLANT), (TICKS // 10, LAMBDA_MIN))


@pytest.mark.parametrize(
    "scenario",
    # MuJoCo has its own dynamics, and a tip that is measured is that of two robots
    [name for name in mm.list_scenarios() if name not in ("contact", "uncertain-kinematics")],
)
def test_disturbances_and_measurements_cost_no_dynamics(calls, scenario):
    found = _of_more_ticks(calls, "youbot", _controller("tsm"), scenario=scenario)
    assert found == _total((TICKS, PLANT), (TICKS, TRANSPOSES), (TICKS // 10, LAMBDA_MIN))


def test_longer_ticks_are_integrated_in_steps_of_a_millisecond(calls):
    found = _of_more_ticks(calls, "youbot", _controller("pseudo-inverse"), dt=5e-3)
    assert found == _total((5 * TICKS, PLANT), (TICKS, FULL_MODEL), (TICKS // 2, LAMBDA_MIN))


@pytest.mark.parametrize("robot", ["youbot", "tiago_no_hand"])
@pytest.mark.parametrize("law", LAWS)
def test_step_of_a_controller(calls, robot, law):
    robot, controller = mm.load_robot(robot), _controller(law)
    controller.reset(robot, mm.make_task("circle", robot), 1e-3)
    calls.clear()
    for tick in range(TICKS):
        controller.step(tick * 1e-3, robot.q_rest, np.zeros(robot.nz), np.zeros(robot.nz))
    assert dict(calls) == _total(*_of_law(law))


def test_matrices_at_a_state(calls):
    robot = mm.load_robot("youbot")
    q, z = robot.q_rest, np.ones(robot.nz)
    for function, expected in (
        (robot.velocity, {}),
        (robot.dynamics, {"crba": 1, "nonLinearEffects": 1}),
        (robot.tip_kinematics, {"crba": 1}),
    ):
        calls.clear()
        function(q, z)
        assert dict(calls) == expected
