"""The figures of a report, each with a name of its own, within a number of bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from mobman.benchmark.report.cells import NOMINAL, CellRuns, Group
from mobman.benchmark.report.chart import Chart, Look
from mobman.benchmark.report.content import UnusedFile
from mobman.benchmark.report.curves import CellCurves, RunCurves, read_curves
from mobman.benchmark.report.format import slug
from mobman.benchmark.report.svg.draw import draw
from mobman.benchmark.report.svg.drawing import Drawing
from mobman.benchmark.report.time_charts import (
    auxiliary_error_chart,
    compact_chart,
    other_torques_chart,
    task_error_chart,
    torque_chart,
)

PAPERS_LAW = "tsm"
PAPERS_TASK = "paper"

_BUDGET = 7_000_000  # bytes of all cells' figures
_WHOLE = 90_000  # bytes that the figures of a cell take if they are drawn in full
_COLUMNS = 400  # of a curve drawn in full: more cannot be seen
_MOTOR_COLUMNS = 250
_POINT = 9.0  # bytes of a point, on average, before straight parts lose theirs
_FEWEST = 24  # columns


@dataclass(frozen=True)
class Figure:
    """A drawing with what stands beneath it."""

    drawing: Drawing
    caption: str


@dataclass(frozen=True)
class CellFigures:
    """The figures of a cell."""

    cell: CellRuns
    figures: list[Figure]
    more: list[Figure] = field(default_factory=list)
    """Shown on demand."""
    why: str = ""
    """Why it was selected."""

    @property
    def all(self) -> list[Figure]:
        """In the order in which they are shown."""
        return [*self.figures, *self.more]


@dataclass
class Draughtsman:
    """Draws, and gives each figure a name of its own."""

    styles: Mapping[str, Look]
    unread: list[UnusedFile] = field(default_factory=list)
    """Files whose samples could not be read on the way."""
    looks: dict[str, Look] = field(default_factory=dict)
    """That the figures use, by key."""
    _used: set[str] = field(default_factory=set)

    def figure(self, name: str, chart: Chart | None, caption: str) -> Figure | None:
        """A figure of all runs; None of None."""
        return None if chart is None else self._figure(name, chart, caption)

    def cells(self, cells: Sequence[CellRuns], why: Mapping[str, str]) -> Iterator[CellFigures]:
        """The figures of cells, one after the other: in full, or small where they are many."""
        left = _BUDGET
        whole = len(cells) * _WHOLE <= _BUDGET
        for number, cell in enumerate(cells):
            share = left / (len(cells) - number)
            if whole:
                found = self.whole(cell)
            else:
                curves = 3 * max(len(cell.first_seed), 1)
                columns = int(share / (2.0 * _POINT * curves))
                found = self._small(cell, max(_FEWEST, min(columns, _COLUMNS // 2)))
            left -= sum(len(figure.drawing.body) for figure in found.all)
            yield CellFigures(cell, found.figures, found.more, why.get(cell.name, ""))

    def whole(self, cell: CellRuns) -> CellFigures:
        """The paper's Figs. 2 to 4 of a cell, and the torques of the other controllers."""
        curves = self._read(cell, _COLUMNS, _MOTOR_COLUMNS)
        if not curves.runs:
            return CellFigures(cell, [])
        shown = next((run for run in curves.runs if is_the_papers(run)), curves.runs[0])
        others = [run for run in curves.runs if run is not shown]
        number = "Fig. {}. " if cell.task == PAPERS_TASK else "As Fig. {}. "
        figures = [
            self._figure(
                f"{cell.name} task error",
                task_error_chart(curves, self.styles),
                number.format(2) + "Euclidean norm of the task errors e^e. Dotted: 1e-4 m, the "
                "accuracy that the paper asks for.",
            ),
            self._figure(
                f"{cell.name} auxiliary error",
                auxiliary_error_chart(curves, self.styles),
                number.format(3) + "Euclidean norm of the auxiliary errors e^a: how far from "
                "(locally) optimal for the criterion.",
            ),
            self._figure(
                f"{cell.name} torque",
                torque_chart(shown),
                number.format(4) + f"Torques v of {shown.run.label}; alpha_i: motors of the "
                "platform, in its quasi-velocities.",
            ),
        ]
        more = []
        if others:
            more.append(
                self._figure(
                    f"{cell.name} other torques",
                    other_torques_chart(others),
                    "Torques v of the other controllers, each panel on its own scale; a run that "
                    "diverged is cut off where it leaves the scale of what came before.",
                )
            )
        return CellFigures(cell, figures, more)

    def _small(self, cell: CellRuns, columns: int) -> CellFigures:
        curves = self._read(cell, columns, 0)
        if not curves.runs:
            return CellFigures(cell, [])
        figure = self._figure(cell.name, compact_chart(curves, self.styles), "")
        return CellFigures(cell, [figure])

    def _read(self, cell: CellRuns, columns: int, motor_columns: int) -> CellCurves:
        curves = read_curves(cell, columns, motor_columns)
        self.unread += curves.unread
        return curves

    def _figure(self, name: str, chart: Chart, caption: str) -> Figure:
        key = base = slug(name)
        again = 1
        while key in self._used:  # names that differ in punctuation only
            again += 1
            key = f"{base}-{again}"
        self._used.add(key)
        drawing = draw(key, chart)
        self.looks |= {look.key: look for look in drawing.looks}
        return Figure(drawing, caption)


def papers_cells(groups: Sequence[Group]) -> list[CellRuns]:
    """The cells whose figures are the paper's: its task where nothing is changed."""
    return [
        cell
        for group in groups
        for cell in group.cells
        if cell.task == PAPERS_TASK and cell.scenario == NOMINAL and cell.runs
    ][:1]


def is_the_papers(run: RunCurves) -> bool:
    """Whether a run is of the paper's law as this framework samples it."""
    return run.run.law == PAPERS_LAW and not run.run.explicit
