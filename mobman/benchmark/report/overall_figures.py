"""The figures over all cells, and those over the cells of a group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mobman.benchmark.report.drawings import Draughtsman, Figure
from mobman.benchmark.report.evaluation import Evaluation
from mobman.benchmark.report.overview_charts import (
    Price,
    leaderboard_chart,
    overview_chart,
    pareto_chart,
    periods_chart,
    profiles_chart,
    scenarios_chart,
)

_MOST_OVERVIEWS = 6  # groups with a figure each


def overall_figures(
    found: Evaluation, prices: Mapping[str, Sequence[Price]], draughtsman: Draughtsman
) -> dict[str, Figure | None]:
    """The figures over all cells, by their name in the templates; None where there is nothing to draw.

    Args:
        found: What the runs say.
        prices: Of the controllers, by metric of effort.
        draughtsman: Who draws them.
    """
    compared, field, styles = found.compared, found.field, found.styles
    return {
        "leaderboard": draughtsman.figure(
            "leaderboard",
            leaderboard_chart(found.board, styles) if compared else None,
            "The same, with 95 % intervals, on a log axis; dotted: 1e-4 m, below which a run can "
            "succeed; ×: failures are in the middle half.",
        ),
        "scenarios": draughtsman.figure(
            "scenarios",
            scenarios_chart(field) if compared and len(field.cells) > 1 else None,
            "Steady |e^e| (m), the median over robots and tasks, of an even number the worse of the two "
            "in the middle; darker is worse; ×: half of them or more fail.",
        ),
        "periods": draughtsman.figure(
            "sampling periods",
            periods_chart(found.groups, styles),
            "Steady |e^e| against the sampling period, the median over the scenarios that are at every "
            "one of these periods, of an even number the worse of the two in the middle; ×: half of "
            "them or more fail.",
        ),
        "profiles": draughtsman.figure(
            "profiles",
            profiles_chart(field, styles) if compared else None,
            "Left: the share of cells in which a controller’s error is within a factor of the least "
            "of all controllers there; at 1, where it is the best. Right: the share of cells with an "
            "error of at most so much, with 95 % bands. A failure is within no factor and below no "
            "error. Higher is better.",
        ),
        "pareto": draughtsman.figure(
            "precision against effort",
            pareto_chart(prices, styles) if compared else None,
            "Lower left is better; bars: 95 % intervals; grey: the front. Controllers that fail in "
            "half of the cells or more are not drawn.",
        ),
    }


def overview_figures(found: Evaluation, draughtsman: Draughtsman) -> dict[str, Figure | None]:
    """A figure of each of the first groups, by the group's name; none of a group of many cells."""
    return {
        group.name: draughtsman.figure(
            f"{group.name} overview",
            overview_chart(group, found.styles),
            "The same, on a log axis; dotted: 1e-4 m, below which a run can succeed; ×: did not go "
            "to its end.",
        )
        for group in found.groups[:_MOST_OVERVIEWS]
        if len(group.cells) <= 4 * _MOST_OVERVIEWS and any(cell.runs for cell in group.cells)
    }
