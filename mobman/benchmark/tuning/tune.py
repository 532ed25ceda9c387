"""Tuning a suite's controllers, with the same budget for each."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

from pydantic_core import to_json

from mobman.benchmark.backends import Backend, Local
from mobman.benchmark.suite import Suite
from mobman.benchmark.suite_tables import TunedFrom, Tuning
from mobman.benchmark.tuning import search, tuning_set
from mobman.benchmark.tuning.objective import objectives
from mobman.benchmark.tuning.search import Search, Step, Trial
from mobman.benchmark.tuning.tuning_set import SUFFIX
from mobman.controllers.protocol import gains_by_field
from mobman.files import write_all
from mobman.provenance import machine, versions
from mobman.simulation.run_spec import RunSpec
from mobman.toml_model import validate

_SCHEMA_VERSION = 1
_HEAD = "# Written by mobman bench tune; tuning.json next to it has every trial."


class Plan(NamedTuple):
    """The work that a tuning will do."""

    gains: Mapping[str, int]  # number of gains that are tuned, by label
    trials: int  # trials of each controller
    runs: int  # runs of each trial
    seconds: float  # simulated time of a trial (s)
    done: int  # trials that were there already
    scores: Mapping[str, float]  # the best score of these, by label

    @property
    def total(self) -> int:
        """Runs of all trials of all controllers."""
        return len(self.gains) * self.trials * self.runs


class TuningResult(NamedTuple):
    """The outcome of a tuning."""

    json_file: Path  # everything: the budget, the spaces, all trials
    suite_file: Path  # the suite with the tuned gains in addition to its own
    suite: Suite  # the same
    trials: Mapping[str, Sequence[Trial]]  # trials by label
    left_out: Mapping[str, str]  # the reason why a controller was not tuned, by label
    seconds: float  # wall time of this call

    def best(self, label: str) -> Trial:
        """A controller's best trial; trial 0 if no gains were better than its own."""
        return _best(self.trials[label])


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
        executor: Does the runs; processes of this machine by default.
        workers: Number of these.
        fresh: Begin again.
        on_start: Called once everything is checked.
        on_step: Called after each run that was done.

    Raises:
        SpecError: If the tuning set, a search space or the suite is not valid, or the tuning set has a
            run that is reported.
        MobmanError: If the extra ``tune`` is not installed, the folder holds something else or cannot be
            written, or the suite's own gains of a controller cannot be run at all.
        OSError: If this machine, and no gains, made a run fail.
    """
    started, folder = time.monotonic(), Path(folder)
    search.require_extra()
    import tomli_w

    tuning = suite.tuning or Tuning()
    if trials is not None:
        tuning = Tuning.model_validate({**tuning.model_dump(), "trials": trials})
    suite = suite.model_copy(update={"tuning": tuning})
    objective = objectives.get(tuning.objective)
    spaces, left_out = tuning_set.candidates(suite, controllers)
    reported = suite.runs()
    sets = tuning_set.tuning_runs(suite, list(spaces), reported)
    runs = next(iter(sets.values()))
    tuning_set.require_disjoint(runs, reported)
    path = folder / "trials.jsonl"
    storage = search.journal(path, fresh=fresh)
    searches = {k: Search(k, own, sets[k], objective, storage, path) for k, own in spaces.items()}
    numbers = range(tuning.trials)
    if on_start is not None:
        there = {
            k: [t.score for t in own.done.values() if t.number in numbers]
            for k, own in searches.items()
        }
        plan = Plan(
            gains={label: len(space) for label, space in spaces.items()},
            trials=tuning.trials,
            runs=len(runs),
            seconds=sum(run.duration for run in runs),
            done=sum(map(len, there.values())),
            scores={label: min(scores) for label, scores in there.items() if scores},
        )
        on_start(plan)
    limit = suite.time_limit
    with Local(workers, limit) if executor is None else Backend(executor) as backend:
        for step in search.steps(list(searches.values()), tuning.trials, backend, limit):
            if on_step is not None:
                on_step(step)
    found = {label: [own.done[number] for number in numbers] for label, own in searches.items()}
    best = {label: _best(own) for label, own in found.items()}
    tuning = _resolved(tuning, runs)
    origins = {
        label: TunedFrom(
            label=label,
            trials=len(own),
            trial=best[label].number,
            objective=objective.name,
            score_default=own[0].score,
            score=best[label].score,
            space=spaces[label],
        )
        for label, own in found.items()
    }
    gains = {label: trial.gains for label, trial in best.items()}
    written = tuned_suite(suite, tuning, origins, gains)
    seconds = time.monotonic() - started
    files = folder / "tuning.json", folder / f"{written.name}.toml"
    result = TuningResult(*files, written, found, left_out, seconds)
    content = {
        "schema_version": _SCHEMA_VERSION,
        "suite": suite.name,
        "tuning": tuning.model_dump(mode="json"),
        "objective": objective.formula,
        "sampler": search.sampler_settings(),
        "controllers": {label: _entry(searches[label], own) for label, own in found.items()},
        "not_tuned": dict(left_out),
        "versions": versions(),
        "machine": {**machine(), "cores": os.cpu_count()},
        "workers": workers if executor is None else None,
        "seconds": seconds,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    # numbers that JSON has no word for (inf, NaN) are null
    report = to_json(content, indent=1, inf_nan_mode="null", fallback=str) + b"\n"
    tables = written.model_dump(mode="json", by_alias=True, exclude_unset=True)
    text = f"{_HEAD}\n{tomli_w.dumps(tables)}"
    write_all({result.json_file: report, result.suite_file: text.encode()})
    return result


def _best(trials: Sequence[Trial]) -> Trial:
    """The one with the least score; of equals, the first."""
    return min(trials, key=lambda trial: (trial.score, trial.number))


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


def tuned_suite(
    suite: Suite,
    tuning: Tuning,
    found: Mapping[str, TunedFrom],
    gains: Mapping[str, Mapping[str, float]],
) -> Suite:
    """A suite with the entries of another one, and ``LABEL-tuned`` in addition to each that gained.

    Gains that a group or an override has for a label hold for its tuned one, too, but for those that
    were tuned: an override of its own, the last, says these again where it must. The budget has all that
    it was spent on; the outcome and the gains, none where nothing better was found, are by label.
    """
    content = suite.model_dump(mode="json", by_alias=True, exclude_unset=True)
    better = {label: dict(own) for label, own in gains.items() if own}
    entries: dict[str, Any] = {}
    for label, entry in content["controllers"].items():
        if label.endswith(SUFFIX) and label.removesuffix(SUFFIX) in found:  # of an earlier tuning
            continue
        origin = found[label].model_dump(mode="json") if label in found else None
        entries[label] = entry if label in better or origin is None else {**entry, "tuned": origin}
        if label in better:
            own = {**gains_by_field(entry["law"], entry.get("gains", {})), **better[label]}
            entries[label + SUFFIX] = {"law": entry["law"], "gains": own, "tuned": origin}
    groups, overrides = content["groups"], content.get("overrides", [])
    gone = set(content["controllers"]) - set(entries)  # tuned before, and nothing better now
    for place in [*groups, *(override["where"] for override in overrides)]:
        if "controllers" in place:
            left = [name for name in place["controllers"] if name not in gone]
            place["controllers"] = _with_tuned(suite, left, better)
    groups = [group for group in groups if group.get("controllers") != []]
    overrides = [one for one in overrides if one["where"].get("controllers") != []]
    for group in groups:
        if "gains" in group:
            group["gains"] = {k: own for k, own in group["gains"].items() if k not in gone}
    again = []
    for label, own in better.items():
        law = suite.controllers[label].law
        elsewhere = [group["gains"].get(label, {}) for group in groups if "gains" in group]
        for group in groups:
            if given := group.get("gains", {}).get(label):
                group["gains"][label + SUFFIX] = given
        elsewhere += [
            override.get("gains", {})
            for override in overrides
            if _fits(label, override["where"].get("controllers", ["*"]))
        ]
        if any(own.keys() & gains_by_field(law, given).keys() for given in elsewhere):
            again.append({"where": {"controllers": [label + SUFFIX]}, "gains": own})
    written = {
        **{key: own for key, own in content.items() if key != "overrides"},
        "name": f"{suite.name}{SUFFIX}",
        "controllers": entries,
        "groups": groups,
        **({"overrides": [*overrides, *again]} if overrides or again else {}),
        "tuning": tuning.model_dump(mode="json", exclude_none=True),
    }
    return validate(Suite, _given(written), f"suite {written['name']!r}")


def _given(value: Any) -> Any:
    """A value without what is None, for which TOML has no word: it is the default."""
    if isinstance(value, dict):
        return {key: _given(item) for key, item in value.items() if item is not None}
    return [_given(item) for item in value] if isinstance(value, list) else value


def _with_tuned(suite: Suite, patterns: Sequence[str], better: Mapping[str, Any]) -> list[str]:
    """Patterns, and the tuned labels of those that they fit, and of no others."""
    tuned = {label: label + SUFFIX for label in better}
    if any(_fits(name, patterns) and not _fits(label, patterns) for label, name in tuned.items()):
        named = [label for label in suite.controllers if _fits(label, patterns)]
        # and those that fit no label, but members of one that has a grid
        grids = [p for p in patterns if not any(_fits(label, [p]) for label in suite.controllers)]
        patterns = [*named, *grids]
    own = [name for label, name in tuned.items() if _fits(label, patterns)]
    return [*patterns, *(name for name in own if not _fits(name, patterns))]


def _fits(label: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(label, pattern) for pattern in patterns)


def _entry(tuned: Search, trials: Sequence[Trial]) -> dict[str, Any]:
    """A controller in ``tuning.json``."""
    best = _best(trials)
    return {
        "law": tuned.runs[0].law,
        "space": {name: own.model_dump() for name, own in tuned.space.items()},
        "default": tuned.default,
        "problem": tuned.problem,
        "runs": [replace(run, settings={}).as_dict() for run in tuned.runs],
        "score_default": trials[0].score,
        "score": best.score,
        "trial": best.number,
        "gains": best.gains,
        "simulated_runs": sum(len(trial.runs) for trial in trials),
        "evaluation_seconds": sum(run.seconds for trial in trials for run in trial.runs),
        "trials": [trial.as_dict() for trial in trials],
    }
