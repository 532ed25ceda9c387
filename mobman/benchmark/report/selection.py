"""Which cells are drawn, where a suite has more than a page can hold."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from mobman.benchmark.report.cells import CellRuns, Group, unique
from mobman.benchmark.report.scores import cell_error
from mobman.errors import UsageError

MOST = 400
"""Cells that are all drawn; of more, a selection."""
EACH = 12
"""Cells of each kind in a selection."""


@dataclass(frozen=True)
class Selection:
    """Cells to draw."""

    cells: list[CellRuns]
    why: dict[str, str] = field(default_factory=dict)
    """By name: why it is among them; empty where all are drawn."""
    rule: str = ""
    """How they were chosen; empty where all are drawn."""


def select(groups: Sequence[Group], patterns: Sequence[str] = (), most: int = MOST) -> Selection:
    """All cells with runs, or those asked for, or a selection.

    Args:
        groups: The runs.
        patterns: Names of cells, with ``*`` and ``?``; all cells if there are none.
        most: Above so many, a selection is made.

    Raises:
        UsageError: If a pattern fits no cell.
    """
    cells = [cell for group in groups for cell in group.cells if cell.runs]
    if patterns:
        chosen: dict[str, CellRuns] = {}
        for pattern in patterns:
            found = [cell for cell in cells if fnmatchcase(cell.name, pattern)]
            if not found:
                names = [cell.name for cell in cells]
                near = difflib.get_close_matches(pattern, names, 3, 0.0) or ["there is none"]
                raise UsageError(
                    f"no cell has the name {pattern!r}; near it are: {'; '.join(near)} "
                    "(* stands for any text)"
                )
            chosen.update({cell.name: cell for cell in found})
        listed = list(chosen.values())
        return Selection(listed[:most], {}, f"Drawn: {', '.join(patterns)}, as asked for.")
    if len(cells) <= most:
        return Selection(cells)
    errors = {cell.name: _typical(cell) for cell in cells}
    ranked = sorted(cells, key=lambda cell: errors[cell.name])
    middle = len(ranked) // 2 - EACH // 2
    failing = sorted(cells, key=lambda cell: -_lost(cell))[:EACH]
    kinds = {
        "worst": ranked[::-1][:EACH],
        "failed": [cell for cell in failing if _lost(cell)],
        "median": ranked[middle : middle + EACH],
        "best": ranked[:EACH],
    }
    why: dict[str, str] = {}
    for kind, found in kinds.items():
        for cell in found:
            why.setdefault(cell.name, kind)
    order = unique([cell.name for found in kinds.values() for cell in found])
    by_name = {cell.name: cell for cell in cells}
    return Selection(
        [by_name[name] for name in order],
        why,
        f"Of {len(cells)} cells, {len(order)} are drawn: by the median over controllers of the steady "
        f"error the {EACH} worst, {EACH} in the middle and {EACH} best, and the {EACH} in which most "
        "runs ended early or have no result.",
    )


def _typical(cell: CellRuns) -> float:
    # one that was not done yet says nothing; there is a run, or the cell would not be drawn
    tried = [label for label in cell.labels if not cell.pending(label)] or cell.labels
    errors = sorted(cell_error(cell, label) for label in tried)
    # of cells in which half fail, those are worst in which the others are
    middle = errors[len(errors) // 2]
    return middle if math.isfinite(middle) else 1e300


def _lost(cell: CellRuns) -> int:
    failed = sum(not failure.pending for failure in cell.failures)
    return sum(not run.ok for run in cell.runs) + failed
