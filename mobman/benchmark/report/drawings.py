"""The figures of a report, by group and cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from mobman.benchmark.report.cells import Cell, Group
from mobman.benchmark.report.content import ReportedRun, ReportedSuite
from mobman.benchmark.report.figures import (
    auxiliary_error_figure,
    other_torques_figure,
    overview_figure,
    task_error_figure,
    torque_figure,
)
from mobman.benchmark.report.format import slug
from mobman.benchmark.report.style import Style
from mobman.benchmark.report.svg import Drawing, draw

_PAPERS_LAW = "tsm"


@dataclass(frozen=True)
class CellDrawings:
    """The figures of a robot and task in a scenario."""

    cell: Cell
    task_error: Drawing
    auxiliary_error: Drawing
    torque: Drawing
    torque_label: str
    """The controller whose torques :attr:`torque` shows."""
    other_torques: Drawing | None

    @property
    def all(self) -> list[Drawing]:
        """In the order in which they are shown."""
        found = [self.task_error, self.auxiliary_error, self.torque, self.other_torques]
        return [drawing for drawing in found if drawing is not None]


@dataclass(frozen=True)
class GroupDrawings:
    """The figures of a robot and task."""

    group: Group
    overview: Drawing | None
    cells: Sequence[CellDrawings]

    @property
    def all(self) -> list[Drawing]:
        """In the order in which they are shown."""
        found = [] if self.overview is None else [self.overview]
        return found + [drawing for cell in self.cells for drawing in cell.all]


@dataclass
class Draughtsman:
    """Draws, and gives each figure a name of its own."""

    suite: ReportedSuite
    styles: Mapping[str, Style]
    _used: set[str] = field(default_factory=set)

    def group(self, group: Group) -> GroupDrawings:
        """The figures of a group; none of cells without runs."""
        cells = [self._cell(cell) for cell in group.cells if cell.runs]
        overview = None
        if cells:
            overview = self._draw(
                f"{group.name} overview",
                f"Largest steady task error of each controller: {group.name}",
                lambda: overview_figure(group, self.styles),
            )
        return GroupDrawings(group, overview, cells)

    def _cell(self, cell: Cell) -> CellDrawings:
        runs = cell.first_seed
        shown = next((run for run in runs if _is_the_papers(run)), runs[0])
        others = [run for run in runs if run is not shown]
        return CellDrawings(
            cell,
            self._draw(
                f"{cell.name} task error",
                f"Norm of the task error against time, log axis: {cell.name}",
                lambda: task_error_figure(cell, self.suite, self.styles),
            ),
            self._draw(
                f"{cell.name} auxiliary error",
                f"Norm of the auxiliary error against time, log axis: {cell.name}",
                lambda: auxiliary_error_figure(cell, self.suite, self.styles),
            ),
            self._draw(
                f"{cell.name} torque",
                f"Torques of {shown.label} against time: {cell.name}",
                lambda: torque_figure(shown, self.suite),
            ),
            shown.label,
            self._draw(
                f"{cell.name} other torques",
                f"Torques of the other controllers against time: {cell.name}",
                lambda: other_torques_figure(others, self.suite),
            )
            if others
            else None,
        )

    def _draw(self, name: str, title: str, make: Callable[[], Figure]) -> Drawing:
        key = base = slug(name)
        again = 1
        while key in self._used:  # names that differ in punctuation only
            again += 1
            key = f"{base}-{again}"
        self._used.add(key)
        return draw(key, title, make)


def _is_the_papers(run: ReportedRun) -> bool:
    return run.record.controller == _PAPERS_LAW and not run.explicit
