"""Tables of every metric, of as many cells as a page can hold."""

from __future__ import annotations

from collections.abc import Sequence

from mobman.benchmark.report.cells import CellRuns
from mobman.benchmark.report.table import Table
from mobman.benchmark.report.tables import metrics_table
from mobman.simulation.metrics import list_metrics

_MOST = 40_000  # entries of all tables


def metrics_tables(cells: Sequence[CellRuns], drawn: Sequence[CellRuns]) -> dict[str, Table]:
    """By the cell's name: of all cells, or, where these are too many, of those that are drawn."""
    known = len(list_metrics())
    size = {cell.name: known * (len(cell.runs) + len(cell.failures)) for cell in cells}
    chosen = list(cells)
    if sum(size.values()) > _MOST:
        chosen, left = [], _MOST
        for cell in {cell.name: cell for cell in drawn}.values():
            left -= size[cell.name]
            if left < 0:
                break
            chosen.append(cell)
    return {cell.name: metrics_table(cell) for cell in chosen}
