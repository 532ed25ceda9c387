"""What is wrong with a URDF, gathered so that all of it is told at once."""

from __future__ import annotations

import difflib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Mapping

from mobman.errors import SpecError

_TOLD = 5
_LOOKED_THROUGH = 5000


class Problems:
    """The problems found in a file so far.

    Args:
        where: What to call the file in messages.
        lines: The line of each of its elements.
    """

    def __init__(self, where: str, lines: Mapping[ET.Element, int]) -> None:
        self._where = where
        self._lines = lines
        self._found: list[tuple[int, str]] = []

    def __len__(self) -> int:
        return len(self._found)

    def add(self, element: ET.Element, text: str) -> None:
        """Note one.

        Args:
            element: Where it is.
            text: The link or joint, the field, what was found, and what is allowed.
        """
        self._found.append((self._lines.get(element, 0), text))

    def line(self, element: ET.Element) -> int:
        """The line on which an element starts."""
        return self._lines.get(element, 0)

    def near(self, name: str, names: Collection[str]) -> str:
        """The names that one may have been meant for, as the end of a message; empty if there is none.

        Of a file with many problems only the first few are told, and looking takes its time.
        """
        if len(self) >= 2 * _TOLD or len(names) > _LOOKED_THROUGH:
            return ""
        found = difflib.get_close_matches(name, sorted(names), n=3, cutoff=0.6)
        return f"; near it: {listed(found)}" if found else ""

    def raise_any(self) -> None:
        """
        Raises:
            SpecError: If there are problems, with the first few of them in the file's order.
        """
        in_order = sorted(self._found, key=lambda problem: problem[0])
        found = [f"line {line}: {text}" for line, text in in_order]
        if not found:
            return
        if len(found) == 1:
            raise SpecError(f"{self._where}, {found[0]}")
        told = [f"({i}) {text}" for i, text in enumerate(found[:_TOLD], start=1)]
        more = f"; ... and {len(found) - _TOLD} more" if len(found) > _TOLD else ""
        raise SpecError(f"{self._where} has {len(found)} problems: {'; '.join(told)}{more}")


def listed(names: Iterable[str], most: int = _TOLD) -> str:
    """Names in one line; of many, the first few and how many more there are."""
    given = list(names)
    more = f", ... and {len(given) - most} more" if len(given) > most else ""
    return ", ".join(given[:most]) + more
