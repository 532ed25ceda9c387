"""Writing the report."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mobman.benchmark.report.content import (
    FailedRun,
    ReportedRun,
    ReportedSuite,
    ReportFiles,
    UnusedFile,
)
from mobman.errors import MobmanError
from mobman.simulation.temporary import temporary_beside

if TYPE_CHECKING:
    from mobman.benchmark.report.cells import CellRuns

_FIGURES = "figures"
_MOST_METRICS = 40_000  # entries of all cells' metrics tables
_MOST_REPLAYS = 300  # rows
_MOST_ENDINGS = 2_000  # rows
_MOST_OVERVIEWS = 6  # groups with a figure each
# What GitHub still shows, and people still read:
_MARKDOWN_CELLS = 12
_MARKDOWN_ROWS = 60
_MARKDOWN_GROUPS = 12


@dataclass(frozen=True)
class Request:
    """What a report is to show that may be chosen."""

    cells: Sequence[str] = ()
    """Names of the cells to draw, with ``*`` and ``?``; by default all, or a selection of many."""


def write_report(
    folder: Path,
    suite: ReportedSuite,
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun] = (),
    unused: Sequence[UnusedFile] = (),
    request: Request | None = None,
) -> ReportFiles:
    """Write ``report.html``, ``report.md``, the figures of the latter and ``report.csv``.

    All is made before anything is written, and each file is there whole or not at all: a report that
    fails leaves the one before it as it was.

    Args:
        folder: Where the report goes; it is made if need be.
        suite: What the runs are of.
        runs: In the suite's order, which is the order of controllers and scenarios in the report.
        failures: Runs that gave no result.
        unused: Files that are not used, and why.
        request: What to show; the default suits any suite.

    Raises:
        MobmanError: If it cannot be written.
        UsageError: If the request names a cell that there is not.
    """
    folder = Path(folder)
    content = _content(suite, runs, failures, unused, request or Request())
    html, markdown = _render(content)
    figures = folder / _FIGURES
    shown = [*content["overall"].values(), *content["overviews"].values()]
    shown += [figure for cell in (*content["paper"], *content["few"]) for figure in cell.all]
    files = {
        figures / f"{figure.drawing.key}.svg": figure.drawing.file
        for figure in shown
        if figure is not None
    }
    result = ReportFiles(folder / "report.html", folder / "report.md", folder / "report.csv")
    texts = {result.csv: content["csv"], result.markdown: markdown, result.html: html}
    _write_all({**files, **texts})
    return result


def _content(
    suite: ReportedSuite,
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun],
    unused: Sequence[UnusedFile],
    request: Request,
) -> dict[str, Any]:
    """What the templates show."""
    # here, so that who merely imports this module does not wait for what it takes
    from mobman.benchmark.report import (
        cells,
        format,
        limitations,
        provenance,
        run_list,
        settings,
        standings_tables,
        summary,
        svg,
        tables,
    )
    from mobman.benchmark.report import overview_charts as charts
    from mobman.benchmark.report.drawings import Draughtsman, papers_cells
    from mobman.benchmark.report.leaderboard import leaderboard_of
    from mobman.benchmark.report.scores import field_of
    from mobman.benchmark.report.selection import select
    from mobman.benchmark.report.style import motor_looks, styles_of
    from mobman.simulation.metrics.metric import STEADY

    groups = cells.groups_of(runs, failures)
    labels = cells.labels_of(runs, failures)
    everywhere = [cell for group in groups for cell in group.cells]
    styles = styles_of(labels, runs, suite.tuned)
    field = field_of(groups)
    board = leaderboard_of(field, groups)
    draughtsman = Draughtsman(styles)
    compared = len(board.compared) > 1 and bool(field.cells)
    efforts = charts.EFFORTS if compared else ()
    prices = {name: charts.prices_of(field, board, name) for name in efforts}
    overall = {
        "leaderboard": draughtsman.figure(
            "leaderboard",
            charts.leaderboard_chart(board, styles) if compared else None,
            "The same, with 95 % intervals, on a log axis; dotted: 1e-4 m, below which a run can "
            "succeed; ×: failures are in the middle half.",
        ),
        "scenarios": draughtsman.figure(
            "scenarios",
            charts.scenarios_chart(field) if compared and len(field.cells) > 1 else None,
            "Steady |e^e| (m), the median over robots and tasks, of an even number the worse of the two "
            "in the middle; darker is worse; ×: half of them or more fail.",
        ),
        "periods": draughtsman.figure(
            "sampling periods",
            charts.periods_chart(groups, styles),
            "Steady |e^e| against the sampling period, the median over the scenarios that are at every "
            "one of these periods, of an even number the worse of the two in the middle; ×: half of "
            "them or more fail.",
        ),
        "profiles": draughtsman.figure(
            "profiles",
            charts.profiles_chart(field, styles) if compared else None,
            "Left: the share of cells in which a controller’s error is within a factor of the least "
            "of all controllers there; at 1, where it is the best. Right: the share of cells with an "
            "error of at most so much, with 95 % bands. A failure is within no factor and below no "
            "error. Higher is better.",
        ),
        "pareto": draughtsman.figure(
            "precision against effort",
            charts.pareto_chart(prices, styles) if compared else None,
            "Lower left is better; bars: 95 % intervals; grey: the front. Controllers that fail in "
            "half of the cells or more are not drawn.",
        ),
    }
    overviews = {
        group.name: draughtsman.figure(
            f"{group.name} overview",
            charts.overview_chart(group, styles) if group.labels else None,
            "The same, on a log axis; dotted: 1e-4 m, below which a run can succeed; ×: did not go "
            "to its end.",
        )
        for group in groups[:_MOST_OVERVIEWS]
        if len(group.cells) <= 4 * _MOST_OVERVIEWS and any(cell.runs for cell in group.cells)
    }
    paper = [] if request.cells else [draughtsman.whole(cell) for cell in papers_cells(groups)]
    selection = select(groups, request.cells)
    done = {item.cell.name for item in paper}
    rest = [cell for cell in selection.cells if cell.name not in done]
    drawn = list(draughtsman.cells(rest, selection.why))
    metrics = _metrics(everywhere, [*(item.cell for item in paper), *selection.cells])
    created = sorted({run.created for run in runs})
    endings = tables.endings_table(groups)
    replays = tables.replays_table(groups, _MOST_REPLAYS)
    looks = [*styles.values(), *motor_looks(40), *charts.EXTRA_LOOKS]
    tables_by_group = [(group, tables.summary_table(group)) for group in groups]
    return {
        "suite": suite,
        "asked": len(runs) + len(failures),
        "durations": format.span([cell.duration for cell in everywhere], 1.0, "s"),
        "periods": format.span([cell.dt for cell in everywhere], 1e3, "ms"),
        "wall_time": None if suite.seconds is None else format.duration(suite.seconds),
        "first": format.moment(created[0]) if created else "",
        "last": format.moment(created[-1]) if created else "",
        "written": format.moment(datetime.now(UTC).isoformat()),
        "steady": f"{100 * STEADY:g} %",
        "steady_rest": f"{100 * (1 - STEADY):g} %",
        "summary": summary.summary_lines(groups, runs, failures, field, board, suite.tuned),
        "styles": styles,
        "labels": labels,
        "look_style": svg.look_style(looks),
        "dark_look_style": svg.look_style(looks, dark=True),
        "chart_style": svg.STYLE,
        "light": svg.LIGHT,
        "dark": svg.DARK,
        "explicit": cells.unique([run.label for run in runs if run.explicit]),
        "groups": groups,
        "field": field,
        "lost": sum(standing.lost for standing in board.standings),
        "compared": compared,
        "leaderboard": standings_tables.leaderboard_table(board) if field.cells else None,
        "families": standings_tables.families_table(board) if board.families else None,
        "pairs": standings_tables.pairs_table(board.pairs) if board.pairs else None,
        "prices": standings_tables.prices_table(prices, charts.EFFORTS) if compared else None,
        "overall": overall,
        "scenarios_left_out": charts.scenarios_left_out(field),
        "overviews": overviews,
        "summary_tables": tables_by_group,
        "paper": paper,
        "drawn": drawn,
        "drawn_groups": [
            (name, [item for item in drawn if item.cell.group == name])
            for name in cells.unique([item.cell.group for item in drawn])
        ],
        "few": drawn[:_MARKDOWN_CELLS],
        "selection": selection,
        "metrics_tables": metrics,
        "all_metrics": len(metrics) == sum(bool(cell.runs or cell.failures) for cell in everywhere),
        "replays_table": replays,
        "all_replays": len(replays.rows) == sum(bool(run.command) for run in runs),
        "endings": _first(endings, _MOST_ENDINGS),
        "ended": len(endings.rows),
        "losses": _first(tables.losses_table(groups), _MOST_ENDINGS),
        "lost_runs": len(failures),
        "endings_by_reason": tables.endings_by_reason(groups),
        "unused": tables.unused_table([*unused, *draughtsman.unread]),
        "pending": sum(failure.pending for failure in failures),
        "saturation": tables.saturation_table(groups),
        "tuned": standings_tables.tuned_table(field, board, suite.tuned) if compared else None,
        "budgets": settings.unequal_budgets(suite.tuned),
        "settings": settings.settings_of(groups, suite.tuned),
        "tuning": settings.tuning_table(suite.tuned),
        "versions": provenance.versions_of(runs),
        "machines": provenance.machines_table(runs),
        "machine": provenance.machine_table(),
        "timing": tables.timing_table(groups),
        "definitions": tables.definitions_table(),
        "limitations": limitations.limitations_of(runs, tuned=bool(suite.tuned)),
        "csv": run_list.run_list(groups),
        "markdown_rows": _MARKDOWN_ROWS,
        "markdown_groups": _MARKDOWN_GROUPS,
    }


def _metrics(cells: Sequence[CellRuns], drawn: Sequence[CellRuns]) -> dict[str, Any]:
    """Tables of every metric, by the cell's name: of all cells, or of those that are drawn."""
    from mobman.benchmark.report.tables import metrics_table
    from mobman.simulation.metrics.metric import list_metrics

    known = len(list_metrics())
    size = {cell.name: known * (len(cell.runs) + len(cell.failures)) for cell in cells}
    chosen = list(cells)
    if sum(size.values()) > _MOST_METRICS:
        chosen, left = [], _MOST_METRICS
        for cell in {cell.name: cell for cell in drawn}.values():
            left -= size[cell.name]
            if left < 0:
                break
            chosen.append(cell)
    return {cell.name: metrics_table(cell) for cell in chosen}


def _first(table: Any, most: int) -> Any:
    """A table's first rows."""
    from dataclasses import replace

    return replace(table, rows=table.rows[:most])


def _render(content: Mapping[str, Any]) -> tuple[str, str]:
    """The report as HTML and as Markdown."""
    import jinja2

    from mobman.benchmark.report.format import html_text, markdown_text, slug
    from mobman.benchmark.report.html_table import html_table, swatch

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mobman.benchmark.report", "templates"),
        autoescape=jinja2.select_autoescape(enabled_extensions=("html.j2",)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(symbols=html_text, md=markdown_text, slug=slug, head=_first)
    environment.filters.update(table=html_table, swatch=swatch)
    return (
        environment.get_template("report.html.j2").render(content),
        environment.get_template("report.md.j2").render(content, figures=_FIGURES),
    )


def _write_all(files: Mapping[Path, str]) -> None:
    """Write files to temporary names, then give them their own."""
    temporary = {path: temporary_beside(path) for path in files}
    try:
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary[path].write_text(text, encoding="utf-8")
        for path in files:
            os.replace(temporary[path], path)
    except OSError as error:
        reason = error.strerror or error
        raise MobmanError(
            f"cannot write the report {error.filename}: {reason}; another folder can be given with -o"
        ) from error
    finally:
        _remove(temporary.values())


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError:  # its folder could not be made: there is nothing to remove
            continue
