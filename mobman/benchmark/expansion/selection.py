"""The robots, controllers, tasks and scenarios that a group means by its names and patterns."""

from __future__ import annotations

from collections.abc import Sequence

from mobman.benchmark.expansion.entries import Entries, NamedEntries
from mobman.benchmark.expansion.problems import Problems
from mobman.benchmark.grid import chosen
from mobman.errors import UnknownNameError
from mobman.robots.catalogue import find_spec, list_robots
from mobman.simulation.scenario import list_scenarios, load_scenario
from mobman.tasks.task import tasks


class Selection:
    """What the names of a group mean, each thing once; unknown ones are noted and left out.

    Args:
        entries: What the suite defines itself.
        problems: Where names that are unknown are noted.
        where: The group's place in the suite.
    """

    def __init__(self, entries: Entries, problems: Problems, where: str) -> None:
        self._entries, self._problems, self._where = entries, problems, where

    def controllers(self, patterns: Sequence[str] | None) -> list[str]:
        """The suite's controllers that are meant; None means all of them."""
        own = self._entries.controllers
        return self._chosen("label", ["*"] if patterns is None else patterns, own, [])

    def robots(self, patterns: Sequence[str]) -> list[str]:
        """The robots that are meant; one may be a description's file."""
        found: dict[str, None] = {}
        attempt, where = self._problems.attempt, self._where
        for pattern in patterns:
            if any(mark in pattern for mark in "*?["):
                names = attempt(where, chosen, "robot", pattern, list_robots(), {}) or []
                found |= dict.fromkeys(names)
            elif attempt(where, find_spec, pattern) is not None:
                found[pattern] = None
        return list(found)

    def tasks(self, patterns: Sequence[str]) -> list[str]:
        """The tasks that are meant: the suite's own and those that are registered."""
        return self._chosen("task", patterns, self._entries.tasks, tasks.names())

    def scenarios(self, patterns: Sequence[str]) -> list[str]:
        """The scenarios that are meant: the suite's own, those that have names, and files."""
        found: dict[str, None] = {}
        known = list_scenarios()
        for pattern in patterns:
            if not pattern.endswith(".toml"):
                names = self._chosen("scenario", [pattern], self._entries.scenarios, known)
                found |= dict.fromkeys(names)
                continue
            file = self._problems.attempt(f"scenario {pattern!r}", load_scenario, pattern)
            if file is not None:
                found[pattern] = None
        return list(found)

    def _chosen(
        self, kind: str, patterns: Sequence[str], own: NamedEntries, others: list[str]
    ) -> list[str]:
        found: dict[str, None] = {}
        names = list(dict.fromkeys([*own.fields, *others]))
        for pattern in patterns:
            try:
                meant = chosen(f"{kind} in {self._where}", pattern, names, own.members)
            except UnknownNameError as error:
                self._problems.note(str(error))
            else:
                found |= dict.fromkeys(meant)
        return list(found)
