"""Runs by what they are compared in: robot and task, then scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from mobman.benchmark.report.content import FailedRun, ReportedRun

NOMINAL = "nominal"

T = TypeVar("T")


@dataclass(frozen=True)
class Cell:
    """The runs of one robot, task and scenario: those that are compared with each other."""

    robot: str
    task: str
    scenario: str
    runs: tuple[ReportedRun, ...]
    failures: tuple[FailedRun, ...]

    @property
    def name(self) -> str:
        """For headings."""
        return f"{self.robot}, {self.task}, {self.scenario}"

    @property
    def seeds(self) -> list[int]:
        """Of its runs, in the suite's order."""
        return unique([run.record.seed for run in self.runs])

    @property
    def first_seed(self) -> list[ReportedRun]:
        """The runs that figures show: one for each label."""
        return [run for run in self.runs if run.record.seed == self.seeds[0]]

    def of(self, label: str) -> list[ReportedRun]:
        """The runs of one label."""
        return [run for run in self.runs if run.label == label]

    def failures_of(self, label: str) -> list[FailedRun]:
        """The failures of one label."""
        return [failure for failure in self.failures if failure.label == label]


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

    @property
    def labels(self) -> list[str]:
        """Of its runs and failures, in the suite's order."""
        found = [labels_of(cell.runs, cell.failures) for cell in self.cells]
        return unique([label for labels in found for label in labels])


def groups_of(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[Group]:
    """The runs in their groups and cells, in the order in which they first appear."""
    places = [(run.record.robot, run.record.task, run.record.scenario) for run in runs]
    lost = [(failure.robot, failure.task, failure.scenario) for failure in failures]
    groups = []
    for robot, task in unique([place[:2] for place in (*places, *lost)]):
        scenarios = unique([place[2] for place in (*places, *lost) if place[:2] == (robot, task)])
        scenarios.sort(key=lambda scenario: scenario != NOMINAL)  # stable: the rest as they come
        cells = tuple(
            Cell(
                robot,
                task,
                scenario,
                tuple(
                    run
                    for run, place in zip(runs, places, strict=True)
                    if place == (robot, task, scenario)
                ),
                tuple(
                    failure
                    for failure, place in zip(failures, lost, strict=True)
                    if place == (robot, task, scenario)
                ),
            )
            for scenario in scenarios
        )
        groups.append(Group(robot, task, cells))
    return groups


def labels_of(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[str]:
    """All labels, in the order in which they first appear."""
    return unique([run.label for run in runs] + [failure.label for failure in failures])


def unique(items: Sequence[T]) -> list[T]:
    """Without repetitions, order kept."""
    return list(dict.fromkeys(items))
