"""Answers of docs/findings.md: each has a number, and every number is in a section that it leads to."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
_SPEC = importlib.util.spec_from_file_location("site_pages", DOCS / "site" / "pages.py")
pages = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(pages)

NUMBER = re.compile(r"(?<![\w.(-])\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w)])")


def answers():
    text = (DOCS / "findings.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?!question|---)(.+?) \| (.+?) \| .+ \|$", text, re.MULTILINE)
    return [pytest.param(answer, id=question) for question, answer in rows]


def section(page: str, anchor: str) -> str:
    """The text below a heading, up to the next of its level; all of a page without an anchor."""
    text = (DOCS / page).read_text(encoding="utf-8")
    if not anchor:
        return text
    headings = list(re.finditer(r"^(#+) (.+)$", text, re.MULTILINE))
    for i, found in enumerate(headings):
        if pages.anchor(found[2]) == anchor:
            after = (one.start() for one in headings[i + 1 :] if len(one[1]) <= len(found[1]))
            return text[found.end() : next(after, len(text))]
    raise AssertionError(f"{page} has no section #{anchor}")


@pytest.mark.parametrize("answer", answers())
def test_numbers_of_an_answer_are_those_of_its_sections(answer):
    sentence, *links = re.split(r"\[[^\]]+\]\(([^)]+)\)", answer)
    linked = "\n".join(section(*link.partition("#")[::2]) for link in links[::2])
    numbers = NUMBER.findall(re.sub(r"`[^`]*`", "", sentence))
    assert numbers
    known = set(NUMBER.findall(re.sub(r"[()]", " ", linked)))
    assert set(numbers) <= known, f"not in {links[::2]}: {set(numbers) - known}"


def test_every_question_is_answered():
    assert len(answers()) >= 14
