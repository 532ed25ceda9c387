"""Ranks: settled where the cells settle them, shared where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.benchmark.statistics import compare_all, interquartile_mean, median, ranking
from mobman.errors import UsageError

INF = np.inf


def _scores(shifts, n, seed=0, noise=0.3):
    """Labels that differ by decades, on cells that differ by more."""
    generator = np.random.default_rng(seed)
    shifts = np.asarray(shifts, dtype=float)
    cells = 2 * generator.normal(size=n)
    return 10 ** (cells + shifts[:, None] + noise * generator.normal(size=(len(shifts), n)))


def _ranges(ranks):
    return {rank.label: (rank.first, rank.last) for rank in ranks}


def test_what_lies_far_apart_is_settled_and_what_does_not_shares_its_ranks():
    ranks = ranking(["c", "a", "b1", "b2"], _scores([4, 0, 2, 2], 40))
    assert _ranges(ranks) == {"a": (1, 1), "b1": (2, 3), "b2": (2, 3), "c": (4, 4)}
    assert ranks[0].label == "a"
    assert ranks[-1].label == "c"
    estimates = [rank.score.estimate for rank in ranks]
    assert estimates == sorted(estimates)


def test_the_cells_are_paired():
    """Labels whose intervals overlap for the cells differ; cell by cell one is always better."""
    low, high = ranking(["low", "high"], _scores([0, 0.3], 40, noise=0.1))
    assert low.score.high > high.score.low
    assert _ranges([low, high]) == {"low": (1, 1), "high": (2, 2)}


def test_scores_are_the_statistics_own_with_their_interval():
    scores = _scores([0, 1], 40)
    for name, statistic in (("interquartile_mean", interquartile_mean), ("median", median)):
        first = ranking(["a", "b"], scores, statistic=name)[0].score
        peer = statistic(scores[0], scale="log10")
        assert first.estimate == pytest.approx(peer.estimate, rel=1e-12)
        limits = np.log10([first.low, first.high])
        np.testing.assert_allclose(limits, np.log10([peer.low, peer.high]), atol=0.25)


def test_few_cells_settle_nothing():
    assert _ranges(ranking(["a", "b"], _scores([0, 9], 5))) == {"a": (1, 2), "b": (1, 2)}
    assert _ranges(ranking(["a", "b"], _scores([0, 9], 6))) == {"a": (1, 1), "b": (2, 2)}
    assert _ranges(ranking(["a", "b"], [[1.0], [2.0]])) == {"a": (1, 2), "b": (1, 2)}


def test_equal_labels_share_all_ranks():
    one = _scores([0], 30)[0]
    ranks = ranking(["b", "a", "c"], [one, one, one])
    assert {(rank.first, rank.last) for rank in ranks} == {(1, 3)}
    assert [rank.label for rank in ranks] == ["a", "b", "c"]
    failed = ranking(["a", "b"], np.full((2, 30), INF))
    assert {(rank.first, rank.last) for rank in failed} == {(1, 2)}
    assert failed[0].score.estimate == INF


def test_what_fails_everywhere_is_last():
    scores = _scores([0, 0, 0], 30)
    scores[1] = INF
    ranks = ranking(["a", "broken", "b"], scores)
    assert _ranges(ranks)["broken"] == (3, 3)
    assert ranks[-1].label == "broken"


def test_a_single_label_is_first():
    (only,) = ranking(["a"], [[1.0, 2.0]])
    assert (only.first, only.last) == (1, 1)


def test_scores_below_the_floor_are_shared():
    generator = np.random.default_rng(1)
    scores = [1e-13 * generator.random(20), 1e-10 * generator.random(20)]
    assert _ranges(ranking(["a", "b"], scores, floor=1e-9))["a"] == (1, 2)
    assert _ranges(ranking(["a", "b"], scores, floor=1e-15))["a"] == (1, 1)


def test_order_of_labels_makes_no_difference():
    scores = _scores([0, 0.1, 0.2, 1.0], 25)
    labels = ["d", "b", "a", "c"]
    expected = ranking(labels, scores)
    for order in ([3, 2, 1, 0], [1, 3, 0, 2]):
        assert ranking([labels[i] for i in order], scores[order]) == expected


def test_order_of_cells_changes_no_clear_order():
    scores = _scores([0, 1, 1], 25)
    labels = ["a", "b", "c"]
    shuffled = np.random.default_rng(2).permutation(25)
    assert _ranges(ranking(labels, scores)) == _ranges(ranking(labels, scores[:, shuffled]))


def test_a_worse_run_never_improves_a_rank():
    scores = _scores([0, 0.25, 0.5], 12, seed=3)
    labels = ["a", "b", "c"]

    def found(scores):
        return {rank.label: rank for rank in ranking(labels, scores, resamples=300)}

    before = found(scores)
    for cell in range(12):
        for worse in (3 * scores[1, cell], INF):
            changed = scores.copy()
            changed[1, cell] = worse
            after = found(changed)
            assert after["b"].first >= before["b"].first
            assert after["b"].last >= before["b"].last
            assert after["b"].score.estimate >= before["b"].score.estimate
            for other in "ac":
                assert after[other].first <= before[other].first
                assert after[other].last <= before[other].last
                assert after[other].score == before[other].score


def test_orders_are_rarely_settled_by_chance():
    labels = ["a", "b", "c", "d"]
    false = 0
    for seed in range(100):
        ranks = ranking(labels, _scores([0, 0, 0, 0], 12, seed=seed, noise=1.0), resamples=500)
        false += any(rank.first > 1 or rank.last < 4 for rank in ranks)
    assert false <= 9  # level 0.95 for all orders together


def test_no_order_is_settled_that_the_paired_test_does_not_support():
    labels = ["a", "b", "c"]
    for seed in range(15):
        scores = _scores([0, 0.4, 0.8], 14, seed=seed, noise=0.7)
        p = {frozenset((pair.a, pair.b)): pair.adjusted_p for pair in compare_all(labels, scores)}
        ranges = _ranges(ranking(labels, scores, resamples=500))
        for pair, adjusted in p.items():
            one, other = (ranges[label] for label in pair)
            apart = one[1] < other[0] or other[1] < one[0]
            assert not apart or adjusted <= 0.05


def test_same_seed_same_bits():
    scores = _scores([0, 0.1], 20)
    assert ranking(["a", "b"], scores, seed=5) == ranking(["a", "b"], scores, seed=5)
    assert ranking(["a", "b"], scores, seed=5) != ranking(["a", "b"], scores, seed=6)


def test_higher_is_better_by_the_other_sign():
    scores = np.random.default_rng(4).random((2, 20)) + np.array([[1.0], [0.0]])
    ranks = ranking(["high", "low"], -scores, scale="linear")
    assert _ranges(ranks) == {"high": (1, 1), "low": (2, 2)}


@pytest.mark.parametrize(
    ("labels", "scores", "arguments", "message"),
    [
        (["a", "b"], [[1.0], [np.nan]], {}, "NaN"),
        (["a"], [[]], {}, "found none"),
        (["a"], [[1.0], [1.0]], {}, "2 rows for 1 labels"),
        (["a", "a"], [[1.0], [1.0]], {}, "more than once"),
        (["a"], [[1.0]], {"statistic": "mean"}, "'interquartile_mean' and 'median'"),
    ],
)
def test_rankings_that_cannot_be_are_refused(labels, scores, arguments, message):
    with pytest.raises(UsageError, match=message):
        ranking(labels, scores, **arguments)
