"""Success rates: Wilson's interval, and pairs of labels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from mobman.benchmark.statistics import compare_successes, proportion
from mobman.errors import UsageError


def test_wilson_by_hand():
    found = proportion(8, 10)
    z = 1.959963984540054
    centre, half = 0.8 + z**2 / 20, z * np.sqrt(0.8 * 0.2 / 10 + z**2 / 400)
    assert found.estimate == 0.8
    expected = np.array([centre - half, centre + half]) / (1 + z**2 / 10)
    np.testing.assert_allclose([found.low, found.high], expected, rtol=1e-12)


def test_certainty_is_not_for_sale():
    assert proportion(10, 10).low == pytest.approx(0.7225, abs=1e-4)
    assert proportion(10, 10).high == 1.0
    assert proportion(0, 10).low == 0.0
    assert proportion(0, 1).high > 0.7


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_wilson_covers_the_truth_as_often_as_it_says(share):
    n = 40
    covered = 0.0
    for k in range(n + 1):
        interval = proportion(k, n)
        covered += binom.pmf(k, n, share) * (interval.low <= share <= interval.high)
    assert 0.91 <= covered <= 0.99


@pytest.mark.parametrize("numbers", [(3, 2), (-1, 5), (0, 0), (1.5, 3)])
def test_proportions_that_cannot_be_are_refused(numbers):
    with pytest.raises(UsageError, match="whole numbers"):
        proportion(*numbers)


def _cells(both, only_a, only_b, neither):
    a = [True] * (both + only_a) + [False] * (only_b + neither)
    b = [True] * both + [False] * only_a + [True] * only_b + [False] * neither
    return a, b


def test_pairs_by_hand():
    found = compare_successes(*_cells(36, 12, 2, 0))
    assert (found.n, found.both, found.only_a, found.only_b, found.neither) == (50, 36, 12, 2, 0)
    assert found.difference.estimate == pytest.approx(0.2)
    a, b = proportion(48, 50), proportion(38, 50)
    phi = (36 * 0 - 12 * 2) / np.sqrt(48 * 2 * 38 * 12)
    down, up = (a.estimate - a.low, b.high - b.estimate), (a.high - a.estimate, b.estimate - b.low)
    low = 0.2 - np.sqrt(down[0] ** 2 - 2 * phi * down[0] * down[1] + down[1] ** 2)
    high = 0.2 + np.sqrt(up[0] ** 2 - 2 * phi * up[0] * up[1] + up[1] ** 2)
    assert (found.difference.low, found.difference.high) == pytest.approx((low, high), rel=1e-12)
    assert found.p_value == pytest.approx(2 * binom.cdf(2, 14, 0.5))
    assert found.smallest_p == 2.0**-13


def test_swapping_the_sides_swaps_the_signs():
    a, b = _cells(5, 4, 1, 3)
    one, other = compare_successes(a, b), compare_successes(b, a)
    assert one.difference.estimate == -other.difference.estimate
    assert one.difference.low == pytest.approx(-other.difference.high)
    assert one.p_value == other.p_value


@pytest.mark.parametrize("success", [True, False])
def test_equal_successes_have_p_1_and_an_interval_with_a_width(success):
    found = compare_successes([success] * 10, [success] * 10)
    assert (found.p_value, found.smallest_p, found.difference.estimate) == (1.0, 1.0, 0.0)
    assert found.difference.low < 0.0 < found.difference.high


def test_intervals_of_differences_cover_the_truth_as_often_as_they_say():
    generator = np.random.default_rng(0)
    covered = 0
    for _ in range(200):
        cell = generator.random(25)  # how hard it is, for both
        a, b = cell < 0.4 + 0.4 * generator.random(25), cell < 0.2 + 0.4 * generator.random(25)
        difference = compare_successes(a, b).difference
        covered += difference.low <= 0.2 <= difference.high
    assert covered / 200 >= 0.92


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ([1, 0], [1], "2 and 1"),
        ([], [], "a: allowed"),
        ([0.5], [1], "a: allowed"),
        ([1], [2], "b: "),
    ],
)
def test_successes_that_cannot_be_are_refused(a, b, message):
    with pytest.raises(UsageError, match=message):
        compare_successes(a, b)
