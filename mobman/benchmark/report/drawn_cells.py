"""The figures of single cells: which are drawn, and where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mobman.benchmark.report.cells import CellRuns, Group
from mobman.benchmark.report.drawings import CellFigures, Draughtsman, papers_cells
from mobman.benchmark.report.selection import Selection, select


@dataclass(frozen=True)
class DrawnCells:
    """The cells of a report that have figures."""

    paper: list[CellFigures]
    """Those whose figures are the paper's; none if cells are asked for."""
    others: list[CellFigures]
    """Of the selection, without the former."""
    selection: Selection

    @property
    def cells(self) -> list[CellRuns]:
        """The paper's, then the whole selection."""
        return [*(item.cell for item in self.paper), *self.selection.cells]


def draw_cells(
    groups: Sequence[Group], patterns: Sequence[str], draughtsman: Draughtsman
) -> DrawnCells:
    """Select cells, and draw them.

    Args:
        groups: The runs.
        patterns: Names of the cells to draw; see :func:`.selection.select`.
        draughtsman: Who draws them.

    Raises:
        UsageError: If a pattern fits no cell.
    """
    paper = [] if patterns else [draughtsman.whole(cell) for cell in papers_cells(groups)]
    selection = select(groups, patterns)
    done = {item.cell.name for item in paper}
    rest = [cell for cell in selection.cells if cell.name not in done]
    return DrawnCells(paper, list(draughtsman.cells(rest, selection.why)), selection)
