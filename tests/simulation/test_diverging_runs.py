"""A run that cannot go on is a result: with its time, its reason, its samples and its metrics."""

from __future__ import annotations

import math
import re

import numpy as np
import pinocchio as pin
import pytest
from support.runs import Still, Torque

import mobman as mm
from mobman.errors import MobmanError, SingularityError, UsageError

ARRAYS = ("t", "q", "z", "torque", "tip_position", "task_error", "auxiliary_error", "compute_time")


def _run(youbot, function, duration=1.0, **options):
    return mm.simulate(youbot, Torque(function), "paper", duration=duration, **options)


def _from(time, torque):
    """No torque until then."""
    return lambda t: np.full(5, torque if t >= time - 1e-9 else 0.0)


def _is_a_result(record, status):
    assert record.status == status
    assert not record.ok
    for name in ARRAYS:
        assert np.all(np.isfinite(getattr(record, name))), name
        assert len(getattr(record, name)) == len(record.t)
    assert record.metrics["success"] == 0.0
    assert math.isinf(record.metrics["task_error_max"])
    assert math.isinf(record.metrics["settling_time_1e-2"])
    assert math.isnan(record.metrics["energy_residual"])


@pytest.mark.parametrize(
    ("torque", "reason"), [(1e6, r"\|z\| is .*, above 10000"), (1e300, "the state is not finite")]
)
def test_huge_torque(youbot, torque, reason):
    record = _run(youbot, _from(0.1, torque))
    _is_a_result(record, "diverged")
    assert 0.1 <= record.t[-1] < 0.2
    assert re.fullmatch(rf"at t = 0\.1\d* s: {reason}", record.message)


@pytest.mark.parametrize("torque", [1e6, 1e8, 1e12, 1e300])
@pytest.mark.parametrize("dt", [2e-3, 0.01])
def test_state_that_runs_away_within_a_tick(youbot, torque, dt):
    """Far and fast enough, rounding makes the inertia indefinite: that is no singularity."""
    record = _run(youbot, _from(0.1, torque), dt=dt)
    _is_a_result(record, "diverged")
    assert re.fullmatch(
        r"at t = 0\.1\d* s: (the state is not finite|\|z\| is .*, above 10000)", record.message
    )


def test_plant_whose_inertia_is_not_positive_definite(youbot):
    massless = youbot.model.copy()
    for i in range(1, massless.njoints):
        massless.inertias[i] = pin.Inertia.Zero()
    record = _run(youbot, _from(0.1, 1.0), plant=youbot.with_model(massless))
    _is_a_result(record, "singular")
    assert record.message.startswith("at t = 0 s: the plant's inertia M is not positive definite; ")
    assert record.singularity["matrix"] == "M"
    assert record.singularity["sigma_min"] == 0.0


def test_tip_that_is_left_behind(youbot):
    """A run is over when the tip is a kilometre from where it should be."""

    class Runaway(Still):
        def desired(self, t):
            return np.array([0.0, 1e5 * t, 0.0]), *np.zeros((3, 3))

    record = mm.simulate(youbot, Torque(lambda t: np.zeros(5)), Runaway(np.zeros(3)), duration=1.0)
    _is_a_result(record, "diverged")
    assert record.message == "at t = 0.011 s: |e^e| is 1.1e+03 m, above 1000 m"


def test_tip_that_starts_too_far_away(youbot):
    record = mm.simulate(
        youbot, Torque(lambda t: np.zeros(5)), Still([2000.0, 0.0, 0.0]), duration=1.0
    )
    _is_a_result(record, "diverged")
    assert record.message == "at t = 0 s: |e^e| is 2e+03 m, above 1000 m"
    assert np.array_equal(record.q, [youbot.q_rest])


@pytest.mark.parametrize("torque", [math.nan, math.inf])
def test_torque_that_is_no_number(youbot, torque):
    record = _run(youbot, _from(0.1, torque))
    _is_a_result(record, "diverged")
    assert record.message == "at t = 0.1 s: the controller's torque is not finite"
    assert np.isclose(record.t[-1], 0.099)


def test_torque_that_is_no_number_from_the_start(youbot):
    """Nothing was done, and yet it is a run that failed."""
    record = _run(youbot, _from(0.0, math.nan))
    _is_a_result(record, "diverged")
    assert record.message == "at t = 0 s: the controller's torque is not finite"
    assert np.array_equal(record.q, [youbot.q_rest])


def test_singularity_that_a_law_cannot_pass(youbot):
    def fail(t):
        if t > 0.0495:
            raise SingularityError("J has lost its rank")
        return np.zeros(5)

    record = _run(youbot, fail)
    _is_a_result(record, "singular")
    assert record.message.startswith("at t = 0.05 s: J has lost its rank; y_")


def test_numpys_own_complaint_about_a_singular_matrix(youbot):
    def fail(t):
        np.linalg.solve(np.zeros((2, 2)), np.ones(2))

    record = _run(youbot, fail)
    assert record.status == "singular"
    assert "Singular matrix" in record.message


def test_start_in_a_kinematic_singularity(youbot):
    """The arm straight up: tsm needs a full-rank j, and says so."""
    q0 = youbot.q_rest.copy()
    q0[6:] = (-np.pi / 2, 0.0)
    record = mm.simulate(
        youbot, mm.make_controller("tsm", a=0.2, A=0.2), "paper", duration=1.0, q0=q0
    )
    assert record.status == "singular"
    assert "kinematic singularity" in record.message


@pytest.mark.parametrize("torque", [np.zeros(4), np.zeros((5, 1)), 0.0])
def test_torque_of_a_wrong_shape_is_a_mistake_not_a_result(youbot, torque):
    with pytest.raises(UsageError, match=r"torque has shape .*; the robot has 5 motors"):
        _run(youbot, lambda t: torque)


def test_other_errors_of_a_controller_are_not_hidden(youbot):
    def fail(t):
        raise RuntimeError("a bug of the user's")

    with pytest.raises(RuntimeError, match="a bug of the user's"):
        _run(youbot, fail)


@pytest.mark.parametrize("time", [0.0, 0.005])
def test_controller_that_ends_the_process_is_reported(youbot, time):
    def leave(t):
        if t >= time - 1e-9:
            raise SystemExit("bye")
        return np.zeros(5)

    with pytest.raises(MobmanError, match=rf"at t = {time:g} s: .* called sys.exit .*: bye\)"):
        _run(youbot, leave)


def test_controller_that_ends_the_process_at_reset_is_reported(youbot):
    class Leaves(Torque):
        def reset(self, robot, task, dt):
            raise SystemExit(3)

    with pytest.raises(MobmanError, match=r"called sys.exit \(SystemExit: 3\)"):
        mm.simulate(youbot, Leaves(lambda t: np.zeros(5)), "paper", duration=0.01)


def test_interruption_goes_through(youbot):
    def interrupt(t):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _run(youbot, interrupt)


def test_record_of_a_diverged_run_is_kept(youbot, tmp_path):
    record = _run(youbot, _from(0.05, 1e6))
    back = mm.load_record(record.save(tmp_path / "run.h5"))
    assert (back.status, back.message) == (record.status, record.message)
    assert back.metrics["success"] == 0.0
    assert np.array_equal(back.q, record.q)


def test_record_of_a_run_that_did_nothing_is_kept(youbot, tmp_path):
    record = _run(youbot, _from(0.0, math.nan))
    back = mm.load_record(record.save(tmp_path / "run.h5"))
    assert back.status == "diverged"
    assert np.array_equal(back.q, [youbot.q_rest])
