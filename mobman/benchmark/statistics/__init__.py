"""Statistics of samples of runs: estimates with intervals, profiles, paired tests, ranks.

Lower is better and inf is a failure throughout: it is scored as the worst, never dropped. Arguments
that cannot be, such as NaN, are a :class:`mobman.errors.UsageError` that says what is allowed.
"""

from mobman.benchmark.statistics.comparisons import (
    Difference,
    PairComparison,
    Rank,
    SuccessComparison,
    adjust,
    compare,
    compare_all,
    compare_successes,
    ranking,
)
from mobman.benchmark.statistics.estimates import (
    FLOOR,
    Bootstrap,
    Interval,
    ScoreProfile,
    interquartile_mean,
    median,
    performance_profile,
    proportion,
    score_profile,
)

__all__ = [
    "FLOOR", "Bootstrap", "Difference", "Interval", "PairComparison", "Rank", "ScoreProfile",
    "SuccessComparison", "adjust", "compare", "compare_all", "compare_successes",
    "interquartile_mean", "median", "performance_profile", "proportion", "ranking", "score_profile",
]  # fmt: skip
