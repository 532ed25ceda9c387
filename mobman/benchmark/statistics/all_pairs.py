"""Every pair of labels compared, with p-values that are corrected for how many pairs there are."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import combinations

from numpy.typing import ArrayLike

from mobman.benchmark.statistics.comparison import Comparison, compare
from mobman.benchmark.statistics.correction import Correction, adjust
from mobman.benchmark.statistics.resampling import RESAMPLES
from mobman.benchmark.statistics.samples import as_table
from mobman.benchmark.statistics.scale import FLOOR, Scale


@dataclass(frozen=True)
class PairComparison:
    """Two labels compared, as one of several pairs."""

    a: str
    b: str
    comparison: Comparison
    """Of a against b."""
    adjusted_p: float
    """The comparison's p-value, corrected for all pairs."""


def compare_all(
    labels: Sequence[str],
    scores: ArrayLike,
    *,
    method: Correction = "holm",
    scale: Scale = "log10",
    floor: float = FLOOR,
    strata: Sequence[Hashable] | None = None,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> list[PairComparison]:
    """Compare every label with every other by their scores on the same cells.

    Args:
        labels: Of the rows.
        scores: Shape (n_labels, n_cells), lower is better; inf is a failure.
        method: Of :func:`adjust`.
        scale: See :func:`compare`, as for what follows.
        floor: On ``"log10"``, what smaller scores count as.
        strata: Shape (n_cells,), labels of cells to resample within.
        level: Confidence level of each interval.
        resamples: Of the bootstrap.
        seed: Of its draws.

    Returns:
        One for each pair, in the order of the labels; none for a single label.

    Raises:
        UsageError: If the shapes do not fit, scores are NaN, or an argument cannot be.
    """
    names, table = as_table(labels, scores)
    pairs = list(combinations(range(len(names)), 2))
    found = [
        compare(
            table[i],
            table[j],
            scale=scale,
            floor=floor,
            strata=strata,
            level=level,
            resamples=resamples,
            seed=seed,
        )
        for i, j in pairs
    ]
    adjusted = adjust([comparison.p_value for comparison in found], method)
    return [
        PairComparison(names[i], names[j], comparison, float(p))
        for (i, j), comparison, p in zip(pairs, found, adjusted, strict=True)
    ]
