"""Nothing that is reported may have been tuned on."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

import numpy as np

from mobman.benchmark.tuning.evaluation import Evaluation, simulated
from mobman.errors import SpecError
from mobman.simulation.run_spec import RunSpec

_NAMES = ("name", "description")


def require_disjoint(tuning: Sequence[RunSpec], reported: Iterable[RunSpec]) -> None:
    """Raises SpecError if a run of the tuning set is, or is part of, a reported one.

    That is one of the same robot, task, scenario (by its content, whatever its name) and seed; and of
    another seed if the scenario has nothing random in it, so that the seed makes no difference.

    Args:
        tuning: Runs of a trial, of any controller.
        reported: The suite's own runs.
    """
    seeds: dict[str, dict[int, RunSpec]] = {}
    for run in reported:
        seeds.setdefault(_place(run), {})[run.seed] = run
    problems: dict[str, None] = {}
    random: dict[str, bool] = {}
    for run in tuning:
        others = seeds.get(_place(run), {})
        if run.seed in others:
            problems[
                f"{_told(run)}, seed {run.seed}, is reported"
                + _alias(run, others[run.seed])
                + "; give other seeds or another scenario"
            ] = None
        elif others:
            content = _content(run)
            if content not in random:
                random[content] = _seed_matters(run, next(iter(others)))
            if not random[content]:
                other = next(iter(others.values()))
                problems[
                    f"{_told(run)} is reported"
                    + _alias(run, other)
                    + " and has nothing random in it, so that another seed makes no difference; "
                    "give another scenario"
                ] = None
    if problems:
        raise SpecError("tuning set: " + "; ".join(problems))


def _place(run: RunSpec) -> str:
    aim = json.dumps(run.task_parameters, sort_keys=True, default=str)
    return "\n".join((run.robot_sha256, run.task_name, aim, _content(run)))


def _content(run: RunSpec) -> str:
    fields = {key: value for key, value in run.scenario.items() if key not in _NAMES}
    return json.dumps(fields, sort_keys=True, default=str)


def _told(run: RunSpec) -> str:
    return f"{run.robot} · {run.task} · {run.scenario['name']}"


def _alias(run: RunSpec, other: RunSpec) -> str:
    name = other.scenario["name"]
    return "" if name == run.scenario["name"] else f" (as {name!r})"


def _seed_matters(run: RunSpec, other_seed: int) -> bool:
    """Whether two seeds give two runs: tried, since any piece of a scenario may use randomness."""
    one, two = (simulated(Evaluation.of(run, seed=seed)) for seed in (run.seed, other_seed))
    return not all(
        np.array_equal(getattr(one, name), getattr(two, name)) for name in ("q", "z", "torque")
    )
