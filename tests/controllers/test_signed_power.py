"""Signed powers: what the paper's odd roots mean."""

from __future__ import annotations

import numpy as np

from mobman.controllers.sliding.signed_power import signed_power


def test_sign_is_kept_component_by_component():
    assert np.allclose(signed_power(np.array([-8.0, 0.0, 27.0]), 1 / 3), [-2.0, 0.0, 3.0])


def test_signed_power_is_odd_and_increasing():
    x = np.linspace(-2.0, 2.0, 101)
    for exponent in (1 / 3, 3 / 5, 3 / 4, 9 / 7):
        y = signed_power(x, exponent)
        assert np.allclose(y, -y[::-1])
        assert np.all(np.diff(y) > 0.0)


def test_odd_ratios_agree_with_real_roots():
    """x^(3/5) of the paper is the fifth root of x^3, which is real for negative x."""
    for x in (-1.7, -0.3, 0.9):
        assert np.isclose(signed_power(np.array([x]), 3 / 5)[0] ** 5, x**3)
