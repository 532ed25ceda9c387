"""Who is ahead, as far as the cells settle it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mobman.benchmark.report.cells import CellRuns, Group
from mobman.benchmark.report.scores import Field, cell_error, cell_solved
from mobman.benchmark.statistics import (
    Comparison,
    Interval,
    Rank,
    SuccessComparison,
    adjust,
    compare_all,
    compare_successes,
    interquartile_mean,
    proportion,
    ranking,
)


@dataclass(frozen=True)
class Standing:
    """A controller's place."""

    label: str
    error: Interval
    """Geometric interquartile mean of the cells' errors (m); inf where failures are in it."""
    ranks: tuple[int, int] | None
    """First and last that the cells allow; None if it was not compared."""
    solved: int
    """Cells in which all of its runs succeeded."""
    cells: int
    rate: Interval
    """Share of solved cells, with Wilson's interval."""
    asked: int
    """Runs."""
    ended: int
    """Runs that diverged or met a singularity."""
    lost: int
    """Runs that were tried and gave no result; they count as failures."""


@dataclass(frozen=True)
class FamilyStandings:
    """The standings in the scenarios of one family."""

    family: str
    cells: Sequence[CellRuns]
    standings: dict[str, Standing]


@dataclass(frozen=True)
class Pair:
    """Two controllers on the same cells: by their errors, and by which cells they solve."""

    a: str
    b: str
    error: Comparison
    error_p: float
    """Of the errors, corrected for all pairs."""
    success: SuccessComparison
    success_p: float
    """Of the solved cells, corrected for all pairs."""


@dataclass(frozen=True)
class Leaderboard:
    """All standings, the best first; controllers that were not compared are last."""

    standings: list[Standing]
    families: list[FamilyStandings]
    pairs: list[Pair]
    """Of every two compared controllers, the better placed as a."""

    @property
    def compared(self) -> list[Standing]:
        """Those with ranks."""
        return [standing for standing in self.standings if standing.ranks is not None]


def leaderboard_of(field: Field, groups: Sequence[Group]) -> Leaderboard:
    """The standings over the cells that all controllers were asked for, and by scenario family."""
    standings = list(_standings(field, field.cells).values())
    everywhere = [cell for group in groups for cell in group.cells]
    for label in field.others:
        cells = [c for c in everywhere if label in c.labels and not c.pending(label)]
        if not cells:
            continue
        error = interquartile_mean([cell_error(cell, label) for cell in cells], scale="log10")
        standings.append(_standing(label, error, None, cells))
    families = [
        FamilyStandings(family, cells, _standings(field, cells))
        for family, cells in field.families.items()
    ]
    order = [standing.label for standing in standings if standing.ranks is not None]
    pairs = _pairs(field, order) if len(order) > 1 and field.cells else []
    return Leaderboard(standings, families if len(families) > 1 else [], pairs)


def _pairs(field: Field, order: Sequence[str]) -> list[Pair]:
    """Every two controllers, in an order."""
    scores = dict(zip(field.labels, field.errors(), strict=True))
    errors = compare_all(order, [scores[label] for label in order], strata=field.strata())
    solved = field.solved()
    successes = [compare_successes(solved[pair.a], solved[pair.b]) for pair in errors]
    adjusted = adjust([found.p_value for found in successes])
    return [
        Pair(pair.a, pair.b, pair.comparison, pair.adjusted_p, success, float(p))
        for pair, success, p in zip(errors, successes, adjusted, strict=True)
    ]


def _standings(field: Field, cells: Sequence[CellRuns]) -> dict[str, Standing]:
    if not cells:
        return {}
    found = ranking(field.labels, field.errors(cells), strata=field.strata(cells))
    return {rank.label: _standing(rank.label, rank.score, _range(rank), cells) for rank in found}


def _range(rank: Rank) -> tuple[int, int]:
    return rank.first, rank.last


def _standing(
    label: str, error: Interval, ranks: tuple[int, int] | None, cells: Sequence[CellRuns]
) -> Standing:
    runs = [run for cell in cells for run in cell.of(label)]
    lost = sum(len(cell.failures_of(label)) for cell in cells)
    solved = sum(cell_solved(cell, label) for cell in cells)
    return Standing(
        label,
        error,
        ranks,
        solved,
        len(cells),
        proportion(solved, len(cells)),
        len(runs) + lost,
        sum(not run.ok for run in runs),
        lost,
    )
