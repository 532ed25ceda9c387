"""Ranks of the controllers, as far as the cells settle them; and the cells that are drawn."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np
import pandas as pd

from mobman.benchmark import statistics
from mobman.benchmark.report.data import DONE, Results
from mobman.benchmark.statistics import Interval, proportion
from mobman.errors import UsageError

EFFORTS = {
    "torque_energy": "integral of |v|² over the cell's least",
    "torque_variation": "total variation of v over the cell's least",
}
"""The price of precision: metrics, and their names."""
FEW_BASES = 10
"""With so many platforms or more these are resampled, with all of their cells; with fewer, cells."""
ROUNDING = 1e-9  # errors below it (m) are rounding, whichever law they are of
_TWINS = "tsm", "tsm-inverse-actuation"
"""Laws that are one inside the unit ball, where v' is what makes S+ = 0 whatever multiplies u."""
MOST = 400  # cells that are all drawn; of more, a selection
EACH = 12  # cells of each kind in a selection


@dataclass(frozen=True)
class Standing:
    """A controller's place."""

    label: str
    error: Interval
    """Geometric interquartile mean of the cells' errors (m); inf where failures are in it."""
    ranks: tuple[int, int] | None
    """First and last that the cells allow; None if it was not compared."""
    solved: int  # cells in which all of its runs succeeded
    cells: int
    asked: int  # runs
    ended: int  # runs that diverged or met a singularity
    lost: int  # runs that were tried and gave no result; they count as failures
    beyond: int  # runs in which the robot went beyond its own limits
    twins: tuple[str, ...] = ()
    """Controllers that are the same law and have the same errors: they are compared as this one."""

    @property
    def rate(self) -> Interval:
        """Share of solved cells, with Wilson's interval."""
        return proportion(self.solved, self.cells)


@dataclass(frozen=True)
class Pair:
    """Two controllers on the same cells: by their errors, and by which cells they solve."""

    a: str
    b: str
    error: statistics.Difference
    error_p: float  # p-value of the errors, corrected for all pairs
    success: statistics.SuccessComparison
    success_p: float  # p-value of the solved cells, corrected for all pairs


@dataclass(frozen=True)
class Price:
    """The effort that a controller's precision takes."""

    label: str
    error: Interval  # geometric interquartile mean (m)
    effort: Interval  # median over cells of the effort over the cell's least
    front: bool  # True if no other is as good in both and better in one


@dataclass(frozen=True)
class Board:
    """The controllers that can be compared, where, and their standings.

    Cells are those that all of them have runs in and in which all of their runs were tried: of what
    was not run nothing is known, and to count it as failed would rank controllers by the order in
    which a suite is run.
    """

    labels: list[str]  # controllers that are compared, in the suite's order; of twins the first
    cells: pd.Index  # numbers of the cells that they are compared in
    asked: int  # cells of the suite
    pending: int  # cells that are left out until all of their runs are done
    standings: list[Standing]
    """The best first; controllers that were run in too few cells are last, without ranks."""
    families: dict[str, dict[str, Standing]]
    """Standings by scenario family and label, if there are several families."""
    pairs: list[Pair]  # every two compared controllers, the better placed as a
    unit: str = "cell"
    """Unit that is resampled: ``"robot"``, with all of its cells, or ``"cell"``; robots on the same
    platform count as one."""
    units: int = 0  # their number

    @property
    def ranked(self) -> list[Standing]:
        """Standings with ranks."""
        return [standing for standing in self.standings if standing.ranks is not None]

    @property
    def others(self) -> list[str]:
        """Labels of controllers without ranks."""
        return [standing.label for standing in self.standings if standing.ranks is None]

    @property
    def compares(self) -> bool:
        """True if there are controllers to compare, and cells to compare them in."""
        return len(self.ranked) > 1 and len(self.cells) > 0


def board_of(results: Results) -> Board:
    """Rank the controllers over the cells that all ran in.

    A controller that would cost more than half of the cells that the others share is left out.
    """
    asked = results.errors.notna()
    shared = pd.Series(True, results.cells.index)
    chosen: list[str] = []
    for label in sorted(results.labels, key=lambda label: -asked[label].sum()):  # stable
        left = shared & asked[label]
        if not chosen or 2 * left.sum() > shared.sum():
            shared = left
            chosen.append(label)
    labels = [label for label in results.labels if label in chosen]
    tried = shared & ~results.pending[labels].any(axis=1)
    cells = results.cells.index[tried]
    twins = _twins(results, labels, cells)
    labels = [label for label in labels if not any(label in own for own in twins.values())]
    standings = [
        replace(standing, twins=tuple(twins.get(label, ())))
        for label, standing in _standings(results, labels, cells).items()
    ]
    pairs = _pairs(results, [s.label for s in standings], cells) if len(standings) > 1 else []
    for label in (label for label in results.labels if label not in chosen):
        own = results.cells.index[asked[label] & ~results.pending[label]]
        if len(own):
            errors = results.errors.loc[own, label].tolist()
            error = statistics.interquartile_mean(errors, scale="log10")
            standings.append(_standing(results, label, error, None, own))
    members = results.cells.loc[cells].groupby("family", sort=False).groups
    families = {str(f): _standings(results, labels, own) for f, own in members.items()}
    return Board(
        labels,
        cells,
        asked=len(results.cells),
        pending=int(shared.sum() - tried.sum()),
        standings=standings,
        families=families if len(families) > 1 else {},
        pairs=pairs,
        unit=unit_of(results, cells),
        units=len(set(clusters(results, cells))),
    )


def unit_of(results: Results, cells: pd.Index) -> str:
    """Unit that is resampled: ``"robot"`` where there are enough on platforms of their own, else
    ``"cell"``."""
    return "robot" if results.cells.base.loc[cells].nunique() >= FEW_BASES else "cell"


def clusters(results: Results, cells: pd.Index) -> list[str]:
    """Name what each cell is resampled with: those of all robots on the same platform, or, where these
    are few, the same cell of these robots."""
    own = results.cells.loc[cells]
    if unit_of(results, cells) == "robot":
        return list(own.base)
    return [f"{cell.base}\0{cell.task}\0{cell.case}\0{cell.placement}" for cell in own.itertuples()]


def _twins(results: Results, labels: Sequence[str], cells: pd.Index) -> dict[str, list[str]]:
    """Labels of the twin by a label of tsm: its errors are the same to 10 % in the median over cells, to
    a factor of two or rounding in each; tuned ones stay by themselves."""
    laws = results.runs.drop_duplicates("label").set_index("label").law
    errors = results.errors.loc[cells].clip(lower=ROUNDING)
    found: dict[str, list[str]] = {}
    for twin in labels if len(cells) else ():
        for label in labels if laws[twin] == _TWINS[1] and twin not in results.tuned else ():
            a, b = errors[label], errors[twin]
            # the larger by the smaller; both infinite where both end early
            factor = (np.maximum(a, b) / np.minimum(a, b)).mask(a == b, 1.0)
            same = factor.max() <= 2.0 and factor.median() <= 1.1
            if laws[label] == _TWINS[0] and label not in results.tuned and same:
                found.setdefault(label, []).append(twin)
                break
    return found


def _standings(results: Results, labels: list[str], cells: pd.Index) -> dict[str, Standing]:
    if not len(cells):
        return {}
    errors = results.errors.loc[cells, labels].to_numpy().T
    return {
        rank.label: _standing(results, rank.label, rank.score, (rank.first, rank.last), cells)
        for rank in statistics.ranking(labels, errors, clusters=clusters(results, cells))
    }


def _standing(
    results: Results, label: str, error: Interval, ranks: tuple[int, int] | None, cells: pd.Index
) -> Standing:
    solved = int(results.solved.loc[cells, label].sum())
    asked, ended, lost, beyond = (
        int(table.loc[cells, label].sum()) for table in results.counts.values()
    )
    return Standing(label, error, ranks, solved, len(cells), asked, ended, lost, beyond)


def _pairs(results: Results, order: Sequence[str], cells: pd.Index) -> list[Pair]:
    """Every two controllers, in an order."""
    scores = [results.errors.loc[cells, label].to_numpy() for label in order]
    own = clusters(results, cells)
    errors = statistics.compare_all(order, scores, clusters=own)
    solved = results.solved.loc[cells]
    successes = [
        statistics.compare_successes(solved[p.a].tolist(), solved[p.b].tolist(), clusters=own)
        for p in errors
    ]
    adjusted = statistics.adjust([found.p_value for found in successes])
    return [
        Pair(pair.a, pair.b, pair.comparison, pair.adjusted_p, success, float(p))
        for pair, success, p in zip(errors, successes, adjusted, strict=True)
    ]


def prices_of(results: Results, board: Board, metric: str) -> list[Price]:
    """Set precision against an effort; failures cost, and miss, without end."""
    efforts, own = results.effort(metric).loc[board.cells], clusters(results, board.cells)
    found = {
        s.label: (
            s.error,
            statistics.median(efforts[s.label].to_numpy(), scale="log10", clusters=own),
        )
        for s in board.ranked
    }
    points = {label: (e.estimate, p.estimate) for label, (e, p) in found.items()}

    def front(label: str) -> bool:
        x, y = points[label]
        beaten = any(p != (x, y) and p[0] <= x and p[1] <= y for p in points.values())
        return math.isfinite(x + y) and not beaten

    return [Price(label, error, effort, front(label)) for label, (error, effort) in found.items()]


def upper_median(errors: pd.Series) -> float:
    """Find the middle one; of an even number the worse of the two: where half failed, this failed."""
    found = np.sort(errors.dropna())
    return float(found[len(found) // 2]) if len(found) else math.inf


@dataclass(frozen=True)
class Selection:
    """Cells to draw; where not all are drawn, why each is among them, and the rule of the choice."""

    cells: list[int]
    why: dict[int, str] = field(default_factory=dict)
    rule: str = ""


def select(results: Results, patterns: Sequence[str] = (), most: int = MOST) -> Selection:
    """Choose all cells with runs, a selection where they are more than so many, or at most so many whose
    names fit patterns with ``*`` and ``?``.

    Raises:
        UsageError: If a pattern fits no cell.
    """
    runs = results.runs
    names = results.cells.name[results.cells.index.isin(runs.cell[runs.state == DONE])]
    if patterns:
        chosen: dict[int, None] = {}
        for pattern in patterns:
            found = [cell for cell, name in names.items() if fnmatchcase(name, pattern)]
            if not found:
                near = difflib.get_close_matches(pattern, list(names), 3, 0.0) or ["there is none"]
                raise UsageError(
                    f"no cell has the name {pattern!r}; near it are: {'; '.join(near)} "
                    "(* stands for any text)"
                )
            chosen.update(dict.fromkeys(found))
        return Selection([*chosen][:most], {}, f"Drawn: {', '.join(patterns)}, as requested.")
    if len(names) <= most:
        return Selection(list(names.index))
    # one that was not run yet says nothing; there is a run, or the cell would not be drawn
    tried = results.errors.mask(results.pending).loc[names.index]
    # of cells in which half fail, those are worst in which the others are
    middle = tried.apply(upper_median, axis=1)
    ranked = list(middle.replace(math.inf, 1e300).sort_values(kind="stable").index)
    failed = ~runs.ok & (runs.state != "not run")
    lost = failed.groupby(runs.cell).sum().reindex(names.index)
    failing = lost[lost > 0].sort_values(ascending=False, kind="stable")
    start = len(ranked) // 2 - EACH // 2
    kinds = {
        "worst": ranked[::-1][:EACH],
        "failed": list(failing.index[:EACH]),
        "median": ranked[start : start + EACH],
        "best": ranked[:EACH],
    }
    why: dict[int, str] = {}
    for kind, members in kinds.items():
        for cell in members:
            why.setdefault(cell, kind)
    rule = (
        f"Of {len(names)} cells, {len(why)} are drawn: by the median over controllers of the steady "
        f"error the {EACH} worst, {EACH} in the middle and {EACH} best, and the {EACH} in which most "
        "runs ended early or have no result."
    )
    return Selection(list(why), why, rule)
