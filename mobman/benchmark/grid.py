"""Grids: one entry of a suite that stands for several, by the values that its fields take."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from fnmatch import fnmatchcase
from itertools import product
from typing import Any

from mobman.errors import UnknownNameError, UsageError

MOST_ENTRIES = 10_000


def expand(name: str, fields: Mapping[str, Any], grid: Mapping[str, list[Any]]) -> dict[str, Any]:
    """All combinations of a grid's values, each with a name of its own.

    Args:
        name: The entry's label.
        fields: What all of them have.
        grid: Values by field; ``"a.b.0"`` is a field within a field, or an entry of a list.

    Returns:
        Fields by name: the label, followed by the values; the label alone if there is no grid.

    Raises:
        UsageError: If a field of the grid is within something that has no fields, or two
            combinations have one name, or there are more than :data:`MOST_ENTRIES`.
    """
    count = math.prod(len(values) for values in grid.values())
    if count > MOST_ENTRIES:
        raise UsageError(f"grid: it has {count} combinations; allowed: {MOST_ENTRIES}")
    entries = {}
    for values in product(*grid.values()):
        content = copy.deepcopy(dict(fields))
        parts = [name]
        for (path, choices), value in zip(grid.items(), values, strict=True):
            _set(content, path, value)
            parts.append(_text(value, choices.index(value)))
        full = "-".join(parts)
        if full in entries:
            raise UsageError(f"grid: two of its entries are called {full!r}")
        entries[full] = content
    return entries


def chosen(
    kind: str, pattern: str, names: list[str], members: Mapping[str, list[str]]
) -> list[str]:
    """The names that a suite means: one, all of a grid, or all that fit a pattern such as ``"*"``.

    Raises:
        UnknownNameError: If there is none.
    """
    if pattern in members:
        return members[pattern]
    found = (
        [pattern] if pattern in names else [name for name in names if fnmatchcase(name, pattern)]
    )
    if not found:
        raise UnknownNameError(kind, pattern, dict.fromkeys([*names, *members]))
    return found


def _set(content: Any, path: str, value: Any) -> None:
    *parents, last = path.split(".")
    here = content
    for part in parents:
        here = here.setdefault(part, {}) if isinstance(here, dict) else _item(here, part, path)
    if isinstance(here, dict):
        here[last] = value
    else:
        _item(here, last, path)
        here[int(last)] = value


def _item(here: Any, part: str, path: str) -> Any:
    if isinstance(here, list) and part.isdigit() and int(part) < len(here):
        return here[int(part)]
    raise UsageError(f"grid field {path!r}: {part!r} is not in {here!r}")


def _text(value: Any, position: int) -> str:
    """A value as part of a name; one that is no number or word, by its position."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:g}"
    if isinstance(value, str) and value.replace("-", "").replace("_", "").isalnum():
        return value
    return str(position + 1)
