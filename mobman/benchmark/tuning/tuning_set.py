"""The tuning set: which runs a trial consists of, for each controller the same."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mobman.benchmark.tuning.declaration import Tuning
from mobman.errors import SpecError
from mobman.simulation.run_spec import RunSpec
from mobman.toml_model import read_toml, validate

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite

Pair = tuple[str, str]
"""A robot and a task of its."""


def tuning_runs(
    suite: Suite, labels: Sequence[str], reported: Sequence[RunSpec]
) -> dict[str, list[RunSpec]]:
    """The runs of a trial with the suite's own gains, by label; the same cells for each.

    Args:
        suite: The suite.
        labels: Of its controllers.
        reported: The suite's own runs. In a cell of the tuning set, a controller has the gains and the
            sampling period of the first of them with the same robot and task.

    Raises:
        SpecError: With everything that is wrong with the tuning set.
    """
    tuning = suite.tuning or Tuning()
    pairs = _pairs(tuning, reported)
    groups = []
    for robot, task in pairs:
        known = [run for run in reported if (run.robot, run.task) == (robot, task)]
        gains = {
            label: next((run.gains for run in known if run.label == label), {}) for label in labels
        }
        group: dict[str, Any] = {"robots": [robot], "tasks": [task], "gains": gains}
        if tuning.dt is None and known:
            group["dt"] = known[0].dt
        groups.append({**group, "scenarios": tuning_scenarios(tuning)})
    content = suite.model_dump(mode="json", by_alias=True, exclude_unset=True)
    period = {} if tuning.dt is None else {"dt": tuning.dt}
    derived: dict[str, Any] = {
        **{key: content[key] for key in ("schema", "dt", "tasks") if key in content},
        **period,
        "name": suite.name,
        "duration": suite.duration if tuning.duration is None else tuning.duration,
        "seeds": tuning.seeds,
        "controllers": {label: content["controllers"][label] for label in labels},
        "scenarios": _definitions(suite, tuning),
        "groups": groups,
    }
    try:
        runs = validate(type(suite), derived, f"suite {suite.name!r}").runs()
    except SpecError as error:
        raise SpecError(f"tuning set: {error}") from error
    found: dict[str, list[RunSpec]] = {label: [] for label in labels}
    for run in runs:
        found[run.label].append(run)
    return found


def tuning_scenarios(tuning: Tuning) -> list[str]:
    """The names of the tuning set's scenarios."""
    return tuning.scenarios or list(tuning.definitions) or list(own_scenarios())


def own_scenarios() -> dict[str, dict[str, Any]]:
    """mobman's scenarios for tuning, by name: their fields."""
    folder = Path(__file__).parent / "scenarios"
    found = {}
    for path in sorted(folder.glob("*.toml")):
        fields = read_toml(path, "scenario file")
        found[fields.pop("name")] = fields
    return found


def _pairs(tuning: Tuning, reported: Iterable[RunSpec]) -> list[Pair]:
    """Which robots do which tasks: those of the suite, and any that it does not have."""
    known = list(dict.fromkeys((run.robot, run.task) for run in reported))
    robots = _asked(tuning.robots, list(dict.fromkeys(robot for robot, _ in known)))
    aims = _asked(tuning.tasks, list(dict.fromkeys(task for _, task in known)))
    in_suite = ({robot for robot, _ in known}, {task for _, task in known})
    pairs = [
        (robot, task)
        for robot in robots
        for task in aims
        if (robot, task) in known or robot not in in_suite[0] or task not in in_suite[1]
    ]
    if not pairs:
        raise SpecError(
            "tuning set: none of its robots does one of its tasks in the suite; "
            f"these do: {', '.join(f'{robot} {task}' for robot, task in known)}"
        )
    return pairs


def _asked(names: list[str] | None, known: list[str]) -> list[str]:
    """What names and patterns mean; a name that the suite does not have stands for itself."""
    if names is None:
        return known
    found: dict[str, None] = {}
    for name in names:
        fitting = [one for one in known if fnmatchcase(one, name)]
        found |= dict.fromkeys(fitting or [name])
    return list(found)


def _definitions(suite: Suite, tuning: Tuning) -> Mapping[str, Any]:
    own = suite.model_dump(mode="json", exclude_unset=True).get("scenarios", {})
    if twice := sorted(own.keys() & tuning.definitions.keys()):
        raise SpecError(f"tuning.definitions: {twice[0]!r} is a scenario of the suite, too")
    shipped = {} if tuning.scenarios or tuning.definitions else own_scenarios()
    return {**shipped, **own, **tuning.definitions}
