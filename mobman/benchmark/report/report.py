"""Writing the report."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mobman.benchmark.report.content import FailedRun, ReportedRun, ReportedSuite, ReportFiles
from mobman.errors import MobmanError
from mobman.simulation.temporary import temporary_beside

_FIGURES = "figures"


def write_report(
    folder: Path,
    suite: ReportedSuite,
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun] = (),
) -> ReportFiles:
    """Write ``report.html``, ``report.md`` and the figures of the latter, ``figures/*.svg``.

    All is made before anything is written, and each file is there whole or not at all: a report that
    fails leaves the one before it as it was.

    Args:
        folder: Where the report goes; it is made if need be.
        suite: What the runs are of.
        runs: In the suite's order, which is the order of controllers and scenarios in the report.
        failures: Runs that gave no result.

    Raises:
        MobmanError: If it cannot be written.
    """
    folder = Path(folder)
    content = _content(suite, runs, failures)
    html, markdown = _render(content)
    figures = folder / _FIGURES
    files = {figures / f"{d.key}.svg": d.file for group in content["drawings"] for d in group.all}
    result = ReportFiles(folder / "report.html", folder / "report.md")
    _write_all({**files, result.markdown: markdown, result.html: html})
    return result


def _content(
    suite: ReportedSuite, runs: Sequence[ReportedRun], failures: Sequence[FailedRun]
) -> dict[str, Any]:
    """What the templates show."""
    # here, so that who merely imports this module does not wait for matplotlib
    from mobman.benchmark.report import format, limitations, provenance, settings, summary, tables
    from mobman.benchmark.report.cells import groups_of, labels_of
    from mobman.benchmark.report.drawings import Draughtsman
    from mobman.benchmark.report.style import styles_of
    from mobman.simulation.metrics.metric import STEADY

    groups = groups_of(runs, failures)
    labels = labels_of(runs, failures)
    styles = styles_of(labels, runs)
    draughtsman = Draughtsman(suite, styles)
    created = sorted(run.record.created for run in runs)
    return {
        "suite": suite,
        "asked": len(runs) + len(failures),
        "wall_time": None if suite.seconds is None else format.duration(suite.seconds),
        "first": format.moment(created[0]) if created else "",
        "last": format.moment(created[-1]) if created else "",
        "written": format.moment(datetime.now(UTC).isoformat()),
        "steady": format.instant(STEADY * suite.duration),
        "summary": summary.summary_lines(groups, runs, failures),
        "styles": styles,
        "explicit": [label for label in labels if styles[label].explicit],
        "groups": groups,
        "drawings": [draughtsman.group(group) for group in groups],
        "summary_tables": [tables.summary_table(group) for group in groups],
        "metrics_tables": [
            (group, [(cell, tables.metrics_table(cell)) for cell in group.cells])
            for group in groups
        ],
        "replays_table": tables.replays_table(groups),
        "failures_table": tables.failures_table(groups),
        "settings": settings.settings_of(groups),
        "versions": provenance.versions_of(runs),
        "machine": provenance.machine_table(),
        "timing": tables.timing_table(groups),
        "definitions": tables.definitions_table(),
        "limitations": limitations.limitations_of(runs),
    }


def _render(content: Mapping[str, Any]) -> tuple[str, str]:
    """The report as HTML and as Markdown."""
    import jinja2

    from mobman.benchmark.report.format import html_text, markdown_text, slug

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mobman.benchmark.report", "templates"),
        autoescape=jinja2.select_autoescape(enabled_extensions=("html.j2",)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(symbols=html_text, md=markdown_text, slug=slug)
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
        raise MobmanError(f"cannot write the report {error.filename}: {reason}") from error
    finally:
        _remove(temporary.values())


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError:  # its folder could not be made: there is nothing to remove
            continue
