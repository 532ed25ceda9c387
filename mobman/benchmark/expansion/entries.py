"""A suite's own controllers, tasks and scenarios, by the names that its grids give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mobman.benchmark.expansion.problems import Problems
from mobman.benchmark.grid import expand
from mobman.controllers.protocol import make_controller
from mobman.simulation.scenario import Scenario, load_scenario
from mobman.tasks.task import check_parameters

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite


@dataclass(frozen=True)
class NamedEntries:
    """One table of a suite, its grids multiplied out."""

    fields: dict[str, dict[str, Any]]
    """By name."""
    members: dict[str, list[str]]
    """Names by the label that stands for them."""

    @classmethod
    def of(
        cls,
        table: str,
        entries: Mapping[str, tuple[Mapping[str, Any], Mapping[str, list[Any]]]],
        problems: Problems,
    ) -> NamedEntries:
        """Those of a table.

        Args:
            table: Its name in the suite.
            entries: Fields and grid by label.
            problems: Where grids that are not valid, and names that two entries have, are noted.
        """
        found: dict[str, dict[str, Any]] = {}
        members: dict[str, list[str]] = {}
        for label, (fields, grid) in entries.items():
            own = problems.attempt(f"{table}.{label}", expand, label, fields, grid) or {}
            for name in own.keys() & found.keys():
                problems.note(f"{table}.{label}: {name!r} is the name of another entry, too")
            found |= own
            members[label] = list(own)
        return cls(found, members)

    def labels(self) -> dict[str, str]:
        """The label that stands for each name."""
        return {name: label for label, names in self.members.items() for name in names}


class Entries:
    """What a suite defines itself, and what its names stand for.

    Args:
        suite: The suite.
        problems: Where it is noted what is wrong with it.

    Attributes:
        controllers: Gains by name.
        tasks: Parameters by name.
        scenarios: Fields by name.
    """

    def __init__(self, suite: Suite, problems: Problems) -> None:
        self._suite, self._problems = suite, problems
        self.controllers = NamedEntries.of(
            "controllers",
            {name: (entry.gains, entry.grid) for name, entry in suite.controllers.items()},
            problems,
        )
        self.tasks = NamedEntries.of(
            "tasks",
            {name: (entry.parameters, entry.grid) for name, entry in suite.tasks.items()},
            problems,
        )
        self.scenarios = NamedEntries.of(
            "scenarios",
            {name: (entry.fields, entry.grid) for name, entry in suite.scenarios.items()},
            problems,
        )
        self._laws = {
            name: suite.controllers[label].law for name, label in self.controllers.labels().items()
        }
        self._tasks = {name: suite.tasks[label].task for name, label in self.tasks.labels().items()}
        self._families = self.scenarios.labels()

    def controllers_of(self, label: str) -> list[str]:
        """The controllers that a label of the file stands for."""
        return self.controllers.members.get(label, [label])

    def law_of(self, controller: str) -> str:
        """The law that a controller is of."""
        return self._laws[controller]

    def task_of(self, task: str) -> tuple[str, dict[str, Any]]:
        """The registered task that a name stands for, and the parameters that it is given."""
        return self._tasks.get(task, task), self.tasks.fields.get(task, {})

    def family_of(self, scenario: str) -> str:
        """The label that a scenario's grid is under; its own name if it is of none."""
        return self._families.get(scenario, scenario)

    def scenario(self, name: str) -> dict[str, Any]:
        """All fields of a scenario: the suite's own, or else a registered one or a file.

        Raises:
            MobmanError: If there is no such scenario, or it is not valid.
        """
        if name in self.scenarios.fields:
            fields = {**self.scenarios.fields[name], "name": name}
            return Scenario(**fields).model_dump(mode="json")
        return load_scenario(name).model_dump(mode="json")

    def check(self) -> None:
        """Note what is wrong with any of the entries, used or not."""
        attempt = self._problems.attempt
        for name, gains in self.controllers.fields.items():
            law = self.law_of(name)
            attempt(f"controller {name!r}", make_controller, law, **gains)
            for number, group in enumerate(self._suite.groups):
                for label, own in group.gains.items():
                    if name in self.controllers_of(label):
                        where = f"controller {name!r} in groups.{number}"
                        attempt(where, make_controller, law, **{**gains, **own})
        for name, task in self._tasks.items():
            attempt(f"task {name!r}", check_parameters, task, self.tasks.fields[name])
        for name in self.scenarios.fields:
            attempt(f"scenario {name!r}", self.scenario, name)
