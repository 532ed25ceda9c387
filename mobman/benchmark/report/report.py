"""Writing the report."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mobman.benchmark.report.content import (
    FailedRun,
    ReportedRun,
    ReportedSuite,
    ReportFiles,
    UnusedFile,
)
from mobman.errors import MobmanError
from mobman.files import temporary_beside
from mobman.input_file import check_within

_FIGURES = "figures"


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
    # here, so that who merely imports this module does not wait for what it takes
    from mobman.benchmark.report.page_content import page_content
    from mobman.benchmark.report.pages import render

    folder = Path(folder)
    cells = request.cells if request else ()
    content = page_content(suite, runs, failures, unused, cells)
    html, markdown = render(content, _FIGURES)
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
    check_within(figures, folder)
    _write_all({**files, **texts})
    return result


def _write_all(files: Mapping[Path, str]) -> None:
    """Write files to temporary names, then give them their own."""
    temporary = {path: temporary_beside(path) for path in files}
    try:
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary[path].write_text(text, encoding="utf-8", errors="backslashreplace")
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
