"""Who is ahead, as far as the cells settle it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mobman.benchmark.report.cells import Cell, Group
from mobman.benchmark.report.scores import Field, cell_error, cell_solved
from mobman.benchmark.statistics import (
    Interval,
    PairComparison,
    Rank,
    compare_all,
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
    """Runs without a result; they count as failures."""


@dataclass(frozen=True)
class FamilyStandings:
    """The standings in the scenarios of one family."""

    family: str
    cells: Sequence[Cell]
    standings: dict[str, Standing]


@dataclass(frozen=True)
class Leaderboard:
    """All standings, the best first; controllers that were not compared are last."""

    standings: list[Standing]
    families: list[FamilyStandings]
    pairs: list[PairComparison]
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
        cells = [cell for cell in everywhere if label in cell.labels]
        error = interquartile_mean([cell_error(cell, label) for cell in cells], scale="log10")
        standings.append(_standing(label, error, None, cells))
    families = [
        FamilyStandings(family, cells, _standings(field, cells))
        for family, cells in field.families.items()
    ]
    order = [standing.label for standing in standings if standing.ranks is not None]
    pairs = []
    if len(order) > 1 and field.cells:
        scores = dict(zip(field.labels, field.errors(), strict=True))
        pairs = compare_all(order, [scores[label] for label in order], strata=field.strata())
    return Leaderboard(standings, families if len(families) > 1 else [], pairs)


def _standings(field: Field, cells: Sequence[Cell]) -> dict[str, Standing]:
    if not cells:
        return {}
    found = ranking(field.labels, field.errors(cells), strata=field.strata(cells))
    return {rank.label: _standing(rank.label, rank.score, _range(rank), cells) for rank in found}


def _range(rank: Rank) -> tuple[int, int]:
    return rank.first, rank.last


def _standing(
    label: str, error: Interval, ranks: tuple[int, int] | None, cells: Sequence[Cell]
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
