"""The theory's table of equations against the sources: what it names is there and names them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
TABLE = PAGE.split("<!-- equations -->", 1)[1].split("<!-- end -->", 1)[0]
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")] for line in TABLE.strip().splitlines()[2:]
]
# what the paper is about; the others are steps of its derivations, or its example
IMPLEMENTED = {
    *range(1, 14),
    16,
    17,
    18,
    21,
    22,
    26,
    31,
    34,
    35,
    41,
    43,
    44,
    45,
    51,
    *range(53, 57),
}
IMPLEMENTED |= {64, 65, 66}


def numbers(text):
    return {int(number) for number in re.findall(r"\((\d+)\)", text)}


def source_of(path, name):
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return ast.get_source_segment(text, node)
    return None


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_is_named_is_there_and_names_its_equations(row):
    equations, _, file, names = row
    path = ROOT / "mobman" / file.strip("`")
    texts = {name: source_of(path, name) for name in re.findall(r"`(\w+)`", names)}
    assert texts
    assert None not in texts.values(), texts.keys()
    assert numbers(equations) <= numbers(" ".join(texts.values()))


def test_every_equation_that_is_implemented_is_in_it():
    assert set().union(*(numbers(row[0]) for row in ROWS)) >= IMPLEMENTED - {3}
    assert "dot x = N(x)" in PAGE  # (3) stands in the notation
