"""Print the results of a suite as rows of a table, for a page of the docs.

python docs/suite_table.py SUITE [FIELD=VALUE ...] [--rows A,B] [--columns C] [--value METRIC] ...
python docs/suite_table.py SUITE [FIELD=VALUE ...] --ranks [--solved COLUMN]

A cell of the table has the median over the cells of the suite (``--most``: the largest), where runs that
end early count as infinite and of several seeds the worst counts, and in parentheses how many are below
a bound. With ``--ranks``, the rows are those of the report's leaderboard. Fields, as JSON, replace those
of the suite: ``placements=1 duration=10``. Its runs are kept in ``results/claims``, and go on where they
were interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

import mobman as mm
from mobman.benchmark.report.data import read_results
from mobman.benchmark.report.format import interval_range, number
from mobman.benchmark.report.standings import board_of
from mobman.benchmark.store import Store
from mobman.benchmark.suite import Suite
from mobman.controllers.protocol import information_of

ROOT = Path(__file__).parents[1]
CELL = ["robot", "task", "placement", "scenario", "dt"]


def changed(name: str, fields: dict[str, object]) -> Suite:
    """The suite with these fields, under a name that has their values."""
    content = mm.load_suite(name).model_dump(mode="json", by_alias=True, exclude_unset=True)
    content |= {**fields, "name": "-".join([content["name"], *map(str, fields.values())])}
    return Suite.model_validate(content)


def ranks(folder: Path, frame: pd.DataFrame, solved: str | None) -> Iterator[list[str]]:
    """Rows of the leaderboard: error and interval, cells solved in all and by a column, early ends."""
    every = frame.groupby(["controller", *CELL], sort=False).success.min().eq(1.0).reset_index()
    for standing in board_of(read_results(Store(folder))).standings:
        error, own = standing.error, every[every.controller == standing.label]
        row = [f"`{standing.label}`", number(error.estimate, 2), interval_range(error)]
        row += [f"{standing.solved} of {standing.cells}", str(standing.ended)]
        if solved:
            row.append(", ".join(map(str, own.groupby(solved, sort=False).success.sum())))
        yield row


def cells(suite: Suite, frame: pd.DataFrame, given: argparse.Namespace) -> Iterator[list[str]]:
    """Rows of medians or maxima, in the order of the suite."""
    found = frame[given.value].where(frame.status == "ok", np.inf).fillna(np.inf)
    worst = frame.assign(found=found).groupby(["controller", *CELL], sort=False).found.max()
    every = worst.reset_index()
    information = {run.label: information_of(run.law, run.gains) for run in suite.runs()}
    every["uses"] = [", ".join(information[label] or ["not said"]) for label in every.controller]
    heads = list(dict.fromkeys(every[given.columns]))
    if pd.api.types.is_numeric_dtype(every[given.columns]):
        heads.sort()
    rows = given.rows.split(",")

    def text(values: pd.Series) -> str:
        if values.empty:
            return ""
        one = float(values.max() if given.most else np.median(values))
        shown = f"{one:.1e}" if np.isfinite(one) else "–"
        return shown if given.below is None else f"{shown} ({(values < given.below).sum()})"

    for key, own in every.groupby(rows, sort=False):
        names = [
            name if row == "uses" else f"`{name}`" for row, name in zip(rows, key, strict=True)
        ]
        yield [*names, *(text(own.found[own[given.columns] == head]) for head in heads)]


def main() -> None:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("suite", help="a shipped suite's name, or a file")
    parser.add_argument("fields", nargs="*", metavar="FIELD=VALUE", help="of the suite, as JSON")
    parser.add_argument("--rows", default="controller", help="columns of the results, and 'uses'")
    parser.add_argument("--columns", default="scenario", help="a column of the results")
    parser.add_argument("--value", default="task_error_max", help="a metric")
    parser.add_argument("--most", action="store_true", help="the largest, not the median")
    parser.add_argument("--below", type=float, help="how many cells are below this")
    parser.add_argument("--ranks", action="store_true", help="the rows of the leaderboard")
    parser.add_argument("--solved", help="with --ranks: cells solved for each value of this column")
    given = parser.parse_args()
    try:
        fields = {
            name: json.loads(value) for name, value in (f.split("=", 1) for f in given.fields)
        }
        suite = changed(given.suite, fields)
        folder = ROOT / "results" / "claims" / suite.name
        mm.run_suite(suite, folder, redo_changed=True, report=False)
    except (mm.MobmanError, ValueError) as error:
        sys.exit(f"suite_table.py: {error}")
    frame = mm.load_results(folder)
    shown = ranks(folder, frame, given.solved) if given.ranks else cells(suite, frame, given)
    for row in shown:
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
