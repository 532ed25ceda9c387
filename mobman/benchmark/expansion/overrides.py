"""Which overrides of a suite are for which runs."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from mobman.benchmark.expansion.entries import Entries

if TYPE_CHECKING:
    from mobman.benchmark.suite import Override, Suite, Where


class Overrides:
    """A suite's overrides; it is kept which of them were for any run.

    Args:
        suite: The suite.
        entries: What it defines itself.
    """

    def __init__(self, suite: Suite, entries: Entries) -> None:
        self._overrides = suite.overrides
        self._members = {
            "tasks": entries.tasks.members,
            "scenarios": entries.scenarios.members,
            "controllers": entries.controllers.members,
        }
        self._used: set[int] = set()

    def of(self, names: Mapping[str, str]) -> list[Override] | None:
        """The overrides of a run, later ones last; None if one of them leaves the run out.

        Args:
            names: Those of its robot, task, scenario and controller, by the fields of
                :class:`mobman.benchmark.suite.Where`.
        """
        found = []
        for number, override in enumerate(self._overrides):
            if self._fits(override.where, names):
                self._used.add(number)
                if override.skip:
                    return None
                found.append(override)
        return found

    def unused(self) -> list[int]:
        """The positions of those that were for no run up to now."""
        return [number for number in range(len(self._overrides)) if number not in self._used]

    def _fits(self, where: Where, names: Mapping[str, str]) -> bool:
        for field, name in names.items():
            patterns = getattr(where, field)
            members = self._members.get(field, {})
            if patterns is not None and not any(
                fnmatchcase(name, pattern) or name in members.get(pattern, [])
                for pattern in patterns
            ):
                return False
        return True
