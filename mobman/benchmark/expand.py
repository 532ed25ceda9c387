"""From a suite to its runs: grids, names and patterns, overrides, and what all of them stand for."""

from __future__ import annotations

import copy
import json
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import product
from typing import Any, NamedTuple, TypeVar

from mobman.benchmark.suite_tables import Changes, Override, SuiteTables
from mobman.controllers.protocol import controllers, gains_by_field, make_controller
from mobman.errors import MobmanError, SpecError, UnknownNameError, UsageError
from mobman.model.build import build_robot, load_robot
from mobman.model.platforms.custom import without_code
from mobman.model.platforms.platform import platforms
from mobman.robots.catalogue import find_spec, list_robots, origin_of
from mobman.simulation.placements import placements
from mobman.simulation.run_spec import RunSpec, fingerprint, foreign_code_sha256
from mobman.simulation.scenario import Scenario, list_scenarios, load_scenario
from mobman.tasks.task import check_parameters, task_parameters, tasks
from mobman.toml_model import Place, TomlLines, at_lines

MOST_RUNS = 100_000
"""Runs of a group: what is held in memory of a suite, and listed, grows with them."""
MOST_ENTRIES = 10_000

T = TypeVar("T")

_placed: dict[tuple[Any, ...], dict[int, dict[str, Any]]] = {}
"""Fields of runs at placements that were drawn in this process: following a task takes 0.1 s."""
_said: set[str] = set()
"""Warnings that were given in this process: several suites mean the same robots."""


def runs_of(suite: SuiteTables, lines: TomlLines | None = None) -> list[RunSpec]:
    """Every run of a suite, in the order of the file, whose lines are for messages.

    Raises:
        SpecError: With everything that is wrong, also with entries that no run is of: names, gains,
            parameters, grids, overrides, and runs that are there twice under different names or with
            different gains.
    """
    expansion = _Expansion(suite, lines)
    expansion.check()
    planned = expansion.resolve(list(expansion.planned()))
    expansion.require_sound()
    runs: dict[str, RunSpec] = {}
    by_name: dict[tuple[Any, ...], str] = {}
    for plan in planned:
        run = expansion.run(plan)
        other = runs.setdefault(run.run_id, run)
        for field, names in (("label", "labels"), ("task", "labels"), ("robot", "robots")):
            first, second = getattr(other, field), getattr(run, field)
            if first != second:
                expansion.note(f"{plan.where}: {names} {first!r} and {second!r} are the same run")
        if by_name.setdefault((run.cell, run.label, run.seed), run.run_id) != run.run_id:
            expansion.note(f"{plan.where}: {run} is asked for twice, with other gains")
    if not runs:
        expansion.note("its groups and overrides leave no run")
    expansion.require_sound()
    return list(runs.values())


def number_of_runs(suite: SuiteTables, lines: TomlLines | None = None) -> int:
    """Number of a suite's runs, by the names alone: no gain is checked, no robot's code is run.

    Raises:
        SpecError: With all names that are unknown, grids that are not valid, and overrides that fit no
            run.
    """
    expansion = _Expansion(suite, lines)
    with without_code():
        found = {plan._replace(where="", gains=None) for plan in expansion.planned()}
    expansion.require_sound()
    return len(found)


class _Plan(NamedTuple):
    """A run by its names."""

    where: str  # the part of the file that lists it
    robot: str
    task: str
    scenario: str
    label: str  # the controller's name
    gains: Any  # gains of the group and of overrides
    seed: int
    duration: float
    dt: float
    placement: int

    @property
    def controller(self) -> tuple[str, str]:
        """Equal for runs whose controllers have the same name and gains."""
        return self.label, json.dumps(self.gains, sort_keys=True, default=str)


class _Table:
    """The controllers, tasks or scenarios of a suite, its grids multiplied out: fields by name, names by
    the label that stands for them, and the label of each name."""

    def __init__(self, entries: Mapping[str, Any], kind: str, field: str, own: _Expansion) -> None:
        self.fields: dict[str, dict[str, Any]] = {}
        self.members: dict[str, list[str]] = {}
        for label, entry in entries.items():
            where = f"{kind}.{label}"
            found = own.attempt(where, expand, label, getattr(entry, field), entry.grid) or {}
            for name in found.keys() & self.fields.keys():
                own.note(f"{where}: {name!r} is the name of another entry, too")
            self.fields |= found
            self.members[label] = list(found)
        self.labels = {name: label for label, names in self.members.items() for name in names}


class _Expansion:
    """The runs of a suite, and its faults; each thing that several runs share is made once."""

    def __init__(self, suite: SuiteTables, lines: TomlLines | None) -> None:
        self._suite, self._lines = suite, lines
        self._faults: dict[str, None] = {}  # each once, in the order in which they are met
        self._controllers = _Table(suite.controllers, "controllers", "gains", self)
        self._tasks = _Table(suite.tasks, "tasks", "parameters", self)
        self._scenarios = _Table(suite.scenarios, "scenarios", "fields", self)
        self._named: set[str] = set()  # robots that the suite names, rather than by a pattern
        self._robots: dict[str, Any] = {}
        self._placed: dict[tuple[str, str], Any] = {}
        self._resolved_scenarios: dict[str, Any] = {}
        self._laws: dict[tuple[str, str], Any] = {}
        self._codes: dict[tuple[str, ...], str] = {}

    def note(self, fault: str) -> None:
        """Keep a fault."""
        self._faults[fault] = None

    def attempt(
        self, where: str, function: Callable[..., T], /, *args: Any, **options: Any
    ) -> T | None:
        """The result of a function; None, with its error noted, if it raises one of mobman's."""
        try:
            return function(*args, **options)
        except MobmanError as error:
            text = str(error)
            self.note(text if text.startswith(f"{where}:") else f"{where}: {text}")
            return None

    def require_sound(self) -> None:
        """Raise a SpecError with all faults, if there are any."""
        if self._faults:
            faults, heading = list(self._faults), f"suite {self._suite.name!r}"
            if self._lines is not None:
                words = {fault: found[1] for fault in faults if (found := _UNKNOWN.search(fault))}
                faults = at_lines({f: _place_of(f) for f in faults}, self._lines, words)
            raise SpecError(f"{heading}: {'; '.join(faults)}", heading, faults)

    def check(self) -> None:
        """Note what is wrong with any of the suite's own entries, used or not."""
        laws = {entry.law for entry in self._suite.controllers.values()}
        known = map(controllers.get, laws.intersection(controllers.names()))
        if self._suite.monitor and not any(hasattr(law, "monitored_signals") for law in known):
            self.note("monitor: none of its controllers has sliding variables")
        for name, gains in self._controllers.fields.items():
            label, law = self._controllers.labels[name], self._law_of(name)
            self._check_gains(f"controller {name!r}", law, gains)
            for number, group in enumerate(self._suite.groups):
                for meant in (key for key in group.gains if key in (name, label)):
                    where = f"controller {name!r} in groups.{number}"
                    self._check_gains(where, law, {**gains, **group.gains[meant]})
        for name, parameters in self._tasks.fields.items():
            task = self._task_of(name)[0]
            checked = self.attempt(f"task {name!r}", check_parameters, task, parameters) or {}
            # a file's content in the place of its path: a run depends on that, and workers need no file
            contents = {key: value for key, value in checked.items() if isinstance(value, dict)}
            self._tasks.fields[name] = {**parameters, **contents}
        for name in self._scenarios.fields:
            self.attempt(f"scenario {name!r}", self._scenario, name)

    def _check_gains(self, where: str, law: str, gains: Mapping[str, Any]) -> None:
        """Note each gain that is unknown, and what is wrong with the others."""
        known = {
            name: value
            for name, value in gains.items()
            if self.attempt(where, gains_by_field, law, {name: value}) is not None
        }
        if known or not gains:
            self.attempt(where, make_controller, law, **known)

    # Names and patterns

    def planned(self) -> Iterator[_Plan]:
        """Every run by its names, in the order of the file, overrides applied; it is noted which names
        are unknown, and so left out, and which gains and overrides are for no run."""
        suite, used = self._suite, set[int]()
        for number, group in enumerate(suite.groups):
            where = f"groups.{number}"
            labels = self._chosen("label", where, group.controllers or ["*"], self._controllers)
            robots = self._chosen_robots(where, group.robots)
            aims = self._chosen("task", where, group.tasks, self._tasks, tasks.names())
            scenarios = self._chosen_scenarios(where, group.scenarios)
            gains: dict[str, dict[str, Any]] = {}
            for label, own in group.gains.items():
                names = self._controllers.members.get(label, [label])
                if not set(names) & set(labels):
                    self.note(f"{where}: gains for {label!r}, which is not among its controllers")
                for name in names:
                    gains[name] = gains.get(name, {}) | own
            periods, seeds = group.dt or suite.dt, group.seeds or suite.seeds
            each = len(seeds) * (len(periods) if isinstance(periods, list) else 1)
            each *= group.placements or suite.placements
            count = len(robots) * len(aims) * len(scenarios) * len(labels) * each
            if count > MOST_RUNS:
                self.note(f"{where} asks for {count} runs; allowed: {MOST_RUNS}")
                continue
            for cell in product(robots, aims, scenarios, labels):
                overrides = []
                for i, override in enumerate(suite.overrides):
                    if self._fits(override, cell):
                        used.add(i)
                        overrides.append(override)
                        if override.skip:
                            break
                else:
                    own = dict(gains.get(cell[3], {}))
                    for override in overrides:
                        own |= override.gains
                    # of the rest, the last that is given
                    parts: list[SuiteTables | Changes] = [suite, group, *overrides]
                    duration, periods, seeds, placements = (
                        [value for part in parts if (value := getattr(part, name)) is not None][-1]
                        for name in ("duration", "dt", "seeds", "placements")
                    )
                    first = suite.first_placement
                    for number, dt, seed in product(
                        range(first, first + placements),
                        periods if isinstance(periods, list) else [periods],
                        seeds,
                    ):
                        yield _Plan(where, *cell, own, seed, duration, dt, number)
        for number in sorted(set(range(len(suite.overrides))) - used):
            self.note(f"overrides.{number} fits no run; see its 'where'")

    def _fits(self, override: Override, cell: Sequence[str]) -> bool:
        where = override.where
        patterns = (where.robots, where.tasks, where.scenarios, where.controllers)
        tables = (self._tasks.members, self._scenarios.members, self._controllers.members)
        return all(
            given is None
            or any(fnmatchcase(name, own) or name in members.get(own, ()) for own in given)
            for name, given, members in zip(cell, patterns, ({}, *tables), strict=True)
        )

    def _chosen(
        self,
        kind: str,
        where: str,
        patterns: Sequence[str],
        table: _Table,
        others: Sequence[str] = (),
    ) -> list[str]:
        """Names of the suite's own entries, and of others, that patterns mean, each once."""
        names = list(dict.fromkeys([*table.fields, *others]))
        found: dict[str, None] = {}
        for pattern in patterns:
            try:
                found |= dict.fromkeys(chosen(f"{kind} in {where}", pattern, names, table.members))
            except UnknownNameError as error:
                # else it may be of a grid whose fault is noted itself
                if [] not in table.members.values():
                    self.note(str(error))
        return list(found)

    def _chosen_robots(self, where: str, patterns: Sequence[str]) -> list[str]:
        """Robots that patterns mean; one may be a description's file."""
        found: dict[str, None] = {}
        for pattern in patterns:
            if any(mark in pattern for mark in "*?["):
                names = self.attempt(where, chosen, "robot", pattern, list_robots(), {}) or []
                found |= dict.fromkeys(filter(_is_sound, names))
            elif self.attempt(where, find_spec, pattern) is not None:
                self._named.add(pattern)
                found[pattern] = None
        return list(found)

    def _chosen_scenarios(self, where: str, patterns: Sequence[str]) -> list[str]:
        """Scenarios that patterns mean: the suite's own, those that have names, and files."""
        found: dict[str, None] = {}
        known = list_scenarios()
        for pattern in patterns:
            if not pattern.endswith(".toml"):
                names = self._chosen("scenario", where, [pattern], self._scenarios, known)
                found |= dict.fromkeys(names)
            elif self.attempt(f"scenario {pattern!r}", load_scenario, pattern) is not None:
                found[pattern] = None
        return list(found)

    # What names stand for

    def _law_of(self, controller: str) -> str:
        return self._suite.controllers[self._controllers.labels[controller]].law

    def _task_of(self, task: str) -> tuple[str, dict[str, Any]]:
        """The registered task that a name stands for, and the parameters that it is given."""
        label = self._tasks.labels.get(task)
        name = task if label is None else self._suite.tasks[label].task
        return name, self._tasks.fields.get(task, {})

    def _scenario(self, name: str) -> tuple[Scenario, dict[str, Any]]:
        """A scenario, the suite's own, or else a registered one or a file; and all of its fields."""
        own = self._scenarios.fields.get(name)
        found = load_scenario(name) if own is None else Scenario(**{**own, "name": name})
        return found, found.model_dump(mode="json")

    def resolve(self, planned: Sequence[_Plan]) -> list[_Plan]:
        """Make what the names in runs stand for, and note what cannot be made; the runs that are left:
        a user's robot that a pattern meant, and that cannot do a task, stops none of the others."""
        numbers: dict[str, dict[str, dict[int, None]]] = {}  # of placements, by robot and task
        for plan in planned:
            numbers.setdefault(plan.robot, {}).setdefault(plan.task, {})[plan.placement] = None
        lost = set[str]()
        for name, own in numbers.items():
            by_pattern = name not in self._named and origin_of(name) != "mobman"
            attempt: Any = _unguarded if by_pattern else self.attempt
            try:
                self._robots[name] = attempt(f"robot {name!r}", self._robot, name)
                for task, found in own.items() if self._robots[name] is not None else ():
                    where = f"task {task!r} for robot {name!r}"
                    self._placed[name, task] = attempt(where, self._placements, name, task, found)
            except MobmanError as error:
                _leave_out(name, error)
                lost.add(name)
        planned = [plan for plan in planned if plan.robot not in lost]
        for name in dict.fromkeys(plan.scenario for plan in planned):
            where = f"scenario {name!r}"
            self._resolved_scenarios[name] = self.attempt(where, self._scenario, name)
        for key, plan in {plan.controller: plan for plan in planned}.items():
            where = f"controller {plan.label!r}" + (f" in {plan.where}" if plan.gains else "")
            self._laws[key] = self.attempt(where, self._gains_and_settings, plan)
        return planned

    def _robot(self, name: str) -> tuple[str, str]:
        """A robot's fingerprint, and the type of its platform."""
        spec = find_spec(name)
        return fingerprint(spec), spec.platform.type

    def _gains_and_settings(self, plan: _Plan) -> tuple[dict[str, Any], dict[str, Any]]:
        """Gains as given, and all of them."""
        gains = {**self._controllers.fields[plan.label], **plan.gains}
        controller = make_controller(self._law_of(plan.label), **gains)
        settings: dict[str, Any] = getattr(controller, "settings", dict)()
        return gains, settings

    def _placements(
        self, robot: str, task: str, numbers: Iterable[int]
    ) -> dict[int, dict[str, Any]]:
        """Fields of a run that depend on its placement, by its number."""
        name, given = self._task_of(task)
        robot_sha256, _ = self._robots[robot]
        key = robot, robot_sha256, tasks.get(name), json.dumps(given, sort_keys=True)
        known = _placed.setdefault(key, {})
        if missing := [number for number in numbers if number not in known]:
            for number, placed in placements(load_robot(robot), missing, name, given).items():
                known[number] = {
                    "task_given": placed.parameters,
                    "task_parameters": task_parameters(placed.task),
                    "q0": placed.q0.tolist() if number else [],
                    "placement": number,
                }
        return known

    def run(self, plan: _Plan) -> RunSpec:
        """The run of such names, if no problem was noted."""
        gains, settings = self._laws[plan.controller]
        law = self._law_of(plan.label)
        task, _ = self._task_of(plan.task)
        scenario, fields = self._resolved_scenarios[plan.scenario]
        robot_sha256, kind = self._robots[plan.robot]
        if (key := (law, task, kind, plan.scenario)) not in self._codes:
            platform = platforms.get(kind)
            things = [controllers.get(law), tasks.get(task), platform, *scenario.types()]
            self._codes[key] = foreign_code_sha256(things)
        return RunSpec(
            label=plan.label,
            robot=plan.robot,
            robot_sha256=robot_sha256,
            law=law,
            gains=gains,
            settings=settings,
            task=plan.task,
            task_name=task,
            **self._placed[plan.robot, plan.task][plan.placement],
            scenario=fields,
            family=self._scenarios.labels.get(plan.scenario, plan.scenario),
            seed=plan.seed,
            duration=plan.duration,
            dt=plan.dt,
            record_period=self._suite.record_period,
            compression=self._suite.compression,
            monitor=self._suite.monitor and hasattr(controllers.get(law), "monitored_signals"),
            code_sha256=self._codes[key],
        )


_UNKNOWN = re.compile(r"\bunknown [^']*'([^']+)'")
_NUMBERED = re.compile(r"\b(groups|overrides)\.(\d+)")
_LABELLED = re.compile(r"(controller|task|scenario)s?[ .]'?([A-Za-z0-9_.-]+)")


def _place_of(fault: str) -> Place:
    """The table of the suite's file that a fault names; () if it names none."""
    if found := _NUMBERED.search(fault):
        return found[1], int(found[2])
    found = _LABELLED.match(fault)
    return (f"{found[1]}s", found[2]) if found else ()


def _is_sound(name: str) -> bool:
    """True if a robot that a pattern means can be used; a user's that cannot is named in a warning."""
    if origin_of(name) == "mobman":
        return True
    try:
        build_robot(find_spec(name))
    except MobmanError as error:
        _leave_out(name, error)
        return False
    return True


def _unguarded(where: str, function: Callable[..., T], /, *args: Any) -> T:
    return function(*args)


def _leave_out(name: str, error: MobmanError) -> None:
    """Say once that a robot, which no suite names, is in none."""
    text = f"robot {name!r} is left out of the suite: {error}"
    if text not in _said:
        _said.add(text)
        warnings.warn(text, stacklevel=2)


# Grids -------------------------------------------------------------------------------------------


def expand(name: str, fields: Mapping[str, Any], grid: Mapping[str, list[Any]]) -> dict[str, Any]:
    """All combinations of a grid's values, each with a name of its own.

    Args:
        name: The entry's label.
        fields: What all of them have.
        grid: Values by field; ``"a.b.0"`` is a field within a field, or an entry of a list.

    Returns:
        Fields by name: the label, followed by the values; the label alone if there is no grid.

    Raises:
        UsageError: If a field is within something that has none, two combinations have one name, or
            there are more than :data:`MOST_ENTRIES`.
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
    fitting = [name for name in names if fnmatchcase(name, pattern)]
    if found := [pattern] if pattern in names else fitting:
        return found
    raise UnknownNameError(kind, pattern, dict.fromkeys([*names, *members]))


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
    if isinstance(here, list) and part.isdecimal() and int(part) < len(here):
        return here[int(part)]
    raise UsageError(f"grid field {path!r}: {part!r} is not in {here!r}")


def _text(value: Any, position: int) -> str:
    """A value as part of a name; one that is no number or word, by its position."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:g}"
    word = isinstance(value, str) and value.replace("-", "").replace("_", "").isalnum()
    return value if word else str(position + 1)
