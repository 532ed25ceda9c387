"""What is compared: one number for each controller and cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.benchmark.report.cells import CellRuns, Group, unique
from mobman.benchmark.report.content import ReportedRun
from mobman.benchmark.statistics import FLOOR


def worst_error(runs: Sequence[ReportedRun]) -> float:
    """The largest steady task error (m); inf where a run did not go to its end."""
    errors = [run.metrics.get("task_error_max", math.inf) for run in runs]
    return math.inf if any(math.isnan(error) for error in errors) else max(errors, default=math.inf)


def cell_error(cell: CellRuns, label: str) -> float:
    """A controller's score in a cell (m): the worst of its seeds; inf if one has no result."""
    if cell.failures_of(label):
        return math.inf
    return max(worst_error(cell.of(label)), FLOOR)


def cell_solved(cell: CellRuns, label: str) -> bool:
    """Whether every run of a controller in a cell succeeded."""
    runs = cell.of(label)
    return bool(runs) and not cell.failures_of(label) and all(run.succeeded for run in runs)


def cell_metric(cell: CellRuns, label: str, name: str) -> float:
    """The median over the seeds of another metric; inf where a run did not go to its end."""
    runs = cell.of(label)
    if not runs or cell.failures_of(label) or not all(run.ok for run in runs):
        return math.inf
    values = [run.metric(name) for run in runs]
    return math.inf if any(math.isnan(value) for value in values) else float(np.median(values))


@dataclass(frozen=True)
class Field:
    """The controllers that can be compared, and the cells that all of them were asked for.

    Only cells in which all of their runs were tried: of what was not done nothing is known, and to
    count it as failed would rank controllers by the order in which a suite is run.
    """

    labels: tuple[str, ...]
    others: tuple[str, ...]
    """Controllers that were asked for elsewhere only, or in too few of the cells."""
    cells: tuple[CellRuns, ...]
    asked: int
    """Cells of the suite."""
    pending: int = 0
    """Cells that are left out until all of their runs are done."""

    def errors(self, cells: Sequence[CellRuns] | None = None) -> Array:
        """The scores (m), shape (labels, cells); inf for failures."""
        chosen = self.cells if cells is None else cells
        errors = [[cell_error(cell, label) for cell in chosen] for label in self.labels]
        return np.asarray(errors, dtype=float).reshape(len(self.labels), len(chosen))

    def solved(self) -> dict[str, list[bool]]:
        """By label, in which cells all of its runs succeeded."""
        return {label: [cell_solved(cell, label) for cell in self.cells] for label in self.labels}

    def efforts(self, metric: str) -> Array:
        """A metric over the least of its cell, shape (labels, cells); inf for failures."""
        found = np.array(
            [[cell_metric(cell, label, metric) for cell in self.cells] for label in self.labels]
        ).reshape(len(self.labels), len(self.cells))
        least = np.min(np.where(found > 0.0, found, np.inf), axis=0, initial=np.inf)
        with np.errstate(invalid="ignore"):
            ratio = found / least
        return np.where(np.isfinite(found) & np.isfinite(least), ratio, np.inf)

    def strata(self, cells: Sequence[CellRuns] | None = None) -> list[str]:
        """What kind of cell each is: its robot and task."""
        chosen = self.cells if cells is None else cells
        return [f"{cell.robot}\0{cell.task}" for cell in chosen]

    @property
    def families(self) -> dict[str, list[CellRuns]]:
        """The cells by the family of their scenario, in the suite's order."""
        found: dict[str, list[CellRuns]] = {}
        for cell in self.cells:
            found.setdefault(cell.family, []).append(cell)
        return found


def field_of(groups: Sequence[Group]) -> Field:
    """Who can be compared, where.

    Ranks are fair only over cells that all were asked for. A controller that would cost more than
    half of the cells that the others share is left out.
    """
    cells = [cell for group in groups for cell in group.cells]
    asked: dict[str, set[int]] = {}
    for index, cell in enumerate(cells):
        for label in cell.labels:
            asked.setdefault(label, set()).add(index)
    labels = unique([label for group in groups for label in group.labels])
    shared: set[int] = set(range(len(cells)))
    chosen: list[str] = []
    for label in sorted(labels, key=lambda label: -len(asked[label])):  # stable
        left = shared & asked[label]
        if not chosen or 2 * len(left) > len(shared):
            shared = left
            chosen.append(label)
    common = [cell for index, cell in enumerate(cells) if index in shared]
    tried = [cell for cell in common if not any(map(cell.pending, chosen))]
    return Field(
        tuple(label for label in labels if label in chosen),
        tuple(label for label in labels if label not in chosen),
        tuple(tried),
        len(cells),
        len(common) - len(tried),
    )
