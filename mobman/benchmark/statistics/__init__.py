"""What samples of runs allow one to say: estimates with intervals, profiles, paired tests, ranks.

Lower is better and inf is a failure throughout: it is scored as the worst, never dropped.
"""

from mobman.benchmark.statistics.aggregates import interquartile_mean, median
from mobman.benchmark.statistics.all_pairs import PairComparison, compare_all
from mobman.benchmark.statistics.comparison import Comparison, compare
from mobman.benchmark.statistics.correction import adjust
from mobman.benchmark.statistics.interval import Interval
from mobman.benchmark.statistics.performance_profiles import performance_profile
from mobman.benchmark.statistics.proportions import proportion
from mobman.benchmark.statistics.ranks import Rank, ranking
from mobman.benchmark.statistics.score_profiles import ScoreProfile, score_profile
from mobman.benchmark.statistics.successes import SuccessComparison, compare_successes

__all__ = [
    "Comparison",
    "Interval",
    "PairComparison",
    "Rank",
    "ScoreProfile",
    "SuccessComparison",
    "adjust",
    "compare",
    "compare_all",
    "compare_successes",
    "interquartile_mean",
    "median",
    "performance_profile",
    "proportion",
    "ranking",
    "score_profile",
]
