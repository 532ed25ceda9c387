"""Few patterns for many names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from glob import escape


def patterns(wanted: Sequence[str], every: Iterable[str]) -> list[str]:
    """Patterns that match exactly the wanted names, and names where none does.

    Args:
        wanted: Names to match, in the order in which the patterns are to come.
        every: All names that there are.
    """
    others = [name for name in every if name not in set(wanted)]
    left = list(dict.fromkeys(wanted))
    found: list[str] = []
    while left:
        best = max(
            (p for p in _candidates(left[0]) if not any(fnmatchcase(n, p) for n in others)),
            # of those that say the same the simplest kind, "hand_*", and the longest of that kind
            key=lambda p: (sum(fnmatchcase(n, p) for n in left), p.endswith("*"), len(p)),
            default="",
        )
        if sum(fnmatchcase(name, best) for name in left) < 2:
            best = escape(left[0])
        found.append(best)
        left = [name for name in left if not fnmatchcase(name, best)]
    return found


def _candidates(name: str) -> list[str]:
    """Patterns from the words of a name: how it begins, begins and ends, and ends."""
    words = re.split(r"(?<=[_\-./ ])", name)
    tails = [name[match.start() :] for match in re.finditer(r"[_\-./ ]", name)]
    found = []
    for i in range(1, len(words)):
        head = escape("".join(words[:i]))
        found += [
            f"{head}*",
            *(f"{head}*{escape(tail)}" for tail in tails if len(tail) < len(name)),
        ]
    found += [f"*{escape(tail)}" for tail in tails]
    return found
