"""Runs by what they are compared in: robot and task, then scenario."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from mobman.benchmark.report.content import FailedRun, ReportedRun
from mobman.simulation.run_spec import Cell

NOMINAL = "nominal"

T = TypeVar("T")


@dataclass(frozen=True)
class CellRuns:
    """The runs of one cell."""

    cell: Cell
    variant: str
    """The scenario; with the sampling period and the duration where there are several of them."""
    runs: tuple[ReportedRun, ...]
    failures: tuple[FailedRun, ...]

    @property
    def robot(self) -> str:
        """Its robot."""
        return self.cell.robot

    @property
    def task(self) -> str:
        """Its task."""
        return self.cell.task

    @property
    def scenario(self) -> str:
        """Its scenario."""
        return self.cell.scenario

    @property
    def dt(self) -> float:
        """Its sampling period (s)."""
        return self.cell.dt

    @property
    def duration(self) -> float:
        """Of each of its runs (s)."""
        return self.cell.duration

    @property
    def name(self) -> str:
        """For headings, unique in a report."""
        return f"{self.group}, {self.variant}"

    @property
    def group(self) -> str:
        """The name of its group."""
        return f"{self.robot}, {self.task}"

    @property
    def family(self) -> str:
        """Of its scenario."""
        families = [run.family for run in self.runs] + [lost.family for lost in self.failures]
        return families[0] or self.scenario

    @cached_property
    def seeds(self) -> list[int]:
        """Of its runs, in the suite's order."""
        return unique([run.seed for run in self.runs])

    @property
    def first_seed(self) -> list[ReportedRun]:
        """The runs that figures show: one for each label."""
        return [run for run in self.runs if run.seed == self.seeds[0]]

    @cached_property
    def _runs(self) -> dict[str, list[ReportedRun]]:
        found = defaultdict(list)
        for run in self.runs:
            found[run.label].append(run)
        return found

    @cached_property
    def _failures(self) -> dict[str, list[FailedRun]]:
        found = defaultdict(list)
        for failure in self.failures:
            found[failure.label].append(failure)
        return found

    @property
    def labels(self) -> list[str]:
        """That were asked for."""
        return labels_of(self.runs, self.failures)

    def of(self, label: str) -> list[ReportedRun]:
        """The runs of one label."""
        return self._runs.get(label, [])

    def failures_of(self, label: str) -> list[FailedRun]:
        """The runs of one label without a result, those that were not done yet among them."""
        return self._failures.get(label, [])

    def pending(self, label: str) -> bool:
        """Whether a run of one label was not done yet, so that there is nothing to say of it."""
        return any(failure.pending for failure in self.failures_of(label))


@dataclass(frozen=True)
class Group:
    """A robot at a task, in all scenarios; the nominal one first."""

    robot: str
    task: str
    cells: tuple[CellRuns, ...]

    @property
    def name(self) -> str:
        """For headings."""
        return f"{self.robot}, {self.task}"

    @cached_property
    def labels(self) -> list[str]:
        """Of its runs and failures, in the suite's order."""
        return unique([label for cell in self.cells for label in cell.labels])


def groups_of(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[Group]:
    """The runs in their groups and cells, in the order in which they first appear."""
    found: dict[Cell, tuple[list[ReportedRun], list[FailedRun]]] = {}
    for run in runs:
        found.setdefault(run.cell, ([], []))[0].append(run)
    for failure in failures:
        found.setdefault(failure.cell, ([], []))[1].append(failure)
    groups: dict[tuple[str, str], list[CellRuns]] = {}
    variants = _variants(list(found))
    for cell, (own, lost) in found.items():
        whole = CellRuns(cell, variants[cell], tuple(own), tuple(lost))
        groups.setdefault((cell.robot, cell.task), []).append(whole)
    for cells in groups.values():
        # nominal first, the other scenarios as they come; each from the shortest period on
        order = unique([cell.scenario for cell in cells])
        cells.sort(key=lambda c: (c.scenario != NOMINAL, order.index(c.scenario), c.dt, c.duration))
    return [Group(robot, task, tuple(cells)) for (robot, task), cells in groups.items()]


def labels_of(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[str]:
    """All labels, in the order in which they first appear."""
    return unique([run.label for run in runs] + [failure.label for failure in failures])


def unique(items: Sequence[T]) -> list[T]:
    """Without repetitions, order kept."""
    return list(dict.fromkeys(items))


def _variants(cells: Sequence[Cell]) -> dict[Cell, str]:
    """Names that tell apart what one robot does at one task."""
    siblings = defaultdict(list)
    for cell in cells:
        siblings[cell.robot, cell.task, cell.scenario].append(cell)
    names = {}
    for cell in cells:
        others = siblings[cell.robot, cell.task, cell.scenario]
        parts = [cell.scenario]
        if len({other.dt for other in others}) > 1:
            parts.append(f"dt {1e3 * cell.dt:g} ms")
        if len({other.duration for other in others}) > 1:
            parts.append(f"{cell.duration:g} s")
        names[cell] = ", ".join(parts)
    return names
