"""The cluster bootstrap and tests by clusters, on data whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.benchmark.statistics import (
    compare,
    compare_all,
    compare_successes,
    interquartile_mean,
    median,
    ranking,
    score_profile,
)
from mobman.errors import UsageError

BOTH = pytest.mark.parametrize("statistic", [median, interquartile_mean])


def sample(generator, n, *, least=1, most=6):
    """Decades about 0 of n clusters, most of whose variation is between them."""
    names = np.repeat(np.arange(n), generator.integers(least, most + 1, n))
    return generator.normal(size=n)[names] + 0.5 * generator.normal(size=len(names)), names.tolist()


def coverage(statistic, n, repetitions):
    generator, found = np.random.default_rng(n), 0
    for _ in range(repetitions):
        values, names = sample(generator, n)
        interval = statistic(10.0**values, scale="log10", resamples=500, clusters=names)
        found += interval.low <= 1.0 <= interval.high
    return found / repetitions


@BOTH
@pytest.mark.slow
@pytest.mark.parametrize("n", [12, 18, 40])
def test_intervals_of_clusters_hold_the_truth(statistic, n):
    """Of 1500 repetitions the share has a standard error of 0.006."""
    assert 0.93 <= coverage(statistic, n, 1500) <= 0.97


def test_intervals_that_know_of_no_clusters_are_too_sure():
    generator, alone, whole = np.random.default_rng(3), 0, 0
    for _ in range(60):
        values, names = sample(generator, 12, least=5)
        for clusters in (None, names):
            found = interquartile_mean(
                10.0**values, scale="log10", resamples=200, clusters=clusters
            )
            held = found.low <= 1.0 <= found.high
            alone, whole = (alone + held, whole) if clusters is None else (alone, whole + held)
    assert alone <= 0.75 * 60
    assert whole >= 0.85 * 60


@BOTH
def test_copies_of_a_robot_settle_nothing_more(statistic):
    """Each cluster ten times over: the interval is that of one of each."""
    values = 10.0 ** np.random.default_rng(0).normal(size=14)
    once = statistic(values, scale="log10", clusters=list(range(14)))
    copies = statistic(
        np.repeat(values, 10), scale="log10", clusters=np.repeat(range(14), 10).tolist()
    )
    assert copies.estimate == pytest.approx(once.estimate, rel=0.2)
    assert np.log10(copies.high / copies.low) == pytest.approx(
        np.log10(once.high / once.low), rel=0.1
    )
    assert statistic(np.repeat(values, 10), scale="log10").high < once.high


def test_neither_order_nor_names_matter():
    values, names = sample(np.random.default_rng(1), 9)
    scores = 10.0**values
    mixed = np.random.default_rng(2).permutation(len(scores))
    found = median(scores, scale="log10", clusters=names)
    own = [names[i] for i in mixed]
    assert median(scores[mixed], scale="log10", clusters=own) == found
    band = score_profile(scores, [0.1, 1.0, 10.0], clusters=names)
    assert np.all(band.low <= band.share)
    assert np.all(band.share <= band.high)
    assert band.share[1] == np.mean(scores <= 1.0)


def test_paired_tests_count_clusters():
    a, b = np.ones(30), np.full(30, 10.0)
    names = np.repeat(range(6), 5).tolist()
    assert compare(a, b).smallest_p == 2.0**-29
    found = compare(a, b, clusters=names)
    assert (found.n, found.wins) == (30, 30)
    assert found.p_value == found.smallest_p == 2.0**-5
    worse = np.where(
        np.arange(30) % 5 == 0, 100.0, a
    )  # in one cell of each: its median does not mind
    assert compare(worse, b, clusters=names).p_value == 2.0**-5
    assert compare(worse, b, clusters=names).losses == 6
    won = compare_successes(np.ones(30), np.zeros(30), clusters=names)
    assert (won.only_a, won.p_value, won.smallest_p) == (30, 2.0**-5, 2.0**-5)
    both = compare_successes(np.arange(30) % 2, (np.arange(30) + 1) % 2, clusters=[0] * 30)
    assert both.p_value == 1.0


def false_findings(n, labels, repetitions):
    """Share of tables of equals in which any pair, or any order, is called different."""
    generator, pairs, orders = np.random.default_rng(n), 0, 0
    for _ in range(repetitions):
        names = sample(generator, n)[1]
        effects = generator.normal(size=(labels, n))[:, names]
        scores = 10.0 ** (effects + 0.3 * generator.normal(size=(labels, len(names))))
        own = [str(i) for i in range(labels)]
        found = compare_all(own, scores, clusters=names, resamples=10)
        pairs += min(pair.adjusted_p for pair in found) < 0.05
        places = {
            (rank.first, rank.last) for rank in ranking(own, scores, clusters=names, resamples=300)
        }
        orders += places != {(1, labels)}
    return pairs / repetitions, orders / repetitions


@pytest.mark.slow
@pytest.mark.parametrize("n", [12, 24])
def test_equals_are_hardly_ever_told_apart(n):
    pairs, orders = false_findings(n, 4, 400)
    assert pairs <= 0.05 + 0.025
    assert orders <= 0.05 + 0.025


def test_what_differs_is_told_apart_and_what_does_not_is_not():
    """Three labels, the first two equal, the third a decade worse, on twelve clusters."""
    generator = np.random.default_rng(5)
    hard, names = sample(generator, 12)
    levels = (0.0, 0.0, 1.0)
    scores = [10.0 ** (hard + level + 0.2 * generator.normal(size=len(hard))) for level in levels]
    found = {
        (pair.a, pair.b): pair.adjusted_p < 0.05
        for pair in compare_all("abc", scores, clusters=names)
    }
    assert found == {("a", "b"): False, ("a", "c"): True, ("b", "c"): True}
    ranks = {rank.label: (rank.first, rank.last) for rank in ranking("abc", scores, clusters=names)}
    assert ranks == {"a": (1, 2), "b": (1, 2), "c": (3, 3)}


def test_what_cannot_be_is_refused():
    with pytest.raises(UsageError, match="clusters: found 1 for 2 values"):
        median([1.0, 2.0], clusters=["a"])
    with pytest.raises(UsageError, match="allowed is one of them"):
        median([1.0, 2.0], clusters=["a", "b"], strata=["a", "b"])
