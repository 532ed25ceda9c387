"""Runs by what they are compared in: robot and task, then scenario."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from mobman.benchmark.report.content import FailedRun, Place, ReportedRun

NOMINAL = "nominal"

T = TypeVar("T")


@dataclass(frozen=True)
class Cell:
    """The runs of one robot, task, scenario, sampling period and duration, which are compared."""

    place: Place
    variant: str
    """The scenario; with the sampling period and the duration where there are several of them."""
    runs: tuple[ReportedRun, ...]
    failures: tuple[FailedRun, ...]

    @property
    def robot(self) -> str:
        """Its robot."""
        return self.place.robot

    @property
    def task(self) -> str:
        """Its task."""
        return self.place.task

    @property
    def scenario(self) -> str:
        """Its scenario."""
        return self.place.scenario

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
        """The failures of one label."""
        return self._failures.get(label, [])


@dataclass(frozen=True)
class Group:
    """A robot at a task, in all scenarios; the nominal one first."""

    robot: str
    task: str
    cells: tuple[Cell, ...]

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
    found: dict[Place, tuple[list[ReportedRun], list[FailedRun]]] = {}
    for run in runs:
        found.setdefault(run.place, ([], []))[0].append(run)
    for failure in failures:
        found.setdefault(failure.place, ([], []))[1].append(failure)
    groups: dict[tuple[str, str], list[Cell]] = {}
    variants = _variants(list(found))
    for place, (own, lost) in found.items():
        cell = Cell(place, variants[place], tuple(own), tuple(lost))
        groups.setdefault((place.robot, place.task), []).append(cell)
    for cells in groups.values():
        cells.sort(key=lambda cell: cell.scenario != NOMINAL)  # stable: the rest as they come
    return [Group(robot, task, tuple(cells)) for (robot, task), cells in groups.items()]


def labels_of(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[str]:
    """All labels, in the order in which they first appear."""
    return unique([run.label for run in runs] + [failure.label for failure in failures])


def unique(items: Sequence[T]) -> list[T]:
    """Without repetitions, order kept."""
    return list(dict.fromkeys(items))


def _variants(places: Sequence[Place]) -> dict[Place, str]:
    """Names that tell apart what one robot does at one task."""
    siblings = defaultdict(list)
    for place in places:
        siblings[place.robot, place.task, place.scenario].append(place)
    names = {}
    for place in places:
        others = siblings[place.robot, place.task, place.scenario]
        parts = [place.scenario]
        if len({other.dt for other in others}) > 1:
            parts.append(f"dt {1e3 * place.dt:g} ms")
        if len({other.duration for other in others}) > 1:
            parts.append(f"{place.duration:g} s")
        names[place] = ", ".join(parts)
    return names
