"""Signed powers: what the paper's odd roots mean."""

from __future__ import annotations

import numpy as np

from mobman.controllers.tsm import power


def test_sign_is_kept():
    assert np.allclose([power(x, 1 / 3) for x in (-8.0, 0.0, 27.0)], [-2.0, 0.0, 3.0])


def test_signed_power_is_odd_and_increasing():
    x = np.linspace(-2.0, 2.0, 101)
    for exponent in (1 / 3, 3 / 5, 3 / 4, 9 / 7):
        y = np.array([power(value, exponent) for value in x])
        assert np.allclose(y, -y[::-1])
        assert np.all(np.diff(y) > 0.0)


def test_odd_ratios_agree_with_real_roots():
    """x^(3/5) of the paper is the fifth root of x^3, which is real for negative x."""
    for x in (-1.7, -0.3, 0.9):
        assert np.isclose(power(x, 3 / 5) ** 5, x**3)
