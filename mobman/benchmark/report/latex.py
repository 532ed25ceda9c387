"""Tables and figures for LaTeX documents."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mobman.benchmark.report import charts, tables
from mobman.benchmark.report.charts import Figure
from mobman.benchmark.report.data import DONE, Results
from mobman.benchmark.report.format import listing, slug
from mobman.benchmark.report.standings import EFFORTS, board_of, prices_of, select
from mobman.benchmark.report.tables import Entry, Table
from mobman.display import printable
from mobman.errors import MobmanError
from mobman.figures import files
from mobman.files import write_all

_SYMBOLS = str.maketrans(
    {
        **{letter: f"\\{letter}" for letter in "&%$#_{}"},
        **{letter: f"{{{letter}}}" for letter in "[]*"},  # behind \\ these would be its argument
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        '"': r"\textquotedbl{}",
        "`": r"\textasciigrave{}",
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
)
_PAPERS = {
    "|e^e|": r"$\lVert e^e\rVert$",
    "|e^a|": r"$\lVert e^a\rVert$",
    "|v|²": r"$\lVert v\rVert^2$",
}
_EXPONENT = re.compile(r"(?<![\w.])(-?[0-9.]+)e(-?[0-9]+)\b")
_NUMBER = r"([-−]?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?)"
_ALONE = re.compile(rf"{_NUMBER}(?: to {_NUMBER})?( %)?")
_MOST_NAMES = 6  # groups of a caption
_COLUMN = 75  # characters of a table that a column has room for, made a little smaller
_PREAMBLE = r"""% For LaTeX, in this folder; figures have their size.
\documentclass[twocolumn]{article}
\usepackage[T1]{fontenc}
\IfFileExists{lmodern.sty}{\usepackage{lmodern}}{}
\usepackage{textcomp}
\usepackage{amsmath}
\usepackage{booktabs}
\usepackage{graphicx}
\usepackage{siunitx}
\usepackage[letterpaper,textwidth=516pt,textheight=680pt,columnsep=12pt]{geometry}
\sisetup{detect-all,range-phrase={ to }}
\begin{document}
"""


def write_latex(
    folder: Path, results: Results, patterns: Sequence[str] = (), how: files.Print | None = None
) -> list[Path]:
    """Write tables (booktabs), figures (PDF) and ``example.tex``, which includes all of them.

    The errors and torques are those of the first cell that one of the patterns fits; by default of the
    paper's, or else of the first.

    Raises:
        MobmanError: If they cannot be written.
        UsageError: If a pattern fits no cell.
    """
    how = how or files.Print()
    contents, figures = _content(results, patterns)
    texts = {name: latex_table(table, name in _RANKED) for name, table in contents.items()}
    texts["example"] = _example(results, contents, figures, how)
    found = {folder / f"{n}.tex": t.encode("utf-8", "backslashreplace") for n, t in texts.items()}
    for name, figure in figures.items():
        found[folder / f"{name}.pdf"] = files.printed(figure.charts, how, across=figure.across)
    try:
        write_all(found)
    except MobmanError as error:
        raise MobmanError(f"cannot write LaTeX files to {folder}: {error}") from error
    return list(found)


_RANKED = ("leaderboard", "families")
"""Tables whose winners are bold: of one cell there is no interval that would allow it."""


def latex_table(table: Table, winners: bool = True) -> str:
    """A ``tabular`` with booktabs' rules, and nothing around it; without winners, none is bold.

    Columns of numbers are right-aligned, numbers siunitx's.
    """
    columns = "".join("r" if item.number else "l" for item in table.columns)
    lines = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule"]
    lines += [_row(table.columns, False), r"\midrule"]
    for row in table.rows:
        if len(row) == 1 < len(columns):
            title = escape(row[0].text)
            lines.append(rf"\addlinespace \multicolumn{{{len(columns)}}}{{l}}{{{title}}} \\")
        else:
            lines.append(_row(row, winners))
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def escape(text: str) -> str:
    """Text for LaTeX, with the paper's symbols; numbers by themselves, ranges of them, and those with
    powers of ten as siunitx's."""
    if alone := _ALONE.fullmatch(text):
        first, last = (number and number.replace("−", "-") for number in alone.group(1, 2))
        found = rf"\num{{{first}}}" if last is None else rf"\numrange{{{first}}}{{{last}}}"
        return found + r"\,\%" * bool(alone[3])
    symbols = "(" + "|".join(map(re.escape, _PAPERS)) + ")"
    parts = re.split(symbols, printable(" ".join(text.split())))
    return "".join(_PAPERS.get(part) or _powers(part.translate(_SYMBOLS)) for part in parts)


def _powers(text: str) -> str:
    return _EXPONENT.sub(lambda found: rf"\num{{{found[1]}e{int(found[2])}}}", text)


def _row(row: Sequence[Entry], winners: bool) -> str:
    texts = []
    for item in row:
        text = escape(item.text)
        if item.unit:
            text = f"{text} ({escape(item.unit)})"
        if winners and item.mark == "best" and text:
            text = rf"{{\boldmath\textbf{{{text}}}}}"  # \textbf leaves mathematics as it is
        texts.append(text)
    return " & ".join(texts) + r" \\"


def _content(
    results: Results, patterns: Sequence[str]
) -> tuple[dict[str, Table], dict[str, Figure]]:
    board, looks = board_of(results), charts.looks_for(results)
    found: dict[str, Table | None] = {
        "leaderboard": tables.leaderboard_table(board) if len(board.cells) else None,
        "families": tables.families_table(board, results) if board.families else None,
        "information": tables.information_table(results, board) if board.compares else None,
        "comparisons": tables.pairs_table(board.pairs) if board.pairs else None,
        "tuned": tables.tuned_table(results, board) if board.compares else None,
    }
    for number, group in enumerate(results.groups, 1):
        found[f"results-{number}"] = tables.summary_table(results, group)
    figures: dict[str, Figure | None] = {
        "sampling-periods": charts.periods_figure(results, looks),
        "sensitivity": charts.sensitivity_figure(results, looks),
    }
    if board.compares:
        prices = {name: prices_of(results, board, name) for name in EFFORTS}
        figures |= {
            "leaderboard": charts.leaderboard_figure(board, looks),
            "scenarios": charts.heat_map(results, board, "case", "scenarios")[0],
            "profiles": charts.profiles_figure(results, board, looks),
            "pareto": charts.pareto_figure(prices, looks),
        }
    done = set(results.runs.cell[results.runs.state == DONE])
    cells = select(results, patterns).cells if patterns else [charts.papers_cell(results)]
    cell = cells[0] if cells and cells[0] is not None else min(done, default=None)
    if cell is not None:
        drawn = charts.cell_figures(results, cell, looks, 800, 400)
        for figure in (figure for figure in drawn if not figure.folded):
            figures[slug(figure.name.removeprefix(f"{results.cells.name[cell]} "))] = figure
    return (
        {name: table for name, table in found.items() if table is not None},
        {name: figure for name, figure in figures.items() if figure is not None},
    )


def _example(
    results: Results, contents: dict[str, Table], figures: dict[str, Figure], how: files.Print
) -> str:
    parts = [_PREAMBLE + rf"\section*{{Benchmark {escape(results.name)}}}"]
    star, where = "*" * (how.column == "double"), _where(results)
    for name, table in contents.items():
        caption = table.caption if name.startswith("results-") else f"{table.caption}; {where}"
        content = _FIT.replace("NAME", name)
        kind = "table" + (star or "*" * (_width(table) > _COLUMN))
        parts.append(_float(kind, f"tab:{name}", escape(f"{caption}."), content))
    for name, figure in figures.items():
        caption = figure.charts[0]["description"]
        if not any(cell in caption for cell in results.cells.name):
            caption = f"{caption}; {where}"
        included = rf"\includegraphics[scale=1]{{{name}.pdf}}"
        parts.append(_float(f"figure{star}", f"fig:{name}", escape(f"{caption}."), included))
    return "\n\n".join([*parts, r"\end{document}", ""])


def _width(table: Table) -> int:
    """The characters of a table's longest entries, and a gap for each column."""
    rows = [row for row in (table.columns, *table.rows) if len(row) == len(table.columns)]
    return sum(2 + max(len(row[i].text) for row in rows) for i in range(len(table.columns)))


def _where(results: Results) -> str:
    """Name the robots and tasks; of many, their numbers."""
    if len(results.groups) <= _MOST_NAMES:
        return " and ".join(group.replace(", ", " at the task ", 1) for group in results.groups)
    found = {noun: list(results.cells[noun].unique()) for noun in ("robot", "task")}
    return " at ".join(
        listing(names) if len(names) <= _MOST_NAMES else f"{len(names)} {noun}s"
        for noun, names in found.items()
    )


_FIT = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{\input{NAME}}"


def _float(kind: str, label: str, caption: str, content: str) -> str:
    lines = [r"\centering", rf"\caption{{{caption}}}", rf"\label{{{label}}}", content]
    return "\n".join([rf"\begin{{{kind}}}[tp]", *lines, rf"\end{{{kind}}}"])
