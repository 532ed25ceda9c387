"""Paired comparisons: Wilcoxon's test against scipy and by enumeration, effects by hand."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.stats import rankdata, wilcoxon

from mobman.benchmark.statistics import compare, compare_all
from mobman.benchmark.statistics.comparisons import evidence_below
from mobman.errors import UsageError

INF = np.inf


def _enumerated(differences):
    """Two-sided p over all signs of the ranks that are not zeros'."""
    ranks = rankdata(np.abs(differences))
    signs = np.sign(differences)
    ranks, signs = ranks[signs != 0], signs[signs != 0]
    found = ranks[signs > 0].sum()
    sums = np.array(
        [ranks[np.array(plus)].sum() for plus in product([False, True], repeat=len(ranks))]
    )
    return min(1.0, 2 * min(np.mean(sums <= found), np.mean(sums >= found)))


@pytest.mark.parametrize("n", [3, 8, 30, 60])
def test_p_is_scipys_exact_one_without_ties(n):
    generator = np.random.default_rng(n)
    a, b = generator.normal(0.3, 1, size=n), generator.normal(size=n)
    peer = wilcoxon(a, b, method="exact")
    assert compare(a, b, scale="linear").p_value == pytest.approx(peer.pvalue, rel=1e-10)


@pytest.mark.parametrize("zero_share", [0.0, 0.3])
def test_p_is_scipys_asymptotic_one_for_many(zero_share):
    generator = np.random.default_rng(1)
    b = np.zeros(400)
    a = np.round(generator.normal(0.1, 1, size=400), 1)
    a[generator.random(400) < zero_share] = 0.0
    peer = wilcoxon(a, b, zero_method="pratt", method="asymptotic")
    assert compare(a, b, scale="linear").p_value == pytest.approx(peer.pvalue, rel=1e-10)


def test_exact_and_asymptotic_p_meet():
    generator = np.random.default_rng(2)
    d = generator.normal(0.25, 1, size=100)
    exact = compare(d, np.zeros(100), scale="linear").p_value
    assert exact == pytest.approx(wilcoxon(d, method="asymptotic").pvalue, rel=0.1)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ([1, 1, 2, 3, 5, 8], [2, 2, 2, 4, 4, 4]),
        ([1, 1, INF, 3, INF, 8], [2, 2, INF, INF, 4, 4]),
        ([1, 2, 3, 4, 5, 6, 7, INF], [2, 3, 4, 5, 6, 7, 8, 9]),
        ([INF, INF, INF], [1, 2, INF]),
    ],
)
def test_p_with_ties_zeros_and_failures_is_that_of_all_signs(a, b):
    a, b = np.array(a, float), np.array(b, float)
    both = np.isinf(a) & np.isinf(b)
    differences = np.where(both, 0, a) - np.where(both, 0, b)
    found = compare(a, b, scale="linear")
    assert found.p_value == pytest.approx(_enumerated(differences), rel=1e-12)


def test_effect_size_by_hand():
    # differences -1, -2, 3, 0, -inf: ranks 2, 3, 4, 1, 5
    found = compare([1, 1, 5, 7, 1], [2, 3, 2, 7, INF], scale="linear")
    assert found.effect_size == pytest.approx((4 - 2 - 3 - 5) / 15)
    assert (found.n, found.wins, found.ties, found.losses) == (5, 3, 1, 1)
    assert found.median_difference.estimate == -1.0
    assert found.smallest_p == 2**-3  # four untied cells


def test_a_factor_of_ten_everywhere_is_a_decade():
    b = np.geomspace(1e-9, 1, 12)
    found = compare(0.1 * b, b)
    assert found.median_difference.estimate == pytest.approx(-1.0)
    assert found.median_difference.high == pytest.approx(-1.0)
    assert found.effect_size == -1.0
    assert found.p_value == found.smallest_p == 2.0**-11
    assert found.scale == "log10"


def test_ratios_that_are_equal_but_for_rounding_are_tied():
    b = np.array([0.1, 0.2, 0.3, 0.7, 0.9])
    found = compare(b * [1e-3, 1e-3, 1e3, 1e3, 1e3], b)
    assert found.effect_size == pytest.approx(1 / 5)  # ranks of 3 each


def test_scores_below_the_floor_are_tied():
    found = compare([1e-13, 0.0, 1e-10], [1e-15, 1e-14, 1e-9], floor=1e-9)
    assert (found.ties, found.p_value, found.effect_size) == (3, 1.0, 0.0)


@pytest.mark.parametrize("scores", [[0.1, 0.2, 0.3], [INF, INF], [0.0]])
def test_against_itself_nothing_is_found(scores):
    found = compare(scores, scores)
    assert (found.p_value, found.smallest_p, found.effect_size) == (1.0, 1.0, 0.0)
    assert found.ties == len(scores)
    assert (found.median_difference.low, found.median_difference.high) == (0.0, 0.0)


def test_too_few_cells_show():
    found = compare([1, 2, 3, 4, 5], [2, 4, 6, 8, 10])
    assert found.p_value == found.smallest_p == 0.0625


def test_failures_are_the_largest_differences():
    b = np.arange(1.0, 10.0)
    a = 0.5 * b
    a[0] = INF
    large = 0.5 * b
    large[0] = 1e9
    failed, finite = compare(a, b, scale="linear"), compare(large, b, scale="linear")
    assert failed.p_value == finite.p_value
    assert failed.effect_size == finite.effect_size
    assert compare([INF, 1, INF], [1, 1, 1]).median_difference.estimate == INF
    # as many failures on each side: nobody is ahead
    assert compare([INF, 1], [1, INF]).median_difference.estimate == 0.0


def test_swapping_the_sides_swaps_the_signs():
    generator = np.random.default_rng(3)
    a, b = generator.lognormal(size=(2, 41))
    a[::9], b[::7] = INF, INF
    one, other = compare(a, b), compare(b, a)
    assert one.p_value == pytest.approx(other.p_value, rel=1e-12)
    assert one.effect_size == pytest.approx(-other.effect_size, rel=1e-12)
    assert (one.wins, one.ties, one.losses) == (other.losses, other.ties, other.wins)
    assert one.median_difference.estimate == -other.median_difference.estimate
    # the draws are not mirrored
    assert one.median_difference.low == pytest.approx(-other.median_difference.high, abs=0.2)


def test_order_of_cells_makes_no_difference():
    generator = np.random.default_rng(4)
    a, b = generator.lognormal(size=(2, 20))
    a[:2], b[1:4] = INF, INF
    shuffled = generator.permutation(20)
    assert compare(a, b) == compare(a[shuffled], b[shuffled])


def test_a_worse_run_never_makes_the_comparison_better():
    generator = np.random.default_rng(5)
    a, b = np.round(generator.lognormal(size=(2, 8)), 1) + 0.1
    b[3] = INF
    before = compare(a, b, resamples=200)
    for i in range(8):
        for worse in (a[i] * 1.5, b[i], 100.0, INF):
            if worse >= a[i]:
                changed = a.copy()
                changed[i] = worse
                after = compare(changed, b, resamples=200)
                assert after.effect_size >= before.effect_size
                assert after.wins <= before.wins
                assert after.median_difference.estimate >= before.median_difference.estimate


def test_p_is_as_rarely_small_by_chance_as_it_says():
    generator = np.random.default_rng(6)
    found = []
    for _ in range(400):
        cell = generator.normal(size=15)
        a, b = 10 ** (cell + generator.normal(size=(2, 15)))
        found.append(compare(a, b, resamples=1).p_value)
    assert 0.02 <= np.mean(np.array(found) <= 0.05) <= 0.08


def test_one_sided_evidence_is_exact_without_ties_and_never_falls_as_a_difference_grows():
    generator = np.random.default_rng(7)
    d = generator.normal(-0.5, 1, size=12)
    peer = wilcoxon(d, alternative="less", method="exact").pvalue
    assert evidence_below(d) == pytest.approx(peer, rel=1e-12)
    steps = np.array([-INF, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, INF])
    for _ in range(100):
        d = generator.choice(steps, size=6)
        i = generator.integers(6)
        higher = d.copy()
        higher[i] = generator.choice(steps[steps >= d[i]])
        assert evidence_below(higher) >= evidence_below(d)


def test_all_pairs_are_adjusted_together():
    generator = np.random.default_rng(8)
    scores = 10 ** generator.normal(size=(3, 25))
    scores[0] *= 1e-3
    pairs = compare_all(["x", "y", "z"], scores)
    assert [(pair.a, pair.b) for pair in pairs] == [("x", "y"), ("x", "z"), ("y", "z")]
    assert pairs[1].comparison == compare(scores[0], scores[2])
    p = [pair.comparison.p_value for pair in pairs]
    smallest = int(np.argmin(p))
    assert pairs[smallest].adjusted_p == pytest.approx(3 * p[smallest])
    assert [pair.adjusted_p < 0.05 for pair in pairs] == [True, True, False]
    gentle = compare_all(["x", "y", "z"], scores, method="benjamini-hochberg")
    assert all(g.adjusted_p <= h.adjusted_p for g, h in zip(gentle, pairs, strict=True))
    assert compare_all(["x"], scores[:1]) == []


def test_order_of_labels_makes_no_difference_to_p():
    scores = np.random.default_rng(9).lognormal(size=(4, 12))
    labels = ["a", "b", "c", "d"]

    def found(order):
        pairs = compare_all([labels[i] for i in order], scores[order], resamples=10)
        return {frozenset((pair.a, pair.b)): pair.adjusted_p for pair in pairs}

    assert found([0, 1, 2, 3]) == pytest.approx(found([3, 1, 0, 2]), rel=1e-12)


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ([1, 2], [1], "found 2 and 1 scores"),
        ([], [], "found none"),
        ([1, np.nan], [1, 2], "a: found 1 NaN"),
        ([1, -2], [1, 2], "scale='linear'"),
    ],
)
def test_comparisons_that_cannot_be_are_refused(a, b, message):
    with pytest.raises(UsageError, match=message):
        compare(a, b)


def test_tables_that_cannot_be_are_refused():
    with pytest.raises(UsageError, match="more than once: 'a'"):
        compare_all(["a", "a"], [[1], [2]])
    with pytest.raises(UsageError, match="2 rows for 1 labels"):
        compare_all(["a"], [[1], [2]])
