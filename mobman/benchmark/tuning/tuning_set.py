"""The controllers that are tuned, with their search spaces, and the tuning set of runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import RootModel

from mobman.benchmark.suite import Suite
from mobman.benchmark.suite_tables import MOST_PLACEMENTS, Space, Tuning
from mobman.benchmark.work import simulated_run
from mobman.controllers.protocol import controllers, gains_by_field, make_controller
from mobman.errors import SpecError, UnknownNameError, UsageError
from mobman.model.build import load_robot
from mobman.simulation.run_spec import RunSpec
from mobman.simulation.scenario import Scenario
from mobman.toml_model import read_toml, validate

SUFFIX = "-tuned"
"""End of the label of tuned gains."""
_SPACES = Path(__file__).with_name("spaces.toml")


class Candidates(NamedTuple):
    """The controllers of a suite, as far as tuning goes."""

    spaces: Mapping[str, Space]  # search spaces of those that are tuned, by label
    left_out: Mapping[str, str]  # the reason why the others are not, by label


def candidates(suite: Suite, asked: Sequence[str] | None = None) -> Candidates:
    """The controllers of a suite that can be tuned, or those of them whose labels are asked for, which
    may have been tuned before.

    Raises:
        UnknownNameError: If a label is not there.
        SpecError: If one that is asked for cannot be tuned, none can, or a space is not valid.
    """
    tuning = suite.tuning or Tuning()
    for label in [*(asked or []), *tuning.spaces]:
        if label not in suite.controllers:
            raise UnknownNameError("label of the suite", label, suite.controllers)
    spaces: dict[str, Space] = {}
    left_out: dict[str, str] = {}
    for label in dict.fromkeys(asked or suite.controllers):
        entry = suite.controllers[label]
        if entry.tuned is not None and not (asked and entry.tuned.trial == 0):
            left_out[label] = "is tuned already"
        elif entry.grid:
            left_out[label] = (
                "stands for several controllers, by its grid; give those to tune labels of their own"
            )
        elif label + SUFFIX in suite.controllers and not asked:
            left_out[label] = f"has been tuned: there is {label + SUFFIX!r}"
        elif label in tuning.spaces:
            spaces[label] = _checked(entry.law, tuning.spaces[label], f"tuning.spaces.{label}")
        elif (space := law_space(entry.law)) is not None:
            spaces[label] = space
        else:
            left_out[label] = (
                f"has no search space: none is declared for its law {entry.law!r}; give one in the "
                f"suite, such as [tuning.spaces.{label}] "
                "GAIN = { low = 1.0, high = 100.0, log = true }"
            )
    if left_out and (asked or not spaces):
        raise SpecError("cannot tune " + "; ".join(f"{k!r} {why}" for k, why in left_out.items()))
    return Candidates(spaces, left_out)


def law_space(law: str) -> Space | None:
    """The space that is declared for a law, by its attribute ``search_space`` or in ``spaces.toml``, or
    None.

    Raises:
        SpecError: If the declaration is not valid.
    """
    declared = getattr(controllers.get(law), "search_space", None)
    where = f"search_space of the controller {law!r}"
    if declared is None:
        spaces = read_toml(_SPACES, "file of search spaces")
        declared = spaces.get(law)
        declared = spaces[declared] if isinstance(declared, str) else declared
        where = f"{_SPACES}: {law}"
    if declared is None:
        return None
    return _checked(law, validate(RootModel[Space], declared, where).root, where)


def _checked(law: str, space: Space, where: str) -> Space:
    """A space by the names of the gains' fields."""
    if not space:
        raise SpecError(
            f"{where} has no gain; give at least one, such as K_p = {{ low, high, log }}"
        )
    try:
        return gains_by_field(law, space)
    except UsageError as error:
        raise SpecError(f"{where}: {error}") from error


def tuning_runs(
    suite: Suite, labels: Sequence[str], reported: Sequence[RunSpec]
) -> dict[str, list[RunSpec]]:
    """The runs of a trial with the suite's own gains, by label; the same cells for each.

    In a cell, a controller has the gains and the sampling period of the first of the suite's own runs,
    which are reported, with the same robot and task.

    Raises:
        SpecError: With everything that is wrong with the tuning set.
    """
    tuning = suite.tuning or Tuning()
    content = suite.model_dump(mode="json", by_alias=True, exclude_unset=True)
    scenarios = content.get("scenarios", {})
    for name in sorted(scenarios.keys() & tuning.definitions.keys()):
        two = (suite.scenarios[name].fields, tuning.definitions[name])
        one, other = (Scenario(**{**fields, "name": name}).model_dump() for fields in two)
        if one != other:  # alike are those of a suite that tuning wrote
            raise SpecError(f"tuning.definitions: {name!r} is a scenario of the suite, too")
    own = own_scenarios()
    names = tuning.scenarios or list(tuning.definitions) or list(own)
    named = {name: own[name] for name in names if name in own}
    groups = []
    for robot, task in _pairs(tuning, reported):
        known = [run for run in reported if (run.robot, run.task) == (robot, task)]
        gains = {
            label: next((run.gains for run in known if run.label == label), {}) for label in labels
        }
        group = {"robots": [robot], "tasks": [task], "scenarios": names}
        period = {"dt": known[0].dt} if tuning.dt is None and known else {}
        groups.append({**group, "gains": gains, **period})
    derived: dict[str, Any] = {
        **{key: content[key] for key in ("schema", "dt", "tasks") if key in content},
        "name": suite.name,
        "duration": suite.duration if tuning.duration is None else tuning.duration,
        "seeds": tuning.seeds,
        "controllers": {label: content["controllers"][label] for label in labels},
        "scenarios": {**named, **scenarios, **tuning.definitions},
        "groups": groups,
    }
    if tuning.dt is not None:
        derived["dt"] = tuning.dt
    if placements := tuning.placements or (2 if any(run.placement for run in reported) else 0):
        derived["placements"] = placements
        derived["first_placement"] = suite.first_placement + MOST_PLACEMENTS
    try:
        runs = validate(Suite, derived, f"suite {suite.name!r}").runs()
    except SpecError as error:
        raise SpecError(f"tuning set: {error}") from error
    return {label: [run for run in runs if run.label == label] for label in labels}


def own_scenarios() -> dict[str, dict[str, Any]]:
    """mobman's scenarios for tuning, by name: their fields."""
    return read_toml(Path(__file__).with_name("scenarios.toml"), "file of scenarios")


def _pairs(tuning: Tuning, reported: Iterable[RunSpec]) -> list[tuple[str, str]]:
    """Robots with their tasks: as in the suite, and all for those that it does not have."""
    known = list(dict.fromkeys((run.robot, run.task) for run in reported))
    own_robots, own_tasks = (list(dict.fromkeys(names)) for names in zip(*known, strict=True))
    pairs = [
        (robot, task)
        for robot in _asked(tuning.robots, own_robots)
        for task in _asked(tuning.tasks, own_tasks)
        if (robot, task) in known or robot not in own_robots or task not in own_tasks
    ]
    if not pairs:
        raise SpecError(
            "tuning set: none of its robots does one of its tasks in the suite; "
            f"these do: {', '.join(f'{robot} {task}' for robot, task in known)}"
        )
    return pairs


def _asked(names: list[str] | None, known: list[str]) -> list[str]:
    """The names of the suite that fit; a name that it does not have stands for itself."""
    found: dict[str, None] = {}
    for name in ["*"] if names is None else names:
        found |= dict.fromkeys([one for one in known if fnmatchcase(one, name)] or [name])
    return list(found)


def require_disjoint(tuning: Sequence[RunSpec], reported: Iterable[RunSpec]) -> None:
    """Refuse a trial's runs, of any controller, if one is, or is part of, a reported one of the suite.

    That is one of the same robot, task, placement, scenario (by its content, whatever its name) and
    seed; and of another seed if the scenario has nothing random in it, so that the seed makes no
    difference.

    Raises:
        SpecError: With all such runs.
    """
    seeds: dict[str, dict[int, RunSpec]] = {}
    for run in reported:
        seeds.setdefault(_content(run), {})[run.seed] = run
    problems: dict[str, None] = {}
    random: dict[str, bool] = {}
    for run in tuning:
        content = _content(run)
        if not (others := seeds.get(content)):
            continue
        other = others.get(run.seed, next(iter(others.values())))
        name, alias = run.scenario["name"], other.scenario["name"]
        told = f"{run.robot} · {run.task} · {name}"
        reported_as = "is reported" + (f" (as {alias!r})" if alias != name else "")
        if run.seed in others:
            again = f"{told}, seed {run.seed}, {reported_as}; give other seeds or another scenario"
            problems[again] = None
            continue
        if content not in random:  # tried, since any piece of a scenario may use randomness
            random[content] = _state(run, run.seed) != _state(run, other.seed)
        if not random[content]:
            again = (
                f"{told} {reported_as} and has nothing random in it, so that another seed makes no "
                "difference; give another scenario"
            )
            problems[again] = None
    if problems:
        raise SpecError("tuning set: " + "; ".join(problems))


def _content(run: RunSpec) -> str:
    """All that two runs have in common if only their laws, seeds and times differ."""
    scenario = {k: value for k, value in run.scenario.items() if k not in ("name", "description")}
    content = (run.robot_sha256, run.task_name, run.task_parameters, run.q0, scenario)
    return json.dumps(content, sort_keys=True, default=str)


def _state(run: RunSpec, seed: int) -> str:
    """Hash of all states of a run with another seed."""
    controller = make_controller(run.law, **run.gains)
    return simulated_run(replace(run, seed=seed), load_robot(run.robot), controller).state_sha256
