"""``saturation = "hedge"`` and the caps of the sliding laws."""

from __future__ import annotations

import numpy as np
import pytest
from support.states import random_states

import mobman as mm
from mobman.controllers.motors import cap, hedge
from mobman.controllers.tsm import Held, SlidingGains, SlidingStage
from mobman.errors import GainError
from mobman.simulation.scenario import Scenario

URDF = {"type": "saturation", "factor": 1.0}


@pytest.fixture(autouse=True)
def _kernels_are_not_joined(monkeypatch):
    """Each law with a hedge would be compiled once more, for these runs alone."""
    monkeypatch.setattr("mobman.simulation.simulate._MANY_TICKS", 10**9)


def _work(nz):
    return *np.zeros((3, nz)), np.zeros((nz, nz))


def _far(robot, duration, *, factor=1.0, away=1.5, scenario=None, **gains):
    """A run that starts far behind its circle, at a share of the URDF's limits."""
    cut = Scenario(
        name="far", start_offset=away, actuation=[{"type": "saturation", "factor": factor}]
    )
    law = mm.make_controller("tsm", **gains)
    return mm.simulate(robot, law, "circle", duration=duration, scenario=scenario or cut)


def test_hedge_leaves_both_sliding_variables_where_they_were(robot):
    """The torque fits, and s and S of the tick's end are those that the wanted torque would have."""
    random, nz, dt = np.random.default_rng(4), robot.nz, 1e-3
    for q, z in random_states(robot, 5):
        M, _, B = robot.dynamics(q, z)
        p = nz
        J, z_dot = random.standard_normal((p, nz)), random.standard_normal(nz)
        stage, held = SlidingStage.of(SlidingGains(), p), Held(*random.standard_normal((5, nz)))
        stage.integral[:] = random.standard_normal(p)
        limit = 0.7 * np.abs(held.v) + 0.1
        before = Held(*(part.copy() for part in held))
        integral = stage.integral.copy()
        assert hedge(dt, limit, stage, held, J, z, z_dot, M, B, *_work(nz)) == 0
        assert (np.abs(held.v) <= limit).all()
        lost = np.linalg.solve(M, B @ (held.v - before.v))  # of z', over the next tick
        assert np.allclose(held.v_ref, before.v_ref + lost)
        assert np.allclose(held.integral_v_ref, before.integral_v_ref + dt * lost)
        # s = J v_ref + ... + its integral, S = (z' - v_ref) + ..., E = z - integral of v_ref
        assert np.allclose(J @ held.v_ref + stage.integral, J @ before.v_ref + integral)
        assert np.abs(lost).max() > 1e-3


def test_torque_within_the_limits_is_left_alone():
    held, stage = Held(*np.ones((5, 3))), SlidingStage.of(SlidingGains(), 3)
    eye, zero = np.eye(3), np.zeros(3)
    limit = np.array([1.0, 2.0, np.inf])
    assert hedge(1e-3, limit, stage, held, eye, zero, zero, eye, eye, *_work(3)) == 0
    assert all(np.array_equal(part, np.ones(3)) for part in held)


@pytest.mark.parametrize("name", ["tiago_no_hand", "jackal_z1"])
def test_far_away_at_the_urdfs_limits_the_hedge_arrives_and_a_clip_alone_does_not(name):
    record, cut = (_far(name, 10.0, saturation=some) for some in ("hedge", "none"))
    robot = mm.load_robot(name)
    assert record.ok
    assert record.metrics["task_error_final"] < 1e-6
    assert record.metrics["torque_limit_ratio"] <= 1.0
    assert (
        np.abs(record.torque) <= robot.limits.torque
    ).all()  # the law's own, not the motors' doing
    assert record.metrics["saturation_share"] > 0.01
    assert not cut.ok or cut.metrics["task_error_final"] > 1e-3


def test_hedge_knows_the_limits_that_act_and_records_them(youbot):
    limits = youbot.limits.torque
    record = _far(youbot, 2e-3, factor=0.5, saturation="hedge")
    assert record.settings["torque_limits"] == [
        0.5 * limit if np.isfinite(limit) else None for limit in limits
    ]
    alone = mm.simulate(
        youbot, mm.make_controller("tsm", saturation="hedge"), "circle", duration=2e-3
    )
    assert alone.settings["torque_limits"][2:] == limits[2:].tolist()
    given = _far(youbot, 2e-3, saturation="hedge", torque_limits=7.0)
    assert given.settings["torque_limits"] == [7.0] * 5
    assert _far(youbot, 2e-3).settings["torque_limits"] is None


def test_run_with_the_hedge_is_repeated_from_its_file(youbot, tmp_path):
    from mobman.simulation.rerun import verify

    record = _far(youbot, 0.05, saturation="hedge", v_max=0.5, a_max=[2.0, 3.0])
    found = verify(record.save(tmp_path / "run.h5"))
    assert found.identical, found.differences


@pytest.mark.parametrize("law", ["tsm-simplified", "tsm-inverse-actuation", "tsm-null-space"])
def test_other_sliding_laws_keep_to_the_limits_too(law):
    robot = mm.load_robot("tiago_no_hand")
    far = Scenario(name="far", start_offset=1.5, actuation=[URDF])
    record, cut = (
        mm.simulate(
            robot, mm.make_controller(law, saturation=some), "circle", duration=0.6, scenario=far
        )
        for some in ("hedge", "none")
    )
    assert (np.abs(record.torque) <= robot.limits.torque).all()
    assert (np.abs(cut.torque) > robot.limits.torque).any()


# Caps --------------------------------------------------------------------------------------------


def test_cap_scales_positions_and_orientations_each_by_itself():
    x = np.array([3.0, 0.0, 4.0, 0.1, 0.0, 0.2, 7.0])
    weights = np.full(7, 2.0)
    capped = x.copy()
    cap(capped, 6, np.array([4.0, 1.0]), 0.5, weights, 1.0)
    assert np.allclose(
        capped, [0.6, 0.0, 0.8, 0.1, 0.0, 0.2, 7.0]
    )  # |2 x| = 4^0.5; the rest is within
    capped = x.copy()
    cap(capped, 6, np.full(2, np.inf), 0.5, weights, 1.0)
    assert np.array_equal(capped, x)
    capped = x.copy()
    cap(capped, 2, np.array([1.0, 1e-9]), 1.0, weights, 0.0)  # a planar task
    assert np.allclose(capped, [1.0, 0.0, *x[2:]])


def test_caps_that_nothing_reaches_change_no_bit(youbot):
    runs = [
        mm.simulate(youbot, mm.make_controller("tsm", **caps), "circle", duration=0.05)
        for caps in ({}, {"v_max": 1e6, "a_max": 1e6})
    ]
    assert np.array_equal(runs[0].q, runs[1].q)


def test_capped_law_approaches_no_faster_and_settles_as_the_law_does():
    robot, v_max, a_max = mm.load_robot("tiago_no_hand"), 0.4, 1.5
    record = _far(robot, 8.0, factor=1e3, v_max=v_max, a_max=a_max)
    free = _far(robot, 8.0, factor=1e3)
    e = record.task_error
    speed, acceleration = np.gradient(e, 1e-3, axis=0), np.diff(e, n=2, axis=0) / 1e-6
    # the powers are by component, so that norms may be larger by 3^(1/9), 3^(2/9)
    late = record.t > 0.5
    assert np.linalg.norm(speed[late], axis=1).max() < 1.1 * 3 ** (1 / 9) * v_max
    assert np.linalg.norm(acceleration[late[1:-1]], axis=1).max() < 1.1 * 3 ** (2 / 9) * a_max
    assert np.linalg.norm(np.gradient(free.task_error, 1e-3, axis=0), axis=1).max() > 2.0 * v_max
    assert record.metrics["task_error_final"] < 1e-8


@pytest.mark.parametrize(
    "wrong",
    [{"v_max": 0.0}, {"a_max": [1.0, 2.0, 3.0]}, {"v_max": "fast"}, {"saturation": "clip"},
     {"torque_limits": [1.0, 0.0]}],
)  # fmt: skip
def test_wrong_options_are_refused(wrong):
    (name,) = wrong
    with pytest.raises(GainError, match=f"^{name} = "):
        mm.make_controller("tsm", **wrong)
