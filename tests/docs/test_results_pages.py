"""Numbers that sentences of README and docs quote stand in the tables that commands write."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from support.pages import anchor, section

ROOT = Path(__file__).parents[2]
SUITES = (ROOT / "docs" / "suites.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
QUOTED = re.compile(r"(?<![\w.])(?:\d\.\d|[2-9])e-\d+")  # 1e-4 and the like are bounds
ROW = re.compile(r"^ *\|.*\|$", re.MULTILINE)
LINK = re.compile(r"\]\((?:docs/|\.\./)?([\w.]*?)(?:#([\w-]+))?\)")
SECTIONS = [name for name in re.findall(r"^## (.+)$", SUITES, re.MULTILINE) if "tsm" in name] + [
    name
    for name in re.findall(r"^## (.+)$", SUITES, re.MULTILINE)
    if name.startswith(("What `", "Every"))
]


def tables(text: str) -> str:
    return "\n".join(ROW.findall(text))


def linked(text: str) -> str:
    """The tables of the sections of docs/suites.md that a text links to."""
    anchors = {name for page, name in LINK.findall(text) if page in ("", "suites.md") and name}
    return "\n".join(tables(section("suites.md", name)) for name in sorted(anchors))


def check(prose: str, known: str) -> None:
    strange = set(QUOTED.findall(ROW.sub("", prose))) - set(QUOTED.findall(known))
    assert not strange, f"in no table: {sorted(strange)}"


@pytest.mark.parametrize("heading", SECTIONS)
def test_a_section_quotes_its_tables(heading):
    text = section("suites.md", anchor(heading))
    check(text, tables(text) + linked(text))


def test_the_front_page_and_the_page_of_comparisons_quote_the_tables():
    front = README.split("## What the comparisons say")[1].split("\n## ")[0]
    check(front, linked(front))
    page = (ROOT / "docs" / "comparisons.md").read_text(encoding="utf-8")
    check(page, linked(page))


def rows(command: str) -> dict[str, list[tuple[float, int]]]:
    """Medians (m) and counts by law and scenario, of a table."""
    block = re.search(rf"<!-- by: docs/suite_table.py {command} .*?<!-- end -->", SUITES, re.DOTALL)
    found = {}
    for row in re.findall(r"^\| `([\w-]+)` \|(.*)\|$", block[0], re.MULTILINE):
        cells = re.findall(r"([\d.e+-]+|–) \((\d+)\)", row[1])
        found[row[0]] = [(math.inf if m == "–" else float(m), int(n)) for m, n in cells]
    return found


def test_counts_over_all_scenarios_are_those_of_the_rows():
    held = {law: sum(n for _, n in cells) for law, cells in rows("table").items()}
    most = max(held.values())
    best = {law for law, n in held.items() if n == most}
    assert best == {"time-delay", "disturbance-observer"}
    for text in (README, SUITES):
        assert f"in {most} of 150 cells" in text or f"in {most}, `super-twisting`" in text
        assert f"`super-twisting` in {held['super-twisting']}" in text
    assert f"`tsm` with the hedge does in {held['tsm-hedge']}" in SUITES


def test_decades_are_those_of_the_rows():
    heavier = {law: cells[1][0] for law, cells in rows("table").items()}
    all_of_it = math.log10(heavier["extended-jacobian"] / heavier["tsm"])
    by_z_dot = math.log10(heavier["extended-jacobian"] / heavier["time-delay"])
    text = section("suites.md", "where-the-advantage-of-tsm-comes-from")
    assert f"Of {all_of_it:.1f} decades" in text
    assert f"**{by_z_dot:.1f} are had by a law that adds the measured acceleration**" in text
