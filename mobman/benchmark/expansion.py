"""From a suite to its runs."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mobman.benchmark.fingerprint import fingerprint
from mobman.benchmark.grid import chosen, expand
from mobman.benchmark.run_spec import RunSpec
from mobman.controllers.protocol import controllers, make_controller
from mobman.errors import MobmanError, SpecError, UnknownNameError
from mobman.model.build import load_robot
from mobman.robots.catalogue import find_spec, list_robots
from mobman.simulation.scenario import Scenario, list_scenarios, load_scenario
from mobman.tasks.task import check_parameters, make_task, task_parameters, tasks
from mobman.version import __version__

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite

T = TypeVar("T")


@dataclass(frozen=True)
class _Place:
    """A run by its names."""

    where: str
    """The part of the file that asks for it."""
    robot: str
    task: str
    scenario: str
    label: str
    gains: dict[str, Any]
    """Of the group and of overrides."""
    seed: int
    duration: float
    dt: float


class Expansion:
    """A suite's names, what they stand for, and its runs; every fault is collected.

    Args:
        suite: The suite.
    """

    def __init__(self, suite: Suite) -> None:
        self._suite = suite
        self._problems: dict[str, None] = {}
        self._used: set[int] = set()
        """Overrides that fit a run."""
        self._controllers, self._controller_members = self._expanded(
            "controllers",
            {name: (entry.gains, entry.grid) for name, entry in suite.controllers.items()},
        )
        self._tasks, self._task_members = self._expanded(
            "tasks", {name: (entry.parameters, entry.grid) for name, entry in suite.tasks.items()}
        )
        self._scenarios, self._scenario_members = self._expanded(
            "scenarios",
            {name: (entry.fields, entry.grid) for name, entry in suite.scenarios.items()},
        )
        self._law = {
            name: suite.controllers[label].law
            for label, names in self._controller_members.items()
            for name in names
        }
        self._task = {
            name: suite.tasks[label].task
            for label, names in self._task_members.items()
            for name in names
        }
        self._family = {
            name: label for label, names in self._scenario_members.items() for name in names
        }

    def size(self) -> int:
        """See :meth:`Suite.size`."""
        places = list(self._places())
        self._raise()
        return len(
            {(p.robot, p.task, p.scenario, p.label, p.seed, p.dt, p.duration) for p in places}
        )

    def runs(self) -> list[RunSpec]:
        """See :meth:`Suite.runs`."""
        self._check_entries()
        places = list(self._places())
        whole = self._resolved(places)
        self._raise()
        runs: dict[str, RunSpec] = {}
        by_name: dict[tuple[Any, ...], str] = {}
        for place in places:
            run = whole(place)
            run_id = run.run_id
            other = runs.setdefault(run_id, run)
            for name, first in ((run.label, other.label), (run.task, other.task)):
                if first != name:
                    self._note(f"{place.where}: labels {first!r} and {name!r} are the same run")
            if by_name.setdefault((run.cell, run.label, run.seed), run_id) != run_id:
                self._note(f"{place.where}: {run} is asked for twice, with other gains")
        self._raise()
        return list(runs.values())

    def _check_entries(self) -> None:
        """Note what is wrong with the suite's own controllers, tasks and scenarios, used or not."""
        for label, gains in self._controllers.items():
            self._try(f"controller {label!r}", make_controller, self._law[label], **gains)
            for number, group in enumerate(self._suite.groups):
                for own in (
                    group.gains[name] for name in group.gains if label in self._names(name)
                ):
                    where = f"controller {label!r} in groups.{number}"
                    self._try(where, make_controller, self._law[label], **{**gains, **own})
        for label, task in self._task.items():
            self._try(f"task {label!r}", check_parameters, task, self._tasks[label])
        for label in self._scenarios:
            self._try(f"scenario {label!r}", self._scenario, label)

    def _names(self, label: str) -> list[str]:
        """The controllers that a label of the file means."""
        return self._controller_members.get(label, [label])

    def _resolved(self, places: list[_Place]) -> Callable[[_Place], RunSpec]:
        """What makes a run of a place; each thing that several runs share is made once."""
        suite = self._suite
        robots: dict[str, Any] = {
            name: self._try(f"robot {name!r}", _fingerprint_of, name)
            for name in dict.fromkeys(place.robot for place in places)
        }
        scenarios: dict[str, Any] = {
            name: self._try(f"scenario {name!r}", self._scenario, name)
            for name in dict.fromkeys(place.scenario for place in places)
        }
        laws: dict[tuple[str, str], Any] = {
            key: self._try(self._of_controller(place), self._settings, place)
            for key, place in {_controller_key(place): place for place in places}.items()
        }
        aims: dict[tuple[str, str], Any] = {}
        for place in places:
            key = (place.robot, place.task)
            if key not in aims and robots[place.robot] is not None:
                aims[key] = self._try(
                    f"task {place.task!r} for robot {place.robot!r}", self._aim, *key
                )

        codes = {
            key: _code(controllers.get(key[0]), tasks.get(key[1]))
            for key in {(self._law[p.label], self._task_of(p.task)[0]) for p in places}
        }

        def whole(place: _Place) -> RunSpec:
            gains, settings = laws[_controller_key(place)]
            law = self._law[place.label]
            name, given = self._task_of(place.task)
            return RunSpec(
                label=place.label,
                robot=place.robot,
                robot_sha256=robots[place.robot],
                law=law,
                gains=gains,
                settings=settings,
                task=place.task,
                task_name=name,
                task_given=given,
                task_parameters=aims[place.robot, place.task],
                scenario=scenarios[place.scenario],
                family=self._family.get(place.scenario, place.scenario),
                seed=place.seed,
                duration=place.duration,
                dt=place.dt,
                record_period=suite.record_period,
                compression=suite.compression,
                code_sha256=codes[law, name],
                version=__version__,
            )

        return whole

    def _places(self) -> Iterator[_Place]:
        """Every run by its names, overrides applied; unknown names are noted and left out."""
        for number, group in enumerate(self._suite.groups):
            where = f"groups.{number}"
            labels = self._chosen(
                f"label in {where}",
                ["*"] if group.controllers is None else group.controllers,
                list(self._controllers),
                self._controller_members,
            )
            robots = self._robots(where, group.robots)
            aims = self._chosen(
                f"task in {where}",
                group.tasks,
                list(dict.fromkeys([*self._tasks, *tasks.names()])),
                self._task_members,
            )
            scenarios = self._chosen(
                f"scenario in {where}",
                group.scenarios,
                list(dict.fromkeys([*self._scenarios, *list_scenarios()])),
                self._scenario_members,
                files=True,
            )
            gains = self._gains_by_label(where, group.gains, labels)
            for robot, task, scenario, label in product(robots, aims, scenarios, labels):
                yield from self._of_cell(where, group, robot, task, scenario, label, gains)
        for number in range(len(self._suite.overrides)):
            if number not in self._used:
                self._note(f"overrides.{number} fits no run; see its 'where'")

    def _of_cell(
        self,
        where: str,
        group: Any,
        robot: str,
        task: str,
        scenario: str,
        label: str,
        gains: Mapping[str, dict[str, Any]],
    ) -> Iterator[_Place]:
        suite = self._suite
        own = dict(gains.get(label, {}))
        parts = [suite, group]
        names = {"robots": robot, "tasks": task, "scenarios": scenario, "controllers": label}
        for number, override in enumerate(suite.overrides):
            if self._fits(override.where, names):
                self._used.add(number)
                if override.skip:
                    return
                own |= override.gains
                parts.append(override)
        duration = _last(part.duration for part in parts)
        periods = _last(part.dt for part in parts)
        for dt, seed in product(
            periods if isinstance(periods, list) else [periods],
            _last(part.seeds for part in parts),
        ):
            yield _Place(where, robot, task, scenario, label, own, seed, duration, dt)

    def _fits(self, where: Any, names: Mapping[str, str]) -> bool:
        members = {
            "tasks": self._task_members,
            "scenarios": self._scenario_members,
            "controllers": self._controller_members,
        }
        for field, name in names.items():
            patterns = getattr(where, field)
            if patterns is not None and not any(
                fnmatchcase(name, pattern) or name in members.get(field, {}).get(pattern, [])
                for pattern in patterns
            ):
                return False
        return True

    def _expanded(
        self, field: str, entries: Mapping[str, tuple[Mapping[str, Any], Mapping[str, list[Any]]]]
    ) -> tuple[dict[str, dict[str, Any]], dict[str, list[str]]]:
        """Fields by name, and names by label."""
        found: dict[str, dict[str, Any]] = {}
        members: dict[str, list[str]] = {}
        for label, (fields, grid) in entries.items():
            own = self._try(f"{field}.{label}", expand, label, fields, grid) or {}
            for name in own.keys() & found.keys():
                self._note(f"{field}.{label}: {name!r} is the name of another entry, too")
            found |= own
            members[label] = list(own)
        return found, members

    def _robots(self, where: str, patterns: list[str]) -> list[str]:
        found: dict[str, None] = {}
        for pattern in patterns:
            if any(mark in pattern for mark in "*?["):
                names = self._try(where, chosen, "robot", pattern, list_robots(), {}) or []
                found |= dict.fromkeys(names)
            elif self._try(where, find_spec, pattern) is not None:
                found[pattern] = None
        return list(found)

    def _chosen(
        self,
        kind: str,
        patterns: list[str],
        names: list[str],
        members: Mapping[str, list[str]],
        *,
        files: bool = False,
    ) -> list[str]:
        found: dict[str, None] = {}
        for pattern in patterns:
            if files and pattern.endswith(".toml"):
                if self._try(f"scenario {pattern!r}", load_scenario, pattern) is not None:
                    found[pattern] = None
                continue
            try:
                found |= dict.fromkeys(chosen(kind, pattern, names, members))
            except UnknownNameError as error:
                self._note(str(error))
        return list(found)

    def _gains_by_label(
        self, where: str, gains: Mapping[str, dict[str, Any]], labels: list[str]
    ) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        for label, own in gains.items():
            names = self._names(label)
            if not set(names) & set(labels):
                self._note(f"{where}: gains for {label!r}, which is not among its controllers")
            found |= {name: found.get(name, {}) | own for name in names}
        return found

    def _scenario(self, name: str) -> dict[str, Any]:
        if name in self._scenarios:
            fields = {**self._scenarios[name], "name": name}
            return Scenario(**fields).model_dump(mode="json")
        return load_scenario(name).model_dump(mode="json")

    def _of_controller(self, place: _Place) -> str:
        own = f" in {place.where}" if place.gains else ""
        return f"controller {place.label!r}{own}"

    def _settings(self, place: _Place) -> tuple[dict[str, Any], dict[str, Any]]:
        """Gains as given, and all of them."""
        gains = {**self._controllers[place.label], **place.gains}
        controller = make_controller(self._law[place.label], **gains)
        settings: dict[str, Any] = getattr(controller, "settings", dict)()
        return gains, settings

    def _task_of(self, label: str) -> tuple[str, dict[str, Any]]:
        return self._task.get(label, label), self._tasks.get(label, {})

    def _aim(self, robot: str, task: str) -> dict[str, Any]:
        name, given = self._task_of(task)
        return task_parameters(make_task(name, load_robot(robot), **given))

    def _try(
        self, where: str, function: Callable[..., T], /, *arguments: Any, **options: Any
    ) -> T | None:
        try:
            return function(*arguments, **options)
        except MobmanError as error:
            told = str(error)
            self._note(told if told.startswith(f"{where}:") else f"{where}: {told}")
            return None

    def _note(self, problem: str) -> None:
        self._problems[problem] = None

    def _raise(self) -> None:
        if self._problems:
            raise SpecError(f"suite {self._suite.name!r}: " + "; ".join(self._problems))


def _controller_key(place: _Place) -> tuple[str, str]:
    return place.label, json.dumps(place.gains, sort_keys=True, default=str)


def _last(values: Iterator[Any]) -> Any:
    """The last that is given."""
    return [value for value in values if value is not None][-1]


def _fingerprint_of(robot: str) -> str:
    return fingerprint(find_spec(robot))


def _code(*things: Any) -> str:
    """Of the sources of what is not mobman's own: who edits a law wants its runs anew."""
    own = Path(__file__).parents[1]
    digest, foreign = hashlib.sha256(), False
    for thing in things:
        try:
            path = Path(inspect.getfile(thing)).resolve()
        except (
            TypeError,
            OSError,
        ):  # made in a session, or compiled: there is no source to look at
            continue
        if not path.is_relative_to(own) and path.is_file():
            digest.update(path.read_bytes())
            foreign = True
    return digest.hexdigest()[:16] if foreign else ""
