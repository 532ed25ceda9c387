"""The kinematic stage alone: with J = I the errors are triple integrators of v_ref'."""

from __future__ import annotations

import numpy as np
import pytest
from support.stages import KinematicStageAlone

DT = 1e-3


def _run(start, duration, *, discretization="implicit", a=1.0, desired=None, lambda_1=11.0):
    """|e| of f''' = v_ref', f' = z, f(0) = start, z' = v_ref exactly."""
    p = len(start)
    alone = KinematicStageAlone(p, DT, a=a, A=1.0, lambda_1=lambda_1, discretization=discretization)
    f, f_dot = start.copy(), np.zeros(p)
    sizes = []
    for tick in range(round(duration / DT)):
        t = tick * DT
        r, r_dot, r_ddot, r_dddot = np.zeros((4, p)) if desired is None else desired(t)
        f_ddot = alone.held.v_ref.copy()
        v_ref_dot = alone.step(f - r, f_dot - r_dot, r_ddot, r_dddot, f_dot)
        sizes.append(np.linalg.norm(f - r))
        f = f + DT * f_dot + DT**2 / 2 * f_ddot + DT**3 / 6 * v_ref_dot
        f_dot = f_dot + DT * f_ddot + DT**2 / 2 * v_ref_dot
        alone.advance()
    return np.array(sizes)


def _sine(t):
    w = np.array([1.0, 1.3])
    return (
        np.sin(w * t),
        w * np.cos(w * t),
        -(w**2) * np.sin(w * t),
        -(w**3) * np.cos(w * t),
    )


@pytest.mark.parametrize("start", [[1.0], [0.5, -2.0], [4.0, -0.1, 0.02]])
def test_errors_vanish_in_finite_time(start):
    """Below any power of what an exponential of the same speed would leave, and they stay there."""
    sizes = _run(np.array(start), 8.0)
    assert sizes[round(6.5 / DT) :].max() < 1e-10
    # what is left falls faster and faster: the decades per second grow
    at = [sizes[round(t / DT)] for t in (1.0, 2.0, 3.0, 4.0)]
    decades = -np.diff(np.log10(at))
    assert np.all(np.diff(decades) > 0.0)


def test_moving_target_is_reached_too():
    assert _run(np.array([1.0, -1.0]), 8.0, desired=_sine)[round(7.0 / DT) :].max() < 1e-7


def test_gain_that_is_larger_than_need_be_changes_nothing():
    """Inside the unit ball n is the equivalent control, whatever a is."""
    start = np.array([0.5, -2.0])
    usual, larger = _run(start, 3.0), _run(start, 3.0, a=1e-3)
    assert np.allclose(usual, larger, rtol=1e-6, atol=1e-9)


def test_explicit_form_chatters_where_the_implicit_one_does_not():
    start = np.array([0.5, -2.0])
    implicit = _run(start, 8.0)[round(7.0 / DT) :].max()
    explicit = _run(start, 8.0, discretization="explicit")[round(7.0 / DT) :].max()
    assert explicit > 1e2 * implicit


def test_sliding_variable_starts_as_the_acceleration_error():
    alone = KinematicStageAlone(2, DT, a=1.0, A=1.0)
    p_ddot = np.array([3.0, -1.0])
    alone.step(np.ones(2), np.ones(2), p_ddot, np.zeros(2), np.zeros(2))
    assert np.allclose(alone.kinematic.s, -p_ddot)


def test_reference_is_integrated_exactly():
    """v_ref' is constant over a tick, so v_ref and its integral are polynomials."""
    alone = KinematicStageAlone(1, 0.1, a=1.0, A=1.0)
    rate = alone.step(np.ones(1), np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1))
    alone.advance()
    assert np.allclose(alone.held.v_ref, 0.1 * rate)
    assert np.allclose(alone.held.integral_v_ref, 0.1**2 / 2 * rate)
