"""Answers of docs/findings.md: each has a number, and every number is in a section that it leads to."""

from __future__ import annotations

import re

import pytest
from support.pages import DOCS, section

NUMBER = re.compile(r"(?<![\w.(-])\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w)])")


def answers():
    text = (DOCS / "findings.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?!question|---)(.+?) \| (.+?) \| .+ \|$", text, re.MULTILINE)
    return [pytest.param(answer, id=question) for question, answer in rows]


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
