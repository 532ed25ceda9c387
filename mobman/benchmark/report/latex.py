"""Tables and figures for LaTeX documents."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mobman.benchmark.report.cells import CellRuns, Group
from mobman.benchmark.report.chart import Chart, Look
from mobman.benchmark.report.content import FailedRun, ReportedRun, ReportedSuite
from mobman.benchmark.report.table import Entry, Row, Table
from mobman.errors import MobmanError
from mobman.printable import printable

_SYMBOLS = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "`": r"\textasciigrave{}",
    # behind \\ these would be its argument
    "[": "{[}",
    "]": "{]}",
    "*": "{*}",
    "–": "--",
    "−": "$-$",
    "∞": r"$\infty$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "²": r"\textsuperscript{2}",
    "µ": r"\textmu{}",
    "→": r"$\to$",
    "’": "'",
    "…": r"\ldots{}",
    "\u00a0": "~",
}
_PAPERS = {
    "|e^e|": r"$\lVert e^e\rVert$",
    "|e^a|": r"$\lVert e^a\rVert$",
    "|v|²": r"$\lVert v\rVert^2$",
}
_EXPONENT = re.compile(r"(?<![\w.])(-?[0-9.]+)e(-?[0-9]+)\b")
_PREAMBLE = r"""% Compiles by pdflatex, lualatex or xelatex, in this folder.
\documentclass{article}
\usepackage[T1]{fontenc}
\usepackage{textcomp}
\usepackage{amsmath}
\usepackage{booktabs}
\usepackage{graphicx}
\usepackage[margin=2cm]{geometry}
\begin{document}
"""


def write_latex(
    folder: Path,
    suite: ReportedSuite,
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun],
    patterns: Sequence[str] = (),
) -> list[Path]:
    """Write tables (booktabs), figures (PDF) and ``example.tex``, which includes all of them.

    Args:
        folder: Where they go; it is made if need be.
        suite: What the runs are of.
        runs: In the suite's order.
        failures: Runs that gave no result.
        patterns: The first cell that one of them fits is the one whose errors and torques are drawn;
            by default the paper's, or else the first.

    Raises:
        MobmanError: If they cannot be written.
        UsageError: If a pattern fits no cell.
    """
    tables, charts = _content(suite, runs, failures, patterns)
    files = {f"{name}.tex": latex_table(table) for name, table in tables.items()}
    files["example.tex"] = _example(suite, tables, charts)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).write_text(content, encoding="utf-8", errors="backslashreplace")
        if charts:
            from mobman.benchmark.report.pdf import write_pdf

            for name, chart in charts.items():
                write_pdf(folder / f"{name}.pdf", chart)
    except OSError as error:
        reason = error.strerror or error
        raise MobmanError(f"cannot write LaTeX files to {folder}: {reason}") from error
    return [folder / name for name in (*files, *(f"{name}.pdf" for name in charts))]


def latex_table(table: Table) -> str:
    """A table as a ``tabular`` with booktabs' rules, and nothing around it.

    Numbers are in mathematics, right-aligned; no package but booktabs is needed.
    """
    columns = "".join("r" if item.number else "l" for item in table.columns)
    lines = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule"]
    lines += [_row(Row(table.columns[0], table.columns[1:])), r"\midrule"]
    for row in table.rows:
        if row.title:
            lines.append(
                rf"\addlinespace \multicolumn{{{len(columns)}}}{{l}}{{{escape(row.head.text)}}} \\"
            )
        else:
            lines.append(_row(row))
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def escape(text: str) -> str:
    """Text for LaTeX, with the paper's symbols and powers of ten set as such."""
    parts = re.split(
        "(" + "|".join(map(re.escape, _PAPERS)) + ")", printable(" ".join(text.split()))
    )
    return "".join(_PAPERS.get(part) or _powers(part) for part in parts)


def _powers(text: str) -> str:
    found, end = [], 0
    for number in _EXPONENT.finditer(text):
        found.append(_plain(text[end : number.start()]))
        found.append(rf"${number[1]}\cdot10^{{{int(number[2])}}}$")
        end = number.end()
    return "".join([*found, _plain(text[end:])])


def _plain(text: str) -> str:
    return "".join(_SYMBOLS.get(letter, letter) for letter in text)


def _row(row: Row) -> str:
    return " & ".join(_entry(item) for item in (row.head, *row.entries)) + r" \\"


def _entry(item: Entry) -> str:
    text = escape(item.text)
    if item.unit:
        text = f"{text} ({escape(item.unit)})"
    if item.mark == "best" and text:
        # \boldmath: \textbf leaves mathematics as it is
        return rf"{{\boldmath\textbf{{{text}}}}}"
    return text


def _content(
    suite: ReportedSuite,
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun],
    patterns: Sequence[str],
) -> tuple[dict[str, Table], dict[str, Chart]]:
    from mobman.benchmark.report import overview_charts as drawn
    from mobman.benchmark.report import standings_tables as standings
    from mobman.benchmark.report.evaluation import evaluate
    from mobman.benchmark.report.tables import summary_table

    found = evaluate(suite, runs, failures)
    groups, styles, field, board = found.groups, found.styles, found.field, found.board
    tables: dict[str, Table] = {}
    charts: dict[str, Chart] = {}
    if field.cells:
        tables["leaderboard"] = standings.leaderboard_table(board)
    if board.families:
        tables["families"] = standings.families_table(board)
    if board.pairs:
        tables["comparisons"] = standings.pairs_table(board.pairs)
    tuned = standings.tuned_table(field, board, suite.tuned) if found.compared else None
    if tuned is not None:
        tables["tuned"] = tuned
    for number, group in enumerate(groups, 1):
        tables[f"results-{number}"] = summary_table(group)
    if found.compared:
        prices = {name: drawn.prices_of(field, board, name) for name in drawn.EFFORTS}
        charts["leaderboard"] = drawn.leaderboard_chart(board, styles)
        charts["scenarios"] = drawn.scenarios_chart(field)
        charts["profiles"] = drawn.profiles_chart(field, styles)
        charts["pareto"] = drawn.pareto_chart(prices, styles)
    periods = drawn.periods_chart(groups, styles)
    if periods is not None:
        charts["sampling-periods"] = periods
    cell = _chosen(groups, patterns)
    if cell is not None:
        charts |= _of_cell(cell, styles)
    return tables, charts


def _chosen(groups: Sequence[Group], patterns: Sequence[str]) -> CellRuns | None:
    from mobman.benchmark.report.drawings import papers_cells
    from mobman.benchmark.report.selection import select

    found = select(groups, patterns).cells if patterns else papers_cells(groups)
    found = found or [cell for group in groups for cell in group.cells if cell.runs]
    return found[0] if found else None


def _of_cell(cell: CellRuns, styles: dict[str, Look]) -> dict[str, Chart]:
    from mobman.benchmark.report import time_charts
    from mobman.benchmark.report.curves import read_curves
    from mobman.benchmark.report.drawings import is_the_papers

    curves = read_curves(cell, 800, 400)
    if not curves.runs:
        return {}
    shown = next((run for run in curves.runs if is_the_papers(run)), curves.runs[0])
    return {
        "task-error": time_charts.task_error_chart(curves, styles),
        "auxiliary-error": time_charts.auxiliary_error_chart(curves, styles),
        "torque": time_charts.torque_chart(shown),
    }


def _example(suite: ReportedSuite, tables: dict[str, Table], charts: dict[str, Chart]) -> str:
    parts = [_PREAMBLE + rf"\section*{{Benchmark {escape(suite.name)}}}"]
    for name, table in tables.items():
        parts.append(
            "\n".join(
                [
                    r"\begin{table}[htbp]",
                    r"\centering",
                    rf"\caption{{{escape(table.caption)}}}",
                    rf"\label{{tab:{name}}}",
                    rf"\resizebox{{\ifdim\width>\linewidth\linewidth\else\width\fi}}{{!}}"
                    rf"{{\input{{{name}}}}}",
                    r"\end{table}",
                ]
            )
        )
    for name, chart in charts.items():
        parts.append(
            "\n".join(
                [
                    r"\begin{figure}[htbp]",
                    r"\centering",
                    rf"\includegraphics[width=\linewidth]{{{name}.pdf}}",
                    rf"\caption{{{escape(chart.title)}.}}",
                    rf"\label{{fig:{name}}}",
                    r"\end{figure}",
                ]
            )
        )
    return "\n\n".join([*parts, r"\end{document}", ""])
