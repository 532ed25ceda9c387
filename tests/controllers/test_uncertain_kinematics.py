"""Conditions of docs/uncertain.md under which the sliding motion of (31) converges with a wrong J."""

from __future__ import annotations

import math

import numpy as np
import pytest


def _power(x, exponent):
    return math.copysign(abs(x) ** exponent, x)


def _sliding(lambda_1, lambda_2, *, turn=0.0, factor=1.0, delta=0.0, duration=12.0, dt=5e-4):
    """e, shape (ticks, 2), of e'' = factor R(turn) n + delta, with n by (31) on s = 0."""
    c, s = factor * math.cos(turn), factor * math.sin(turn)
    e, rate, n, found = [1.0, 0.3], [0.0, 0.0], [0.0, 0.0], []
    for _ in range(round(duration / dt)):
        for i in (0, 1):
            bracket = _power(_power(rate[i], 9 / 7) + e[i], 1 / 3)
            n[i] -= dt * lambda_2 * (_power(n[i], 3 / 5) + lambda_1**0.6 * bracket)
        moved = (c * n[0] - s * n[1] + delta, s * n[0] + c * n[1])
        for i in (0, 1):
            rate[i] += dt * moved[i]
            e[i] += dt * rate[i]
        found.append(list(e))
        if max(map(abs, e)) > 1e3:
            break
    return np.array(found)


@pytest.mark.parametrize(
    ("lambda_2", "degrees", "holds"), [(6.0, 10, True), (6.0, 25, False), (24.0, 35, True)]
)
def test_margin_of_the_sliding_motion_is_an_angle(lambda_2, degrees, holds):
    e = _sliding(11.0, lambda_2, turn=math.radians(degrees))
    assert (np.abs(e[-1000:]).max() < 1e-3) == holds


def test_a_factor_is_a_change_of_gains():
    mu = 0.3
    one, other = (
        _sliding(11.0, 6.0, factor=mu, duration=8.0),
        _sliding(mu * 11.0, mu**0.4 * 6.0, duration=8.0),
    )
    assert np.allclose(one, other, atol=1e-9)


def test_a_steady_disturbance_leaves_its_power():
    delta = 0.0125
    e = _sliding(11.0, 6.0, delta=delta)
    assert e[-1, 0] == pytest.approx((delta / 11.0) ** 1.8, rel=0.15)  # about which it swings
