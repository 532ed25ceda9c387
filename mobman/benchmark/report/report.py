"""From a folder of results to its report: HTML, Markdown, CSV and LaTeX."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from mobman.benchmark.report import charts, findings, format, gains, tables
from mobman.benchmark.report.data import DONE, NOT_RUN, Results, WriteReplay, csv_of, read_results
from mobman.benchmark.report.standings import EFFORTS, board_of, prices_of, select
from mobman.benchmark.store import Store
from mobman.controllers.protocol import INFORMATION
from mobman.errors import MobmanError
from mobman.figures import files
from mobman.figures.looks import Look
from mobman.files import check_within, write_all
from mobman.simulation.metrics import STEADY, list_metrics

_FIGURES = "figures"
_BUDGET = 8_000_000  # bytes of all cells' figures
_FULL = 400, 250  # columns of errors and of torques of a cell that is drawn in full
_MOST_OVERVIEWS = 6  # groups with a figure each
_MOST_METRICS = 40_000  # entries of all tables of metrics
_MOST_REPLAYS = 300  # rows
_MOST_ENDINGS = 2_000  # rows
_MOST_ROWS = 12  # of a table in Markdown


class ReportFiles(NamedTuple):
    """Paths of a report, and its first table."""

    html: Path
    markdown: Path
    csv: Path
    leaderboard: tables.Table | None  # None if no cell is complete


def report_on(
    folder: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    cells: Sequence[str] = (),
    latex: str | os.PathLike[str] | None = None,
    how: files.Print | None = None,
    write_replay: WriteReplay | None = None,
) -> ReportFiles:
    """Write the report of a folder of results, and its index.

    Args:
        folder: The folder.
        output: Where the report goes; into the folder by default. With another one, nothing is written
            into the folder, so that it may be read-only.
        cells: Names of the cells to draw, ``"ROBOT, TASK, SCENARIO"``, with ``*`` and ``?``; by
            default all of them, or a selection where they are many.
        latex: A folder for LaTeX tables and vector figures; none by default. The errors and torques
            are those of the first of ``cells``, or of the suite's first cell.
        how: Column, font and its size of LaTeX figures.
        write_replay: Writes the page ``replays/RUN_ID.html`` of a run, at its instant of failure if
            it ended early; by default none is written, and those that are there are linked if they
            are no older than their records.

    Runs whose record is missing or unreadable are listed with the reason; none is dropped.

    Raises:
        MobmanError: If the folder holds no results at all, or the report cannot be written.
        UsageError: If there is no such cell.
    """
    store = Store(folder)
    place = store.folder if output is None else Path(output)
    results = read_results(store, place, write_replay)
    written = write_report(place, results, cells)
    if latex is not None:
        from mobman.benchmark.report.latex import write_latex

        write_latex(Path(latex), results, cells, how)
    if output is None:
        store.rebuild_index()  # a folder of unknown origin may hold links to anywhere
    return written


def write_report(folder: Path, results: Results, cells: Sequence[str] = ()) -> ReportFiles:
    """Write ``report.html``, ``report.md``, the figures of the latter and ``report.csv``.

    All is made before anything is written, and each file is there whole or not at all: a report that
    fails leaves the one before it as it was.

    For arguments and errors see :func:`report_on`.
    """
    content = _content(results, cells)
    shown = [content["leaderboard_figure"], *content["paper_figures"][:1]]
    pictures = {figure.name: figure for figure in shown if figure is not None}
    environment = format.environment()
    html = environment.get_template("report.html.j2").render(content)
    markdown = environment.get_template("report.md.j2").render(
        content, pictures=list(pictures.values())
    )
    paths = [folder / f"report.{suffix}" for suffix in ("html", "md", "csv")]
    contents = {
        folder / _FIGURES / f"{format.slug(name)}.svg": files.drawn(files.beside(f.charts), "svg")
        for name, f in pictures.items()
    }
    for path, text in zip(paths, (html, markdown, csv_of(results)), strict=True):
        contents[path] = text.encode("utf-8", "backslashreplace")
    check_within(folder / _FIGURES, folder)
    try:
        write_all(contents)
    except MobmanError as error:
        raise MobmanError(f"{error}; another folder can be given with -o") from error
    return ReportFiles(paths[0], paths[1], paths[2], content["leaderboard"])


def _content(results: Results, patterns: Sequence[str]) -> dict[str, Any]:
    """Collect the content of the templates, by the names that they use."""
    board, looks = board_of(results), charts.looks_for(results)
    selection = select(results, patterns)
    runs, cells = results.runs, results.cells
    compared = board.compares
    paper = None if patterns else charts.papers_cell(results)
    drawn = _drawn(results, looks, selection.cells, paper)
    metrics = _metrics_tables(results, [*drawn])
    replays = tables.replays_table(results, _MOST_REPLAYS)
    heat = charts.heat_map(results, board, "case", "scenarios") if compared else (None, 0)
    several = compared and cells.group.loc[board.cells].nunique() > 1
    created = sorted({moment for moment in runs.created if moment})
    versions, warning = tables.versions_table(results)
    summary = findings.summary_lines(results, board)
    sweeps = {
        "Sampling periods": charts.periods_figure(results, looks),
        "Sensitivity": charts.sensitivity_figure(results, looks),
    }
    return {
        "results": results,
        "board": board,
        "looks": looks,
        # for what stands in one place of one template
        "charts": charts,
        "tables": tables,
        "gains": gains,
        # the head
        "asked": len(runs),
        "durations": format.span(list(cells.duration), 1.0, "s") if len(cells) else "",
        "periods": format.span(list(cells.dt), 1e3, "ms") if len(cells) else "",
        "wall_time": "" if results.seconds is None else format.duration(results.seconds),
        "first": format.moment(created[0]) if created else "",
        "last": format.moment(created[-1]) if created else "",
        "written": format.moment(datetime.now(UTC).isoformat()),
        "first_sentences": findings.first_sentences(summary),
        "summary": summary,
        "pending": int((runs.state == NOT_RUN).sum()),
        "lost": sum(standing.lost for standing in board.ranked),
        # over all cells
        "prices": {name: prices_of(results, board, name) for name in EFFORTS if compared},
        "leaderboard": tables.leaderboard_table(board) if len(board.cells) else None,
        "information": tables.information_table(results, board) if len(board.cells) else None,
        "information_of": INFORMATION,
        "leaderboard_figure": charts.leaderboard_figure(board, looks) if compared else None,
        "tuned": tables.tuned_table(results, board) if compared else None,
        "scenarios": heat[0] if len(board.cells) > 1 else None,
        "scenarios_left_out": heat[1],
        "robots": charts.heat_map(results, board, "group", "robots")[0] if several else None,
        "sweeps": {title: figure for title, figure in sweeps.items() if figure is not None},
        # cell by cell
        "steady": f"{100 * STEADY:g} %",
        "steady_rest": f"{100 * (1 - STEADY):g} %",
        "summary_tables": {group: tables.summary_table(results, group) for group in results.groups},
        "overviews": _overviews(results, looks),
        "explicit": list(dict.fromkeys(runs.label[runs.explicit])),
        "paper": paper,
        "paper_figures": [] if paper is None else drawn[paper],
        "drawn": {cell: drawn[cell] for cell in selection.cells if cell != paper},
        "selection": selection,
        "seeds": runs.groupby("cell").seed.nunique(),
        "metrics_tables": metrics,
        "all_metrics": len(metrics) == len(cells),
        "replays": replays,
        "all_replays": len(replays.rows) == int((runs.command != "").sum()),
        # what failed, and what made the results
        "endings": tables.endings_table(results),
        "losses": tables.losses_table(results),
        "most_endings": _MOST_ENDINGS,
        "endings_by_reason": tables.endings_by_reason(results),
        "saturation": tables.saturation_table(results),
        "unused": tables.unused_table(results),
        "budgets": gains.unequal_budgets(results.tuned),
        "versions": versions,
        "warning": warning,
        "limitations": findings.limitations_of(results),
        "markdown_rows": _MOST_ROWS,
        "figures": _FIGURES,
    }


def _overviews(results: Results, looks: dict[str, Look]) -> dict[str, charts.Figure]:
    """A figure of each of the first groups, by the group's name; none of a group of many cells."""
    sizes = results.cells.groupby("group", sort=False).size()[:_MOST_OVERVIEWS]
    done = set(results.cells.group.reindex(results.runs.cell[results.runs.state == DONE]))
    few = [group for group, n in sizes.items() if n <= 4 * _MOST_OVERVIEWS and group in done]
    return {group: charts.overview_figure(results, group, looks) for group in few}


def _drawn(
    results: Results, looks: dict[str, Look], cells: Sequence[int], paper: int | None
) -> dict[int, list[charts.Figure]]:
    """Draw cells one after the other: in full, or small where they are many."""
    wanted = list(dict.fromkeys([*([] if paper is None else [paper]), *cells]))
    left, whole = float(_BUDGET), 0
    found: dict[int, list[charts.Figure]] = {}
    for done, cell in enumerate(wanted):
        share = left / (len(wanted) - done)
        columns = int(min(max(share / 400.0, 24), 200))
        full = cell == paper or share >= whole
        drawn = charts.cell_figures(results, cell, looks, *(_FULL if full else (columns, 0)))
        # the first one tells what the others will take
        if full and cell != paper and (whole := max(whole, _size(drawn))) > share:
            drawn = charts.cell_figures(results, cell, looks, columns, 0)
        left -= _size(drawn)
        found[cell] = drawn
    return found


def _size(figures: Sequence[charts.Figure]) -> int:
    """Characters of what draws figures in the page."""
    return sum(len(files.json_text(chart)) for figure in figures for chart in figure.charts)


def _metrics_tables(results: Results, drawn: Sequence[int]) -> dict[int, tables.Table]:
    """Tables of every metric: of all cells, or, where these are too many, of those that are drawn."""
    sizes = len(list_metrics()) * results.runs.groupby("cell").size()
    chosen = list(results.cells.index)
    if sizes.sum() > _MOST_METRICS:
        room = sizes.loc[list(drawn)].cumsum() <= _MOST_METRICS
        chosen = list(room.index[room])
    return {cell: tables.metrics_table(results, cell) for cell in chosen}
