"""Every run of a suite by its names, before it is known what these stand for."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from mobman.benchmark.expansion.entries import Entries
from mobman.benchmark.expansion.overrides import Overrides
from mobman.benchmark.expansion.problems import Problems
from mobman.benchmark.expansion.selection import Selection

if TYPE_CHECKING:
    from mobman.benchmark.suite import Changes, Group, Suite


MOST_RUNS = 100_000
"""Of a group: what is held in memory of a suite, and listed, grows with them."""


@dataclass(frozen=True)
class Place:
    """A run by its names."""

    where: str
    """The part of the file that asks for it."""
    robot: str
    task: str
    scenario: str
    label: str
    """The controller's name."""
    gains: dict[str, Any]
    """Of the group and of overrides."""
    seed: int
    duration: float
    """s."""
    dt: float
    """Sampling period (s)."""

    @property
    def controller_key(self) -> tuple[str, str]:
        """Equal for places whose controllers have the same name and gains."""
        return self.label, json.dumps(self.gains, sort_keys=True, default=str)


def places_of(suite: Suite, entries: Entries, problems: Problems) -> list[Place]:
    """Every run in the order of the file, overrides applied.

    Args:
        suite: The suite.
        entries: What it defines itself.
        problems: Where it is noted which names are unknown, and so left out, and which gains and
            overrides are for no run.
    """
    overrides = Overrides(suite, entries)
    found: list[Place] = []
    for number, group in enumerate(suite.groups):
        where = f"groups.{number}"
        selection = Selection(entries, problems, where)
        labels = selection.controllers(group.controllers)
        robots = selection.robots(group.robots)
        tasks = selection.tasks(group.tasks)
        scenarios = selection.scenarios(group.scenarios)
        gains = _gains_by_name(group, where, labels, entries, problems)
        cells = len(robots) * len(tasks) * len(scenarios) * len(labels)
        seeds, periods = group.seeds or suite.seeds, group.dt or suite.dt
        count = cells * len(seeds) * (len(periods) if isinstance(periods, list) else 1)
        if count > MOST_RUNS:
            problems.note(f"{where} asks for {count} runs; allowed: {MOST_RUNS}")
            continue
        for robot, task, scenario, label in product(robots, tasks, scenarios, labels):
            names = {"robots": robot, "tasks": task, "scenarios": scenario, "controllers": label}
            found += _of_cell(where, suite, group, names, gains.get(label, {}), overrides)
    for number in overrides.unused():
        problems.note(f"overrides.{number} fits no run; see its 'where'")
    return found


def _of_cell(
    where: str,
    suite: Suite,
    group: Group,
    names: Mapping[str, str],
    gains: Mapping[str, Any],
    overrides: Overrides,
) -> Iterator[Place]:
    """One for each sampling period and seed."""
    fitting = overrides.of(names)
    if fitting is None:
        return
    parts: list[Suite | Changes] = [suite, group, *fitting]
    own = dict(gains)
    for override in fitting:
        own |= override.gains
    duration = _last(part.duration for part in parts)
    periods = _last(part.dt for part in parts)
    for dt, seed in product(
        periods if isinstance(periods, list) else [periods],
        _last(part.seeds for part in parts),
    ):
        yield Place(
            where=where,
            robot=names["robots"],
            task=names["tasks"],
            scenario=names["scenarios"],
            label=names["controllers"],
            gains=own,
            seed=seed,
            duration=duration,
            dt=dt,
        )


def _gains_by_name(
    group: Group, where: str, labels: list[str], entries: Entries, problems: Problems
) -> dict[str, dict[str, Any]]:
    """The group's own gains, by the names that their labels stand for."""
    found: dict[str, dict[str, Any]] = {}
    for label, own in group.gains.items():
        names = entries.controllers_of(label)
        if not set(names) & set(labels):
            problems.note(f"{where}: gains for {label!r}, which is not among its controllers")
        found |= {name: found.get(name, {}) | own for name in names}
    return found


def _last(values: Iterator[Any]) -> Any:
    """The last that is given."""
    return [value for value in values if value is not None][-1]
