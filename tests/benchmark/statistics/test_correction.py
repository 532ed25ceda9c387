"""Corrections for many comparisons, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.benchmark.statistics import adjust
from mobman.errors import UsageError

P = [0.01, 0.04, 0.03, 0.005]


def test_holm_by_hand():
    # in order 0.005 x 4, 0.01 x 3, 0.03 x 2, 0.04 x 1 -> not below the one before
    np.testing.assert_allclose(adjust(P), [0.03, 0.06, 0.06, 0.02])


def test_benjamini_hochberg_by_hand():
    # from the largest: 0.04 x 4/4, 0.03 x 4/3 -> not above the one after, 0.01 x 4/2, 0.005 x 4/1
    np.testing.assert_allclose(adjust(P, "benjamini-hochberg"), [0.02, 0.04, 0.04, 0.02])


@pytest.mark.parametrize("method", ["holm", "benjamini-hochberg"])
def test_adjusted_values_keep_their_places_and_limits(method):
    p = np.random.default_rng(0).random(20)
    p[3] = p[7]
    found = adjust(p, method)
    assert (found >= p).all()
    assert (found <= 1).all()
    assert found[3] == found[7]
    order = np.argsort(p)
    assert (np.diff(found[order]) >= 0).all()
    shuffled = np.random.default_rng(1).permutation(20)
    np.testing.assert_allclose(adjust(p[shuffled], method), found[shuffled], rtol=1e-14)
    assert adjust([], method).shape == (0,)
    np.testing.assert_array_equal(adjust([0.2], method), [0.2])


@pytest.mark.parametrize("p", [[1.5], [-0.1], [np.nan], [[0.1]], ["x"]])
def test_what_is_no_p_value_is_refused(p):
    with pytest.raises(UsageError, match="p_values"):
        adjust(p)


def test_an_unknown_method_is_refused():
    with pytest.raises(UsageError, match="'holm' and 'benjamini-hochberg'"):
        adjust([0.1], "bonferroni")
