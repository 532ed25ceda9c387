"""Performance and score profiles, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.benchmark.statistics import performance_profile, score_profile
from mobman.errors import UsageError

INF = np.inf
SCORES = [
    [1.0, 4.0, INF, 3.0, 2.0],
    [2.0, 2.0, INF, 1.0, INF],
]


def test_performance_profile_by_hand():
    found = performance_profile(SCORES, [1.0, 2.0, 3.0, 1e6])
    np.testing.assert_allclose(found, [[0.4, 0.6, 0.8, 0.8], [0.4, 0.6, 0.6, 0.6]], rtol=1e-15)


def test_nobody_solves_a_cell_in_which_all_failed():
    np.testing.assert_array_equal(
        performance_profile([[INF], [INF]], [1.0, 1e300]), np.zeros((2, 2))
    )


def test_scores_below_the_floor_are_equal():
    scores = [[1e-13, 2e-9, 0.0], [1e-11, 1e-13, 3e-9]]
    np.testing.assert_allclose(performance_profile(scores, [1.0]), [[2 / 3], [1 / 3]])
    found = performance_profile(scores, [1.0, 2.0, 3.0], floor=1e-9)
    np.testing.assert_allclose(found, [[2 / 3, 1, 1], [2 / 3, 2 / 3, 1]])


def test_performance_profiles_follow_their_labels_and_not_the_order_of_cells():
    generator = np.random.default_rng(0)
    scores = generator.lognormal(size=(4, 30))
    scores[1, ::4] = INF
    taus = np.geomspace(1, 100, 20)
    found = performance_profile(scores, taus)
    order = [2, 0, 3, 1]
    np.testing.assert_array_equal(performance_profile(scores[order], taus), found[order])
    np.testing.assert_array_equal(performance_profile(scores[:, ::-1], taus), found)
    assert (np.diff(found, axis=1) >= 0).all()
    assert found[:, 0].sum() == pytest.approx(1.0)  # one best in each cell


def test_a_worse_run_never_raises_the_own_performance_profile():
    scores = np.random.default_rng(1).lognormal(size=(3, 6))
    taus = np.geomspace(1, 100, 20)
    before = performance_profile(scores, taus)
    for cell in range(6):
        for worse in (2 * scores[0, cell], INF):
            changed = scores.copy()
            changed[0, cell] = worse
            assert (performance_profile(changed, taus)[0] <= before[0]).all()


@pytest.mark.parametrize(
    ("scores", "taus", "floor", "message"),
    [
        ([1.0], [1.0], 0.0, "2 dimensions"),
        ([[-1.0]], [1.0], 0.0, "scores >= 0"),
        ([[np.nan]], [1.0], 0.0, "NaN"),
        ([[1.0]], [0.5], 0.0, "factors >= 1"),
        ([[1.0]], [INF], 0.0, "finite factors"),
        ([[1.0]], [1.0], -1.0, "numbers >= 0"),
    ],
)
def test_profiles_that_cannot_be_are_refused(scores, taus, floor, message):
    with pytest.raises(UsageError, match=message):
        performance_profile(scores, taus, floor=floor)


def test_score_profile_by_hand():
    found = score_profile([1e-3, 1e-6, INF, 1e-3], [1e-9, 1e-6, 1e-3, 1.0])
    np.testing.assert_array_equal(found.share, [0, 0.25, 0.75, 0.75])
    np.testing.assert_array_equal(found.taus, [1e-9, 1e-6, 1e-3, 1.0])
    assert (found.low <= found.share).all()
    assert (found.share <= found.high).all()
    assert found.high[0] == 0.0  # no resample has what the sample has not
    np.testing.assert_array_equal(score_profile([INF, INF], [INF]).share, [0.0])


def test_bands_cover_the_truth_as_often_as_they_say():
    generator = np.random.default_rng(2)
    taus = np.array([0.3, 0.5])
    covered = np.zeros(2)
    for _ in range(300):
        found = score_profile(generator.random(60), taus, resamples=300)
        covered += (found.low <= taus) & (taus <= found.high)
    assert (covered / 300 >= 0.90).all()
    assert (covered / 300 <= 0.99).all()


def test_bands_do_not_depend_on_the_order_and_are_of_the_strata():
    values = np.random.default_rng(3).random(20)
    taus = np.linspace(0, 1, 11)
    first, second = score_profile(values, taus), score_profile(values[::-1], taus)
    np.testing.assert_array_equal(first.low, second.low)
    np.testing.assert_array_equal(first.high, second.high)
    fixed = score_profile(values, taus, strata=list(range(20)))
    np.testing.assert_array_equal(fixed.low, fixed.high)
