"""A table, before it is HTML or Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

Mark = Literal["", "best", "bad", "faint"]


@dataclass(frozen=True)
class Entry:
    """A place in a table."""

    text: str
    mark: Mark = ""
    """Best of its row; bad, as a run that diverged; or faint."""
    detail: str = ""
    """More about it, shown on demand."""
    label: str = ""
    """The controller whose colour it shows."""
    link: str = ""
    """Relative address."""
    unit: str = ""
    """Shown small behind the text."""
    number: bool = True
    """Whether it is aligned as one."""


@dataclass(frozen=True)
class Row:
    """A row: what it is about, then its entries."""

    head: Entry
    entries: Sequence[Entry]
    title: bool = False
    """Whether it is a heading over the rows that follow, without entries."""


@dataclass(frozen=True)
class Table:
    """Columns with headings, and rows."""

    caption: str
    columns: Sequence[Entry]
    """Of the rows' heads first."""
    rows: Sequence[Row] = field(default_factory=list)


def text(content: str, mark: Mark = "", **more: str) -> Entry:
    """An entry that is no number."""
    return Entry(content, mark, number=False, **more)


def heading(content: str) -> Row:
    """A heading inside a table."""
    return Row(text(content), (), title=True)


def first_rows(table: Table, most: int) -> Table:
    """A table of the first rows of another, so many at the most."""
    return replace(table, rows=table.rows[:most])
