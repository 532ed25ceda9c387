"""The criterion that keeps joints away from their limits: its derivatives, and what it does to runs."""

from __future__ import annotations

import numpy as np
import pytest
from support.differences import derivative, jacobian, relative

import mobman as mm
from mobman.errors import GainError
from mobman.model.criterion import Posture, Sum, criteria
from mobman.model.joint_limits import LimitZones
from mobman.simulation.rerun import repeat

TERM = {"type": "joint-limits", "weight": 0.5, "zone": 0.3}


def deep_states(robot, middle=False):
    """States with the joints from a tenth beyond their limits on, none at the edge of a zone, where F
    is of class C^3 and no more."""
    random = np.random.default_rng(7)
    lower, upper = robot.limits.lower, robot.limits.upper
    for _ in range(4):
        share = (
            0.5
            if middle
            else random.choice([-0.1, 0.02, 0.1, 0.2, 0.5, 0.8, 0.9, 0.98, 1.1], robot.nq)
        )
        q = robot.q_rest.copy()
        limited = np.isfinite(upper) & np.isfinite(lower)  # those with one end are tried below
        q[limited] = (lower + share * np.where(limited, upper - lower, 0.0))[limited]
        yield q, random.standard_normal(robot.nq)


def test_its_derivatives(robot):
    term = criteria.get("joint-limits")(weight=0.5, zone=0.3).on(robot)
    largest = 0.0
    for q, q_dot in deep_states(robot):
        h = 1e-3
        gradient = jacobian(lambda x: np.array([term.value(x)]), q, h)[0]
        assert relative(term.gradient(q), gradient) < 1e-8
        assert relative(term.hessian(q), jacobian(term.gradient, q, h)) < 1e-8
        rate = derivative(lambda s, q=q, d=q_dot: term.hessian(q + s * d), h)
        assert relative(term.hessian_rate(q, q_dot), rate) < 1e-8
        largest = max(largest, np.abs(term.gradient(q)).max())
    assert largest > 0.1
    assert not np.any(term.gradient(next(deep_states(robot, middle=True))[0]))


def test_a_sum_is_that_of_its_parts_however_it_is_asked_for(robot):
    """Laws ask for single derivatives, the extended Jacobian for all at once."""
    posture = Posture.of(robot)
    terms = [criteria.get("joint-limits")(weight=w, zone=0.3).on(robot) for w in (0.5, 2.0)]
    whole, (q, q_dot) = Sum(posture, terms), next(deep_states(robot))
    found = np.zeros(robot.nq), *np.zeros((2, robot.nq, robot.nq))
    whole.entry(q, q_dot, *found)()
    for name, given, together in (
        ("gradient", (q,), found[0]),
        ("hessian", (q,), found[1]),
        ("hessian_rate", (q, q_dot), found[2]),
    ):
        parts = [getattr(part, name)(*given) for part in (posture, *terms)]
        assert np.allclose(getattr(whole, name)(*given), np.sum(parts, axis=0), rtol=1e-15)
        assert np.allclose(together, np.sum(parts, axis=0), rtol=1e-15)


def test_at_a_limit_it_is_as_stiff_as_a_weight(tiago):
    term = criteria.get("joint-limits")(weight=0.5).on(tiago)
    i = int(tiago.arm_index[1])
    q = tiago.q_rest.copy()
    q[i] = tiago.limits.upper[i]
    assert term.hessian(q)[i, i] == pytest.approx(0.5)


@pytest.mark.parametrize("law", ["pseudo-inverse", pytest.param("tsm", marks=pytest.mark.slow)])
def test_joints_stay_nearer_to_their_range(law):
    robot = "locobot" if law == "pseudo-inverse" else "stretch"
    excess = []
    for added in ((), [TERM]):
        record = mm.simulate(
            robot, mm.make_controller(law, criteria=added), "circle", duration=15.0, dt=4e-3
        )
        assert record.ok
        assert record.metrics["task_error_final"] < 1e-3
        excess.append(record.metrics["position_limit_excess"])
    assert 0.0 < excess[1] < 0.9 * excess[0]


def test_a_record_says_it_and_is_repeated(tmp_path):
    law = mm.make_controller("tsm", criteria=[TERM])
    path = mm.simulate("tiago", law, "circle", duration=0.05).save(tmp_path / "run.h5")
    assert mm.load_record(path).settings["criteria"] == [TERM]
    again = repeat(path)
    assert np.array_equal(again.q, mm.load_record(path).q)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([{"type": "joint-limit", "weight": 1.0}], r"^criteria\[0\]: .*joint-limits"),
        ([{"weight": 1.0}], "must be a table with a type"),
        ([{"type": "joint-limits"}], "weight"),
        ([{"type": "joint-limits", "weight": -1.0}], "weight"),
        ([{"type": "joint-limits", "weight": 1.0, "zone": 0.7}], "zone"),
        ([{"type": "joint-limits", "weight": 1.0, "width": 0.7}], "width"),
        ("joint-limits", "must be a list of tables"),
    ],
)
def test_what_is_wrong_is_told(given, words):
    with pytest.raises(GainError, match=words):
        mm.make_controller("tsm", criteria=given)


def test_depth_of_joints_with_one_bound_and_with_none():
    robot = mm.load_robot("youbot")
    model = robot.model.copy()
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    lower[robot.arm_index], upper[robot.arm_index] = (-1.0, -1e9, -1e9), (3.0, 2.0, 1e9)
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    robot, q = robot.with_model(model), robot.q_rest.copy()
    q[robot.arm_index] = -0.8, 2.1, 50.0
    assert np.allclose(LimitZones(robot, 0.1).depth(q), [-0.2, 0.2, 0.0])
    term = criteria.get("joint-limits")(weight=0.5, zone=0.1).on(robot)
    expected = [-(0.2**3) / 0.4**2, 0.2**3 / 0.1**2, 0.0]
    assert np.allclose(term.gradient(q)[robot.arm_index], 0.5 / 3.0 * np.array(expected))


def test_a_term_that_means_nothing_for_the_robot():
    youbot = mm.load_robot("youbot")
    youbot.model.lowerPositionLimit[youbot.arm_index] = -np.inf
    youbot.model.upperPositionLimit[youbot.arm_index] = np.inf
    with pytest.raises(mm.MobmanError, match="no joint of 'youbot'"):
        mm.simulate(youbot, mm.make_controller("tsm", criteria=[TERM]), "circle", duration=0.01)
