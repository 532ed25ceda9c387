"""Two labels on the same cells: is one better, by how much, and how surely."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobman.arrays import Array
from mobman.benchmark.statistics.aggregates import bootstrap
from mobman.benchmark.statistics.interval import Interval, check_level
from mobman.benchmark.statistics.resampling import RESAMPLES
from mobman.benchmark.statistics.samples import as_sample, as_strata
from mobman.benchmark.statistics.scale import FLOOR, Scale, to_scale
from mobman.benchmark.statistics.signed_rank import signed_rank
from mobman.errors import UsageError

_DIGITS = 12  # of a decade: ratios that are equal but for rounding are tied


@dataclass(frozen=True)
class Comparison:
    """What the cells say of a against b; negative numbers: a is lower, so better."""

    n: int
    """Cells."""
    median_difference: Interval
    """Median over cells of a - b: in the scores' unit, or in decades, as ``scale`` says."""
    p_value: float
    """Of Wilcoxon's signed-rank test, two-sided, for this pair alone: see :func:`adjust`."""
    effect_size: float
    """Matched-pairs rank-biserial correlation: -1, a is better in all cells; 1, b is."""
    wins: int
    """Cells in which a is better."""
    ties: int
    """Cells in which they are equal, or both failed."""
    losses: int
    """Cells in which b is better."""
    smallest_p: float
    """The p that as many untied cells would give if all said the same: if it is above one's
    threshold, there are too few cells for any outcome to be significant."""
    scale: Scale
    """What the differences are of."""


def compare(
    a: ArrayLike,
    b: ArrayLike,
    *,
    scale: Scale = "log10",
    floor: float = FLOOR,
    strata: Sequence[Hashable] | None = None,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Comparison:
    """Compare two labels by their scores on the same cells.

    Args:
        a: Shape (n,), lower is better; inf is a failure. A failure against a result is the largest
            difference there is; where both failed, the difference is 0.
        b: Shape (n,), on the same cells in the same order.
        scale: ``"log10"``, differences in decades (-1: a tenth of b's score), or ``"linear"``.
        floor: On ``"log10"``, what smaller scores count as: two below it are tied.
        strata: Shape (n,), labels of cells to resample within for the interval.
        level: Confidence level of the interval.
        resamples: Of its percentile bootstrap.
        seed: Of its draws.

    Raises:
        UsageError: If the shapes differ, scores are NaN, or an argument cannot be.
    """
    first, second = as_sample(a, "a"), as_sample(b, "b")
    if len(first) != len(second):
        raise UsageError(
            f"a and b: found {len(first)} and {len(second)} scores; allowed is one of each for a cell"
        )
    differences = paired_differences(
        to_scale(first, scale, floor), to_scale(second, scale, floor), scale
    )
    numbers = as_strata(strata, len(differences))
    test = signed_rank(differences)
    return Comparison(
        n=len(differences),
        median_difference=bootstrap(
            differences, numbers, "median", check_level(level), resamples, seed
        ),
        p_value=test.p_value,
        effect_size=test.effect_size,
        wins=int((differences < 0.0).sum()),
        ties=int((differences == 0.0).sum()),
        losses=int((differences > 0.0).sum()),
        smallest_p=test.smallest_p,
        scale=scale,
    )


def paired_differences(a: Array, b: Array, scale: Scale) -> Array:
    """a - b, both on the scale: -inf, 0 or inf where b, both or a failed."""
    both = np.isinf(a) & np.isinf(b)
    differences = np.where(both, 0.0, a) - np.where(both, 0.0, b)
    return np.round(differences, _DIGITS) if scale == "log10" else differences
