"""What the page on tuning says of spaces, objectives and fields is what the code has."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from mobman.benchmark.suite_tables import TunedFrom, Tuning
from mobman.benchmark.tuning.objective import objectives
from mobman.benchmark.tuning.tuning_set import law_space
from mobman.controllers.protocol import controllers

PAGE = (Path(__file__).parents[3] / "docs" / "tuning.md").read_text()
OWN = [
    name for name in controllers.names() if controllers.get(name).__module__.startswith("mobman.")
]


@pytest.mark.parametrize("law", OWN)
def test_space(law):
    space = law_space(law)
    ranges = ", ".join(
        f"`{name}` {own.low:g} to {own.high:g}{' (log)' if own.log else ''}"
        for name, own in space.items()
    )
    assert f"| `{law}` | {len(space)} | {ranges} |\n" in PAGE


def test_objectives():
    section = PAGE.split("\n## Objective\n")[1].split("\n## ")[0]
    named = re.findall(r"^\| `([^`]+)` \|", section, re.MULTILINE)
    own = [
        name
        for name in objectives.names()
        if objectives.get(name).function.__module__.startswith("mobman.")
    ]
    assert sorted(named) == own


def test_fields():
    budget = PAGE.split("\n## The budget\n")[1].split("\n## ")[0]
    assert {f"`{name}`" for name in Tuning.model_fields} <= set(re.findall(r"`\w+`", budget))
    written = PAGE.split("| field of `tuned` |")[1].split("\n\n")[0]
    assert {f"`{name}`" for name in TunedFrom.model_fields} <= set(re.findall(r"`\w+`", written))
    assert f"| `trials` | {Tuning().trials} |" in PAGE
    assert f"| `seeds` | `{Tuning().seeds}` |" in PAGE


def test_example_of_a_budget():
    example = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    given = tomllib.loads(example[1])["tuning"]
    understood = Tuning.model_validate(given).model_dump(mode="json", exclude_unset=True)
    assert given
    assert set(understood) == set(given)
    assert all(understood[name] == given[name] for name in ("trials", "seeds") if name in given)
