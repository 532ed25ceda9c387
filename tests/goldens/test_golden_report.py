"""Numbers of the report of a small suite, run and reported on by the command line."""

from __future__ import annotations

import csv
import json
import os
import re
import tempfile
from html.parser import HTMLParser
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.goldens import (
    FOLDER,
    alike,
    metric_differences,
    mobman,
    numbers_in,
    read_json,
    steady_metrics,
    terminal,
    write_json,
)

FILE, TABLES = "report.json", FOLDER / "report_tables.txt"
# rounding shows more in the sliding laws
TOLERANCES = {"tsm": 1e-6, "pseudo-inverse": 1e-9, "extended-jacobian": 1e-9}
SUITE = """
schema = 1
name = "golden"
duration = 0.3
seeds = [4]

[controllers.tsm]
law = "tsm"
gains = { metric_scale = 1.0 }

[controllers.pseudo-inverse]
law = "pseudo-inverse"

[controllers.extended-jacobian]
law = "extended-jacobian"

[[groups]]
robots = ["youbot", "fixed_panda"]
tasks = ["circle"]
scenarios = ["nominal", "disturbed"]
"""
CELL = ("robot", "task", "scenario", "family", "duration", "dt", "controller", "seed", "law")
# tables and rows of what depends on the machine, the time or the run's identifier, or is text
LEFT_OUT = re.compile("version|machine|computing time|replay|gains|definition", re.IGNORECASE)
ROWS_LEFT_OUT = re.compile(r"compute|constraint_residual|energy_residual|\| record ")


def report_in(folder: Path) -> Path:
    """Run the suite in a folder: the folder of its results."""
    (folder / "golden.toml").write_text(SUITE, encoding="utf-8")
    before = Path.cwd()
    os.chdir(folder)
    try:
        with terminal():
            status, _, err = mobman(
                "bench", "run", "golden.toml", "-o", "results", "--workers", "1"
            )
    finally:
        os.chdir(before)
    assert status == 0, err
    return folder / "results"


def rows_of(results: Path) -> dict[str, dict]:
    """Rows of report.csv by cell, controller and seed: status and metrics."""
    found = {}
    with (results / "report.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            key = ", ".join(row.pop(name) for name in CELL)
            kept = {"status": row.pop("status")}
            for name in ("message", "created", "file", "placement"):
                row.pop(name)
            found[key] = {**kept, "metrics": steady_metrics(row)}
    return found


class Tables(HTMLParser):
    """The tables of a page, as lines of text under their headings."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._heading = self._text = ""
        self._row: list[str] | None = None
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        if tag in ("h2", "th", "td", "caption"):
            self._text = ""
        elif tag == "tr":
            self._row = []
        elif tag in ("small", "sup"):
            self._text += " (" if tag == "small" else "^"

    def handle_data(self, data):
        self._text += data

    def handle_endtag(self, tag):
        if tag == "h2":
            self._heading = self._text
        elif tag == "caption":
            self.lines += ["", f"## {self._heading}: {self._text.strip()}"]
        elif tag in ("th", "td"):
            self._row.append(" ".join(self._text.split()))
        elif tag == "tr":
            self.lines.append(f"| {' | '.join(self._row)} |")
        elif tag == "thead":
            self.lines.append("|---|")


def tables_of(results: Path) -> str:
    """The tables of report.html under their headings, without what no other machine has."""
    text = "\n".join(Tables((results / "report.html").read_text(encoding="utf-8")).lines)
    kept = []
    for block in text.strip().split("\n\n"):
        heading, *rows = block.splitlines()
        if not LEFT_OUT.search(heading):
            kept.append([heading, *(row for row in rows if not ROWS_LEFT_OUT.search(row))])
    return "\n\n".join(map("\n".join, kept)) + "\n"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return report_in(tmp_path_factory.mktemp("golden-suite"))


def test_rows_of_the_report_are_those_stored(results):
    found, stored = rows_of(results), read_json(FILE)
    assert list(found) == list(stored)
    problems = []
    for key, row in stored.items():
        law = key.split(", ")[CELL.index("law")]
        if found[key]["status"] != row["status"]:
            problems.append(f"{key}: {found[key]['status']}; stored: {row['status']}")
        metrics = found[key]["metrics"], row["metrics"]
        problems += metric_differences(*metrics, TOLERANCES[law], where=key)
    assert not problems, "\n".join(problems)


def test_numbers_of_the_reports_tables_are_those_stored(results):
    """Their words may change; numbers in them count."""
    problems = list(table_differences(tables_of(results), TABLES.read_text(encoding="utf-8")))
    assert not problems, "\n".join(problems)


def table_differences(found: str, stored: str):
    """List the rows of tables whose numbers differ."""
    found_blocks, stored_blocks = found.split("\n\n"), stored.split("\n\n")
    if len(found_blocks) != len(stored_blocks):
        yield f"{len(found_blocks)} tables; stored: {len(stored_blocks)}"
    for ours, theirs in zip(found_blocks, stored_blocks, strict=False):
        # the heading and the names of the columns are words
        pairs = zip(ours.splitlines()[2:], theirs.splitlines()[2:], strict=False)
        if ours.count("\n") != theirs.count("\n"):
            yield f"other rows than stored:\n{ours}\nstored:\n{theirs}"
        for row, other in pairs:
            numbers, others = numbers_in(row), numbers_in(other)
            if len(numbers) != len(others) or not all(map(alike, numbers, others)):
                yield f"{row}\nstored: {other}"


def test_the_index_holds_the_same_metrics(results):
    rows = rows_of(results)
    with h5py.File(results / "index.h5") as file:
        table = file["table"]
        names = [table[name].asstr()[()] for name in ("robot", "scenario", "label")]
        cells = [", ".join(cell) for cell in zip(*names, strict=True)]
        metrics = {name: values[()].tolist() for name, values in table["metrics"].items()}
        for name in next(iter(rows.values()))["metrics"]:
            found = dict(zip(cells, metrics[name], strict=True))
            for key, row in rows.items():
                robot, _, scenario, _, _, _, label, *_ = key.split(", ")
                value = found[f"{robot}, {scenario}, {label}"]
                np.testing.assert_equal(value, row["metrics"][name], err_msg=f"{key}: {name}")
        specs = [json.loads(text) for text in table["spec_json"].asstr()]
    assert {(spec["duration"], spec["seed"]) for spec in specs} == {(0.3, 4)}


def test_a_number_that_is_a_digit_off_is_noticed(results):
    tables = tables_of(results)
    row = next(line for line in tables.splitlines() if "task_error_final" in line)
    first = next(number for number in numbers_in(row) if "." in number)
    other = first[:-1] + str((int(first[-1]) + 5) % 10)
    assert list(table_differences(tables.replace(row, row.replace(first, other)), tables))


# Making the files ---------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store the rows and tables of the suite's report."""
    with tempfile.TemporaryDirectory() as folder:
        results = report_in(Path(folder))
        write_json(FILE, rows_of(results))
        TABLES.write_text(tables_of(results), encoding="utf-8")
