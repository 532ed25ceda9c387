"""Write a suite's results as a table into a page: laws by scenarios, with what each law uses.

python docs/table.py results/table docs/suites.md

The table stands between ``<!-- results: SUITE -->`` and ``<!-- end -->``.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

import numpy as np
import pandas as pd

import mobman as mm
from mobman.controllers.protocol import information_of

CELL = ["robot", "task", "placement", "scenario", "dt"]
HELD = 1e-4  # m: a cell is solved where the steady error stays below it


def cell(runs: pd.DataFrame) -> str:
    """Median of the steady errors (m), runs that end early counting as infinite, and how many hold; of
    several seeds the worst counts."""
    if runs.empty:
        return ""
    every = runs["task_error_max"].where(runs["status"] == "ok", np.inf).fillna(np.inf)
    error = every.groupby([runs[name] for name in CELL]).max()
    median = float(np.median(error))
    text = f"{median:.1e}".replace("e-0", "e-") if np.isfinite(median) else "–"
    return f"{text} ({int((error < HELD).sum())})"


def table(frame: pd.DataFrame, gains: dict[str, dict[str, object]]) -> str:
    """The table as Markdown, in the order of the suite; gains by label."""
    scenarios = list(dict.fromkeys(frame["scenario"]))
    cells = frame.groupby(CELL).ngroups
    count = cells // len(scenarios)
    heads = ["controller", "uses", *(f"`{name}`" for name in scenarios)]
    lines = [heads, ["---"] * len(heads)]
    for label, runs in frame.groupby("controller", sort=False):
        uses = ", ".join(information_of(runs["law"].iloc[0], gains[label]) or ["not said"])
        found = [cell(runs[runs["scenario"] == name]) for name in scenarios]
        lines.append([f"`{label}`", uses, *found])
    rows = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"Median steady error (m), and in how many of {count} cells it stays below 1e-4 m:\n\n{rows}"


def main() -> None:
    """Read the results, write the page."""
    parser = argparse.ArgumentParser(description="Write a suite's results as a table into a page.")
    parser.add_argument("results", type=Path, help="folder of the suite's results")
    parser.add_argument("page", type=Path, help="page with the marks <!-- results: SUITE -->")
    options = parser.parse_args()
    try:
        frame = mm.load_results(options.results)
        kept = json.loads((options.results / "suite.json").read_text(encoding="utf-8"))
    except (mm.MobmanError, OSError) as error:
        sys.exit(f"table.py: {error}")
    suite = kept["suite"]["name"]
    gains = {label: one.get("gains", {}) for label, one in kept["suite"]["controllers"].items()}
    if missing := int((frame["status"] == "pending").sum()):
        sys.exit(f"table.py: {missing} of {len(frame)} runs of {options.results} are not done yet")
    text = options.page.read_text(encoding="utf-8")
    marks = re.compile(rf"(<!-- results: {re.escape(suite)} -->\n).*?(\n<!-- end -->)", re.DOTALL)
    if not marks.search(text):
        sys.exit(f"table.py: {options.page} has no <!-- results: {suite} --> ... <!-- end -->")
    options.page.write_text(
        marks.sub(lambda found: found[1] + table(frame, gains) + found[2], text), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
