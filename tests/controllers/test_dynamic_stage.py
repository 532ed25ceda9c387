"""The dynamic stage alone, on z' = M^-1 (B v + disturbance)."""

from __future__ import annotations

import numpy as np
import pytest
from support.stages import DynamicStageAlone

DT = 1e-3
INERTIA = np.array([[3.0, 0.4], [0.4, 1.0]])
ACTUATION = np.diag([2.0, 1.0])
START = np.array([0.5, -1.0])


def _reference(t):
    """v_ref, its integral and its rate: something that never rests."""
    w = np.array([1.0, 1.7])
    return np.sin(w * t), (1.0 - np.cos(w * t)) / w, w * np.cos(w * t)


def _stage(dt=DT, inertia=INERTIA, **options):
    return DynamicStageAlone(dt, inertia, ACTUATION, A=0.05, a=1.0, **options)


def _run(inertia=INERTIA, disturbance=0.0, duration=4.0, dt=DT, **options):
    """|E| and |E'| over time; the plant has ``inertia``, the stage supposes INERTIA."""
    alone = _stage(dt, **options)
    held = alone.held
    z, sizes = START.copy(), []
    for tick in range(round(duration / dt)):
        v_ref, integral, rate = _reference(tick * dt)
        push = disturbance * np.sin(3.0 * tick * dt + np.arange(2))
        z_dot = np.linalg.solve(inertia, ACTUATION @ held.v + push)
        sizes.append((np.linalg.norm(z - integral), np.linalg.norm(z_dot - v_ref)))
        torque = alone.step(z, z_dot, v_ref, integral, rate)
        z = z + dt * np.linalg.solve(inertia, ACTUATION @ torque + push)
    return np.array(sizes).T


def _left(sizes, dt=DT):
    """The largest of what is left after 2.5 s."""
    return sizes[round(2.5 / dt) :].max()


@pytest.mark.parametrize("inverse", [False, True], ids=["transpose", "inverse"])
def test_reference_is_caught_in_finite_time(inverse):
    e, e_dot = _run(inverse=inverse)
    assert e[0] > 1.0
    assert _left(e) < 1e-4
    # the held torque lags the reference by a tick
    assert _left(e_dot) < 5e-3


def test_what_is_left_falls_with_the_sampling_period():
    coarse, fine = (_left(_run(dt=dt)[0], dt) for dt in (4e-3, 1e-3))
    assert fine < 0.3 * coarse


@pytest.mark.parametrize("factor", [0.7, 1.3, 3.0])
def test_other_inertia_than_supposed_is_borne(factor):
    assert _left(_run(inertia=factor * INERTIA)[0]) < 1e-3


def test_disturbance_is_rejected_without_being_known():
    """What a proportional law of the same stiffness, D / Lambda_0, would leave is 0.1."""
    assert _left(_run(disturbance=1.0)[0]) < 1e-3


@pytest.mark.parametrize("scale", [0.1, 0.5])
def test_smaller_metric_is_slower_but_arrives(scale):
    assert _left(_run(metric_scale=scale)[0]) < 1e-3


def test_metric_scale_is_a_factor_of_the_inertia():
    one = _stage(metric_scale=0.5)
    other = _stage(inertia=0.5 * INERTIA, metric_scale=1.0)
    arguments = (START, -START, *np.ones((3, 2)))
    scaled, plain = one.step(*arguments), other.step(*arguments)
    assert np.array_equal(scaled, plain)


def test_explicit_form_chatters_where_the_implicit_one_does_not():
    implicit, explicit = (_left(_run(discretization=d)[1]) for d in ("implicit", "explicit"))
    assert explicit > 10.0 * implicit


def test_boundary_layer_calms_the_explicit_form():
    """In a layer as wide as what one tick can do, the unit vector no longer overshoots."""
    bare, calmed = (
        _left(_run(discretization="explicit", boundary_layer=width)[1]) for width in (0.0, 5.0)
    )
    assert calmed < 0.5 * bare


def test_torque_is_integrated_from_zero():
    """v = 0 at the start, and only v' is chosen: one tick moves v by dt v'."""
    steps = []
    none = np.zeros(2)
    for dt in (1e-3, 1e-4):
        alone = _stage(dt, discretization="explicit")
        assert not alone.held.v.any()
        # at rest, with v_ref = (1, 1): E' = -v_ref is all that chi and S see
        steps.append(alone.step(none, none, np.ones(2), none, none))
    assert np.allclose(steps[0], 10.0 * steps[1])
    assert steps[0].any()
