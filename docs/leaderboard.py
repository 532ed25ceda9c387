"""Print the leaderboard of a shipped suite as rows of a table, for a page of the docs.

python docs/leaderboard.py SUITE [FIELD=VALUE ...] [--solved COLUMN]

Fields, as JSON, replace those of the suite: placements=1 duration=10. Its runs are kept in
``results/claims``, and go on where they were interrupted.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pandas as pd

import mobman as mm
from mobman.benchmark.report.data import read_results
from mobman.benchmark.report.format import interval_range, number
from mobman.benchmark.report.standings import Standing, board_of
from mobman.benchmark.store import Store
from mobman.benchmark.suite import Suite

ROOT = Path(__file__).parents[1]


def results_of(name: str, fields: dict[str, object]) -> Path:
    """Run the suite with these fields; the folder of its results."""
    content = mm.load_suite(name).model_dump(mode="json", by_alias=True, exclude_unset=True)
    content |= {**fields, "name": "-".join([name, *map(str, fields.values())])}
    folder = ROOT / "results" / "claims" / content["name"]
    mm.run_suite(Suite.model_validate(content), folder, redo_changed=True, report=False)
    return folder


def row(standing: Standing, solved: pd.Series | None) -> str:
    """A controller's row: error and interval, cells solved, runs that ended early, cells by column."""
    cells = [
        f"`{standing.label}`",
        number(standing.error.estimate, 2),
        interval_range(standing.error),
        f"{standing.solved} of {standing.cells}",
        str(standing.ended),
    ]
    if solved is not None:
        cells.append(", ".join(map(str, solved)))
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("suite")
    parser.add_argument("fields", nargs="*", metavar="FIELD=VALUE")
    parser.add_argument(
        "--solved", help="column of the results: cells solved for each of its values"
    )
    given = parser.parse_args()
    fields = {name: json.loads(value) for name, value in (f.split("=", 1) for f in given.fields)}
    folder = results_of(given.suite, fields)
    frame = mm.load_results(folder)
    solved = pd.DataFrame()
    if given.solved:
        one_cell = ["controller", "robot", "task", "placement", "scenario", "dt"]
        every = frame.groupby(one_cell, sort=False).success.min().eq(1.0).reset_index()
        solved = every.pivot_table("success", "controller", given.solved, "sum", sort=False)
    for standing in board_of(read_results(Store(folder))).standings:
        print(row(standing, solved.loc[standing.label] if given.solved else None), flush=True)


if __name__ == "__main__":
    main()
