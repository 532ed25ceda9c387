"""What a report is about: runs in their cells, and what they say of the controllers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mobman.benchmark.report.cells import CellRuns, Group, groups_of, labels_of
from mobman.benchmark.report.chart import Look
from mobman.benchmark.report.content import FailedRun, ReportedRun, ReportedSuite
from mobman.benchmark.report.leaderboard import Leaderboard, leaderboard_of
from mobman.benchmark.report.scores import Field, field_of
from mobman.benchmark.report.style import styles_of


@dataclass(frozen=True)
class Evaluation:
    """The runs of a suite, grouped, scored and ranked."""

    suite: ReportedSuite
    runs: Sequence[ReportedRun]
    failures: Sequence[FailedRun]
    """Runs that gave no result."""
    groups: list[Group]
    styles: dict[str, Look]
    """Of the controllers, by label."""
    field: Field
    board: Leaderboard

    @property
    def cells(self) -> list[CellRuns]:
        """Of all groups."""
        return [cell for group in self.groups for cell in group.cells]

    @property
    def compared(self) -> bool:
        """Whether there are controllers to compare, and cells to compare them in."""
        return len(self.board.compared) > 1 and bool(self.field.cells)


def evaluate(
    suite: ReportedSuite, runs: Sequence[ReportedRun], failures: Sequence[FailedRun]
) -> Evaluation:
    """Group, score and rank the runs of a suite.

    Args:
        suite: What the runs are of.
        runs: In the suite's order.
        failures: Runs that gave no result.
    """
    groups = groups_of(runs, failures)
    styles = styles_of(labels_of(runs, failures), runs, suite.tuned)
    field = field_of(groups)
    return Evaluation(suite, runs, failures, groups, styles, field, leaderboard_of(field, groups))
