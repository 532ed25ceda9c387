"""Representations of objects: one line at a prompt, a table in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import NamedTuple

from mobman.printable import printable


class Shown(NamedTuple):
    """Rows that are shown of an object; texts may be of other people."""

    line: str
    """The whole of it at a prompt."""
    facts: Mapping[str, object]
    """By name; the rows of the table."""


class Displayed:
    """Base of what shows itself in one line, and in notebooks as a table."""

    def _shown(self) -> Shown:
        raise NotImplementedError

    def __repr__(self) -> str:
        return " ".join(printable(self._shown().line).split())

    def _repr_html_(self) -> str:
        line, facts = self._shown()
        rows = "".join(
            f"<tr><th style='text-align:left'>{_text(name)}</th>"
            f"<td style='text-align:left'>{_text(value)}</td></tr>"
            for name, value in facts.items()
        )
        return f"<table><caption>{_text(line)}</caption><tbody>{rows}</tbody></table>"


def _text(value: object) -> str:
    return escape(printable(f"{value:.6g}" if isinstance(value, float) else str(value)))


def line_of(kind: str, name: str, given: Mapping[str, object]) -> str:
    """Write an object as a call: its kind, its name, and what it was given."""
    more = "".join(f", {key}={value!r}" for key, value in given.items())
    return f"{kind}({name!r}{more})"
