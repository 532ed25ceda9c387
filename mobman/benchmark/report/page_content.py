"""What the templates show, by the names that they use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from mobman.benchmark.report import (
    format,
    limitations,
    provenance,
    run_list,
    settings,
    standings_tables,
    summary,
    tables,
)
from mobman.benchmark.report.cells import unique
from mobman.benchmark.report.content import FailedRun, ReportedRun, ReportedSuite, UnusedFile
from mobman.benchmark.report.drawings import Draughtsman
from mobman.benchmark.report.drawn_cells import DrawnCells, draw_cells
from mobman.benchmark.report.evaluation import Evaluation, evaluate
from mobman.benchmark.report.metrics_tables import metrics_tables
from mobman.benchmark.report.overall_figures import overall_figures, overview_figures
from mobman.benchmark.report.overview_charts import (
    EFFORTS,
    Price,
    prices_of,
    scenarios_left_out,
)
from mobman.benchmark.report.svg.style_sheet import DARK, LIGHT, STYLE, look_style
from mobman.benchmark.report.table import first_rows
from mobman.simulation.metrics import STEADY

_MOST_REPLAYS = 300  # rows
_MOST_ENDINGS = 2_000  # rows
# What GitHub still shows, and people still read:
_MARKDOWN_CELLS = 12
_MARKDOWN_ROWS = 60
_MARKDOWN_GROUPS = 12


def page_content(
    suite: ReportedSuite,
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun],
    unused: Sequence[UnusedFile],
    patterns: Sequence[str],
) -> dict[str, Any]:
    """What the templates show.

    Args:
        suite: What the runs are of.
        runs: In the suite's order.
        failures: Runs that gave no result.
        unused: Files that are not used, and why.
        patterns: Names of the cells to draw, with ``*`` and ``?``; see :func:`.selection.select`.

    Raises:
        UsageError: If a pattern fits no cell.
    """
    found = evaluate(suite, runs, failures)
    prices = {name: prices_of(found.field, found.board, name) for name in EFFORTS if found.compared}
    draughtsman = Draughtsman(found.styles)
    # in this order: of figures that would have one name, the first has it
    overall = overall_figures(found, prices, draughtsman)
    overviews = overview_figures(found, draughtsman)
    drawn = draw_cells(found.groups, patterns, draughtsman)
    return {
        **_head(found),
        **_looks(found, draughtsman),
        **_comparison(found, prices),
        "overall": overall,
        "overviews": overviews,
        **_cells(found, drawn),
        **_endings(found),
        **_gains(found),
        **_origin(found),
        "unused": tables.unused_table([*unused, *draughtsman.unread]),
        "limitations": limitations.limitations_of(runs, tuned=bool(suite.tuned)),
        "definitions": tables.definitions_table(),
        "csv": run_list.run_list(found.groups),
        "markdown_rows": _MARKDOWN_ROWS,
        "markdown_groups": _MARKDOWN_GROUPS,
    }


def _head(found: Evaluation) -> dict[str, Any]:
    """What the report is of, and the findings."""
    suite, runs, failures = found.suite, found.runs, found.failures
    created = sorted({run.created for run in runs})
    return {
        "suite": suite,
        "asked": len(runs) + len(failures),
        "durations": format.span([cell.duration for cell in found.cells], 1.0, "s"),
        "periods": format.span([cell.dt for cell in found.cells], 1e3, "ms"),
        "wall_time": None if suite.seconds is None else format.duration(suite.seconds),
        "first": format.moment(created[0]) if created else "",
        "last": format.moment(created[-1]) if created else "",
        "written": format.moment(datetime.now(UTC).isoformat()),
        "summary": summary.summary_lines(
            found.groups, runs, failures, found.field, found.board, suite.tuned
        ),
        "pending": sum(failure.pending for failure in failures),
    }


def _looks(found: Evaluation, draughtsman: Draughtsman) -> dict[str, Any]:
    """Colours and style sheets."""
    looks = [*{**{look.key: look for look in found.styles.values()}, **draughtsman.looks}.values()]
    return {
        "styles": found.styles,
        "look_style": look_style(looks),
        "dark_look_style": look_style(looks, dark=True),
        "chart_style": STYLE,
        "light": LIGHT,
        "dark": DARK,
        "explicit": unique([run.label for run in found.runs if run.explicit]),
    }


def _comparison(found: Evaluation, prices: Mapping[str, Sequence[Price]]) -> dict[str, Any]:
    """Who is ahead, over all cells."""
    field, board, tuned = found.field, found.board, found.suite.tuned
    return {
        "field": field,
        "compared": found.compared,
        "lost": sum(standing.lost for standing in board.standings),
        "leaderboard": standings_tables.leaderboard_table(board) if field.cells else None,
        "families": standings_tables.families_table(board) if board.families else None,
        "pairs": standings_tables.pairs_table(board.pairs) if board.pairs else None,
        "prices": standings_tables.prices_table(prices, EFFORTS) if found.compared else None,
        "tuned": standings_tables.tuned_table(field, board, tuned) if found.compared else None,
        "scenarios_left_out": scenarios_left_out(field),
    }


def _cells(found: Evaluation, drawn: DrawnCells) -> dict[str, Any]:
    """Cell by cell: tables of all, figures of some."""
    metrics = metrics_tables(found.cells, drawn.cells)
    replays = tables.replays_table(found.groups, _MOST_REPLAYS)
    return {
        "steady": f"{100 * STEADY:g} %",
        "steady_rest": f"{100 * (1 - STEADY):g} %",
        "groups": found.groups,
        "summary_tables": [(group, tables.summary_table(group)) for group in found.groups],
        "paper": drawn.paper,
        "drawn": drawn.others,
        "drawn_groups": [
            (name, [item for item in drawn.others if item.cell.group == name])
            for name in unique([item.cell.group for item in drawn.others])
        ],
        "few": drawn.others[:_MARKDOWN_CELLS],
        "selection": drawn.selection,
        "metrics_tables": metrics,
        "all_metrics": len(metrics)
        == sum(bool(cell.runs or cell.failures) for cell in found.cells),
        "replays_table": replays,
        "all_replays": len(replays.rows) == sum(bool(run.command) for run in found.runs),
    }


def _endings(found: Evaluation) -> dict[str, Any]:
    """Runs that ended early or have no result, and torques that were cut."""
    endings = tables.endings_table(found.groups)
    return {
        "endings": first_rows(endings, _MOST_ENDINGS),
        "ended": len(endings.rows),
        "endings_by_reason": tables.endings_by_reason(found.groups),
        "losses": first_rows(tables.losses_table(found.groups), _MOST_ENDINGS),
        "lost_runs": len(found.failures),
        "saturation": tables.saturation_table(found.groups),
    }


def _gains(found: Evaluation) -> dict[str, Any]:
    """The settings in force, and how they were found."""
    tuned = found.suite.tuned
    return {
        "settings": settings.settings_of(found.groups, tuned),
        "tuning": settings.tuning_table(tuned),
        "budgets": settings.unequal_budgets(tuned),
    }


def _origin(found: Evaluation) -> dict[str, Any]:
    """What made the results, and how fast."""
    return {
        "versions": provenance.versions_of(found.runs),
        "machines": provenance.machines_table(found.runs),
        "machine": provenance.machine_table(),
        "timing": tables.timing_table(found.groups),
    }
