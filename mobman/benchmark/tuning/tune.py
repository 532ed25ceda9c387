"""Tuning a suite's controllers, with the same budget for each."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mobman.benchmark.tuning.batches import Batches, Step
from mobman.benchmark.tuning.candidates import candidates
from mobman.benchmark.tuning.declaration import Tuning
from mobman.benchmark.tuning.disjoint import require_disjoint
from mobman.benchmark.tuning.journal import Journal
from mobman.benchmark.tuning.objective import Objective, objectives
from mobman.benchmark.tuning.processes import local_processes
from mobman.benchmark.tuning.proposals import require_extra, sampler_settings
from mobman.benchmark.tuning.result import TuningResult, write_result
from mobman.benchmark.tuning.search import Search
from mobman.benchmark.tuning.search_range import Space
from mobman.benchmark.tuning.tuning_set import tuning_runs
from mobman.simulation.run_spec import RunSpec

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite


@dataclass(frozen=True)
class Plan:
    """What a tuning will do."""

    gains: Mapping[str, int]
    """How many gains are tuned, by label."""
    trials: int
    """Of each controller."""
    runs: int
    """Of each trial."""
    seconds: float
    """Simulated time of a trial (s)."""
    done: int
    """Trials that were there already."""

    @property
    def total(self) -> int:
        """Runs of all trials of all controllers."""
        return len(self.gains) * self.trials * self.runs


def tune_suite(
    suite: Suite,
    folder: str | os.PathLike[str],
    *,
    trials: int | None = None,
    controllers: Sequence[str] | None = None,
    executor: Executor | None = None,
    workers: int = 1,
    fresh: bool = False,
    on_start: Callable[[Plan], None] | None = None,
    on_step: Callable[[Step], None] | None = None,
) -> TuningResult:
    """Tune a suite's controllers, each with the same number of trials on the same runs.

    Trial 0 is the suite's own gains, so that tuned ones are never worse on the tuning set. The result
    does not depend on the executor, nor on where an earlier call was interrupted.

    Args:
        suite: The suite; its table ``[tuning]`` is the budget.
        folder: Where the results are kept; trials that are there are not done again.
        trials: In the place of the suite's.
        controllers: Labels; all that have a search space by default.
        executor: What evaluates the runs; processes of this machine by default.
        workers: How many of these.
        fresh: Begin anew.
        on_start: Called once everything is checked.
        on_step: Called after each run that was done.

    Raises:
        SpecError: If the tuning set, a search space or the suite is not valid, or the tuning set has a
            run that is reported.
        MobmanError: If the extra ``tune`` is not installed, the folder holds something else or cannot be
            written, or the suite's own gains of a controller cannot be run at all.
    """
    started = time.monotonic()
    require_extra()
    tuning = suite.tuning or Tuning()
    if trials is not None:
        tuning = Tuning.model_validate({**tuning.model_dump(), "trials": trials})
    suite = suite.model_copy(update={"tuning": tuning})
    objective = objectives.get(tuning.objective)
    chosen = candidates(suite, controllers)
    searches = _searches(suite, chosen.spaces, objective)
    problems = {label: search.problem for label, search in searches.items()}
    journal = Journal(Path(folder), problems, fresh=fresh)
    if on_start is not None:
        on_start(_plan(searches, tuning, journal))
    processes: AbstractContextManager[Executor] = (
        local_processes(workers) if executor is None else nullcontext(executor)
    )
    with processes as pool:
        done = Batches(searches, journal, pool, suite.time_limit, on_step).trials(tuning.trials)
    return write_result(
        suite,
        _resolved(tuning, next(iter(searches.values())).runs),
        Path(folder),
        searches,
        done,
        left_out=chosen.left_out,
        sampler=sampler_settings(),
        seconds=time.monotonic() - started,
        workers=workers if executor is None else None,
    )


def _searches(suite: Suite, spaces: Mapping[str, Space], objective: Objective) -> dict[str, Search]:
    """What is searched for each controller, on runs of which none is reported."""
    reported = suite.runs()
    runs = tuning_runs(suite, list(spaces), reported)
    require_disjoint(next(iter(runs.values())), reported)
    return {label: Search(label, space, runs[label], objective) for label, space in spaces.items()}


def _plan(searches: Mapping[str, Search], tuning: Tuning, journal: Journal) -> Plan:
    runs = next(iter(searches.values())).runs
    numbers = range(tuning.trials)
    done = sum(journal.get(label, number) is not None for label in searches for number in numbers)
    return Plan(
        gains={label: len(search.space) for label, search in searches.items()},
        trials=tuning.trials,
        runs=len(runs),
        seconds=sum(run.duration for run in runs),
        done=done,
    )


def _resolved(tuning: Tuning, runs: Sequence[RunSpec]) -> Tuning:
    """The budget as it was spent, with every default and every scenario written out."""
    scenarios = {run.scenario["name"]: dict(run.scenario) for run in runs}
    for fields in scenarios.values():
        del fields["name"]
    return Tuning.model_validate(
        {
            **tuning.model_dump(),
            "robots": list(dict.fromkeys(run.robot for run in runs)),
            "tasks": list(dict.fromkeys(run.task for run in runs)),
            "scenarios": list(scenarios),
            "definitions": scenarios,
            "duration": runs[0].duration,
        }
    )
