"""A suite's runs, or all that is wrong with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mobman.benchmark.expansion.entries import Entries
from mobman.benchmark.expansion.places import places_of
from mobman.benchmark.expansion.problems import Problems
from mobman.benchmark.expansion.resolution import Resolution
from mobman.simulation.run_spec import RunSpec

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite


def runs_of(suite: Suite) -> list[RunSpec]:
    """Every run of a suite, in the order of the file.

    Args:
        suite: The suite; what is wrong with its own entries is told even if no run is of them.

    Raises:
        SpecError: With everything that is wrong: names, gains, parameters, grids, overrides, and runs
            that are asked for twice under different names or with different gains.
    """
    problems = Problems()
    entries = Entries(suite, problems)
    entries.check()
    places = places_of(suite, entries, problems)
    resolution = Resolution(suite, entries, places, problems)
    problems.require_none(suite.name)
    runs: dict[str, RunSpec] = {}
    by_name: dict[tuple[Any, ...], str] = {}
    for place in places:
        run = resolution.run(place)
        run_id = run.run_id
        other = runs.setdefault(run_id, run)
        for field, names in (("label", "labels"), ("task", "labels"), ("robot", "robots")):
            first, name = getattr(other, field), getattr(run, field)
            if first != name:
                problems.note(f"{place.where}: {names} {first!r} and {name!r} are the same run")
        if by_name.setdefault((run.cell, run.label, run.seed), run_id) != run_id:
            problems.note(f"{place.where}: {run} is asked for twice, with other gains")
    problems.require_none(suite.name)
    return list(runs.values())


def number_of_runs(suite: Suite) -> int:
    """How many runs a suite has, by the names alone: no robot is loaded and no gain is looked at.

    Args:
        suite: The suite.

    Raises:
        SpecError: With all names that are unknown, grids that are not valid, and overrides that fit no
            run.
    """
    problems = Problems()
    places = places_of(suite, Entries(suite, problems), problems)
    problems.require_none(suite.name)
    return len({(p.robot, p.task, p.scenario, p.label, p.seed, p.dt, p.duration) for p in places})
