"""Representations of objects, one line at a prompt, a table in a notebook; and text of other people,
without what would steer a terminal or hide text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape
from typing import NamedTuple

_UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that steer a terminal (all control characters but newline and tab), that reverse the order
of text, or that have no encoding."""


def printable(text: str) -> str:
    r"""Escape control characters, as in ``\x1b``: names and messages come from files of other people."""
    return _UNPRINTABLE.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


class Shown(NamedTuple):
    """Rows that are shown of an object; texts may be of other people."""

    line: str  # the whole of it at a prompt
    facts: Mapping[str, object]  # by name; the rows of the table


class Displayed:
    """Base of what shows itself in one line, and in notebooks as a table."""

    def _shown(self) -> Shown:
        raise NotImplementedError

    def __repr__(self) -> str:
        return " ".join(printable(self._shown().line).split())

    def _repr_html_(self) -> str:
        def text(value: object) -> str:
            return escape(printable(f"{value:.6g}" if isinstance(value, float) else str(value)))

        line, facts = self._shown()
        left = "style='text-align:left'"
        rows = "".join(
            f"<tr><th {left}>{text(name)}</th><td {left}>{text(value)}</td></tr>"
            for name, value in facts.items()
        )
        return f"<table><caption>{text(line)}</caption><tbody>{rows}</tbody></table>"


def line_of(kind: str, name: str, given: Mapping[str, object]) -> str:
    """Write an object as a call: its kind, its name, and what it was given."""
    more = "".join(f", {key}={value!r}" for key, value in given.items())
    return f"{kind}({name!r}{more})"
