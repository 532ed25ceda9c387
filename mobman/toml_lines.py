"""The lines of a TOML file on which its fields stand."""

from __future__ import annotations

import re
from collections.abc import Sequence

_KEY = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
_DOTTED = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_DOTTED})\s*\]")
_FIELD = re.compile(rf"\s*({_DOTTED})\s*=")

Place = tuple[str | int, ...]


class TomlLines:
    """Line numbers by field; a guess by the text, for messages only.

    Args:
        text: Of a file that is valid TOML.
    """

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._found: dict[Place, int] = {}
        counts: dict[Place, int] = {}
        table: Place = ()
        within = ""  # delimiter of a text over several lines
        for number, line in enumerate(self._lines, start=1):
            if within:
                within = "" if line.count(within) % 2 else within
                continue
            for delimiter in ('"""', "'''"):
                if line.count(delimiter) % 2:
                    within = delimiter
            if header := _HEADER.match(line):
                table = _resolved(_parts(header[2]), counts)
                if header[1] == "[[":
                    counts[table] = counts.get(table, -1) + 1
                    table = (*table, counts[table])
                self._found.setdefault(table, number)
            elif field := _FIELD.match(line):
                self._found.setdefault((*table, *_parts(field[1])), number)

    def line(self, place: Sequence[str | int], word: str = "") -> int | None:
        """The line of a field, or of the table that it would be in; None if that is the whole file.

        Args:
            place: Names of tables and fields, and numbers in arrays, from the outermost on.
            word: A text of the field's value: the first line with it from there on, if there is one
                before the next table.
        """
        for n in range(len(place), 0, -1):
            start = self._found.get(tuple(place[:n]))
            if start is not None:
                break
        else:
            return None
        for number in range(start, len(self._lines) + 1) if word else ():
            line = self._lines[number - 1]
            if number > start and _HEADER.match(line):
                break
            if f'"{word}"' in line or f"'{word}'" in line:
                return number
        return start


def _parts(dotted: str) -> Place:
    return tuple(part.strip("\"'") for part in re.findall(_KEY, dotted))


def _resolved(parts: Place, counts: dict[Place, int]) -> Place:
    """A header's path with the numbers of the arrays that it goes through."""
    found: Place = ()
    for i, part in enumerate(parts):
        found = (*found, part)
        if found in counts and i < len(parts) - 1:
            found = (*found, counts[found])
    return found
