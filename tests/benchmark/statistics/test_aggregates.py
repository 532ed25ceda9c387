"""Medians and interquartile means with bootstrap intervals, against numbers known by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import trim_mean

from mobman.benchmark.statistics import Interval, interquartile_mean, median
from mobman.errors import UsageError

INF = np.inf
BOTH = pytest.mark.parametrize("statistic", [median, interquartile_mean])


@pytest.mark.parametrize(
    ("values", "expected"),
    [([3, 1, 2], 2), ([4, 1, 3, 2], 2.5), ([1, 2, INF], 2), ([1, INF], INF), ([1, INF, INF], INF)],
)
def test_median_by_hand(values, expected):
    assert median(values).estimate == expected


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([8, 1, 3, 100], (3 + 8) / 2),
        ([1, 2, 9], 1 / 6 * 1 + 2 / 3 * 2 + 1 / 6 * 9),  # the edges count in part
        ([1, 2, 4, 8, 100], (0.75 * 2 + 4 + 0.75 * 8) / 2.5),
        ([5, 7], 6),
        ([1, 3, 5, INF], 4),
        ([1, 3, INF, INF], INF),
        ([1, 3, INF], INF),  # the failure is a third of the runs: it reaches the middle half
    ],
)
def test_interquartile_mean_by_hand(values, expected):
    assert interquartile_mean(values).estimate == pytest.approx(expected, rel=1e-14)


def test_interquartile_mean_is_scipys_trimmed_mean_where_nothing_counts_in_part():
    values = np.random.default_rng(0).lognormal(size=40)
    assert interquartile_mean(values).estimate == pytest.approx(trim_mean(values, 0.25), rel=1e-13)


def test_log10_gives_the_geometric_mean_in_the_original_unit():
    values = [0.0, 1e-8, 1e-6, 1.0]
    found = interquartile_mean(values, scale="log10")
    assert found.estimate == pytest.approx(1e-7, rel=1e-12)
    assert interquartile_mean([0.0, 0.0], scale="log10", floor=1e-9) == Interval(1e-9, 1e-9, 1e-9)
    assert interquartile_mean([1e-15] * 3, scale="log10", floor=1e-9).high == 1e-9
    assert median([1e-8, 1e-3, 1.0], scale="log10").estimate == pytest.approx(1e-3, rel=1e-14)


def test_large_values_leave_no_trace_in_small_ones():
    """Nor does the order of summing: 1e-12 beside 1 keeps its digits."""
    assert interquartile_mean([1e-12] * 12 + [1.0] * 3).estimate == pytest.approx(1e-12, rel=1e-13)


@BOTH
@pytest.mark.parametrize("scale", ["linear", "log10"])
@pytest.mark.parametrize("value", [0.3, 1e-7, INF])
@pytest.mark.parametrize("n", [1, 2, 7])
def test_equal_values_have_an_interval_without_width(statistic, scale, value, n):
    assert statistic([value] * n, scale=scale, resamples=50) == Interval(value, value, value)


@BOTH
def test_failures_are_in_the_interval_before_they_are_in_the_estimate(statistic):
    values = [*np.linspace(1, 2, 15), *[INF] * 4]
    found = statistic(values)
    assert np.isfinite(found.estimate)
    assert np.isfinite(found.low)
    # four of 19 are at times a quarter of a resample, and hardly ever half of it
    assert np.isinf(found.high) == (statistic is interquartile_mean)


def _covers(statistic, n, truth, generator, repetitions=300):
    found = 0
    for _ in range(repetitions):
        interval = statistic(10 ** generator.normal(size=n), scale="log10", resamples=300)
        found += interval.low <= truth <= interval.high
    return found / repetitions


@BOTH
def test_intervals_cover_the_truth_as_often_as_they_say(statistic):
    assert 0.90 <= _covers(statistic, 40, 1.0, np.random.default_rng(1)) <= 0.985


def test_intervals_are_narrower_at_a_lower_level_and_with_more_values():
    values = np.random.default_rng(2).normal(size=400)

    def width(values, level):
        interval = interquartile_mean(values, level=level)
        return interval.high - interval.low

    assert width(values, 0.5) < 0.5 * width(values, 0.95)
    assert width(values, 0.95) == pytest.approx(width(values[:100], 0.95) / 2, rel=0.35)


def test_interval_of_the_mean_agrees_with_scipys_bootstrap():
    from scipy.stats import bootstrap

    values = np.random.default_rng(3).lognormal(size=32)
    peer = bootstrap(
        (values,), lambda x, axis: trim_mean(x, 0.25, axis=axis), method="percentile",
        n_resamples=4000, rng=np.random.default_rng(4),
    ).confidence_interval  # fmt: skip
    own = interquartile_mean(values, resamples=4000)
    assert (own.low, own.high) == pytest.approx((peer.low, peer.high), rel=0.05)


@BOTH
def test_strata_are_resampled_within(statistic):
    """Three strata of one value each: no draw differs, whatever lies between them."""
    values, strata = [1.0, 5.0, 9.0], ["a", "b", "c"]
    fixed = statistic(values, strata=strata)
    assert fixed.low == fixed.estimate == fixed.high
    free = statistic(values)
    assert free.low < free.estimate < free.high


def test_stratified_interval_does_not_count_what_differs_between_strata():
    generator = np.random.default_rng(5)
    strata = np.repeat(["easy", "hard"], 40)
    values = np.where(strata == "easy", 0.0, 1.0) + 0.1 * generator.normal(size=80)
    within, free = interquartile_mean(values, strata=strata), interquartile_mean(values)
    assert within.estimate == free.estimate
    assert within.high - within.low < 0.5 * (free.high - free.low)


@BOTH
def test_order_of_values_makes_no_difference(statistic):
    generator = np.random.default_rng(6)
    values = generator.lognormal(size=31)
    values[::6] = INF
    strata = generator.integers(0, 3, size=31)
    shuffled = generator.permutation(31)
    assert statistic(values) == statistic(values[shuffled])
    first = statistic(values, strata=strata)
    assert first == statistic(values[shuffled], strata=strata[shuffled])


@BOTH
def test_same_seed_same_bits_and_another_seed_other_draws(statistic):
    values = np.random.default_rng(7).normal(size=25)
    assert statistic(values, seed=3) == statistic(values, seed=3)
    assert statistic(values, seed=3) != statistic(values, seed=4)


@BOTH
def test_a_worse_run_never_makes_a_number_better(statistic):
    generator = np.random.default_rng(8)
    values = generator.lognormal(size=9)
    before = statistic(values, resamples=200)
    for i in range(values.size):
        for worse in (values[i] * 1.1, 50.0, INF):
            changed = values.copy()
            changed[i] = worse
            after = statistic(changed, resamples=200)
            assert after.estimate >= before.estimate
            assert after.low >= before.low
            assert after.high >= before.high


@BOTH
@pytest.mark.parametrize(
    ("values", "arguments", "message"),
    [
        ([], {}, "found none"),
        ([1, np.nan], {}, r"1 NaN of 2; score a failure as inf"),
        ([1, -INF], {}, "lower is better, so a failure is scored as inf"),
        ([[1, 2]], {}, r"shape \(1, 2\)"),
        (["x"], {}, "expected numbers"),
        ([-1.0], {"scale": "log10"}, "found -1; scale 'log10' has no negative values"),
        ([1.0], {"scale": "log"}, "'linear' and 'log10'"),
        ([1.0], {"scale": "log10", "floor": 0}, "finite numbers > 0"),
        ([1.0], {"level": 95}, "between 0 and 1"),
        ([1.0], {"resamples": 0}, "whole numbers from 1"),
        ([1.0, 2.0], {"strata": ["a"]}, "found 1 for 2 values"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(statistic, values, arguments, message):
    with pytest.raises(UsageError, match=message):
        statistic(values, **arguments)
