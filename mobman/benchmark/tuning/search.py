"""The search for gains: trials in batches, proposed by optuna and kept in its storage."""

from __future__ import annotations

import hashlib
import json
import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mobman.benchmark.backends import Backend
from mobman.benchmark.runner import results
from mobman.benchmark.suite_tables import Space
from mobman.benchmark.tuning.objective import Objective
from mobman.benchmark.work import Result, jobs_of
from mobman.controllers.protocol import gains_by_field
from mobman.errors import MobmanError
from mobman.simulation.run_spec import RunSpec

if TYPE_CHECKING:
    import optuna

_BATCH = 4  # trials that are proposed at once; whatever the number of workers
_STARTUP = 10  # trials at random before the estimator has its say
_SEED = 0
_REMEDY = "choose another folder with -o, or begin again with --fresh"


@dataclass(frozen=True)
class RunScore:
    """The outcome of one run of a trial."""

    score: float  # see :meth:`Objective.score`
    status: str
    """The record's; ``"infeasible"`` where the law refuses the gains, ``"failed"`` where there is no
    record for another reason."""
    message: str
    metrics: dict[str, float]  # metrics of the objective, by name
    seconds: float  # wall time that it took


@dataclass(frozen=True)
class Trial:
    """One set of gains of a controller, and its runs."""

    label: str
    number: int  # 0 is the suite's own gains
    gains: dict[str, float]  # tuned gains; none in trial 0
    runs: tuple[RunScore, ...]  # runs in the order of the tuning set

    @property
    def score(self) -> float:
        """The mean of its runs'; less is better."""
        return fmean(run.score for run in self.runs)

    def as_dict(self) -> dict[str, Any]:
        """The trial as plain values."""
        return {**asdict(self), "score": self.score}


class Step(NamedTuple):
    """A run of a trial that was done, and the trial if that was its last."""

    label: str
    number: int
    run: RunScore
    trial: Trial | None


class Search:
    """The search for one controller's gains.

    Args:
        label: The controller's.
        space: Ranges by gain.
        runs: The tuning set, with the suite's own gains.
        objective: The quantity to minimize.
        storage: Where the trials are kept, in a study of that label.
        path: Its file, for messages.

    Raises:
        MobmanError: If the study has trials of another problem.
    """

    def __init__(
        self,
        label: str,
        space: Space,
        runs: Sequence[RunSpec],
        objective: Objective,
        storage: optuna.storages.BaseStorage,
        path: Path,
    ) -> None:
        import optuna

        self.label, self.space, self.runs, self.objective = label, space, runs, objective
        self._path = path
        content = {
            "runs": [run.run_id for run in runs],
            "gains": [gains_by_field(run.law, run.gains) for run in runs],
            "space": {name: own.model_dump() for name, own in space.items()},
            "objective": [objective.name, objective.formula],
            "sampler": sampler_settings(),
        }
        text = json.dumps(content, sort_keys=True, default=str)
        self.problem = hashlib.sha256(text.encode()).hexdigest()[:16]
        """Hash of all that a trial and its score depend on."""
        self._distributions: dict[str, optuna.distributions.BaseDistribution] = {
            name: optuna.distributions.FloatDistribution(own.low, own.high, log=own.log)
            for name, own in space.items()
        }
        self._study = optuna.create_study(storage=storage, study_name=label, load_if_exists=True)
        known = self._study.user_attrs.get("problem")
        if known is None:
            self._study.set_user_attr("problem", self.problem)
        elif known != self.problem:
            raise MobmanError(
                f"{path} holds trials of {label!r} with another tuning set, search space, "
                f"objective, or version of a program; {_REMEDY}"
            )
        self.done: dict[int, Trial] = {}
        """Trials that are done, by number."""
        try:
            for frozen in self._study.trials:
                fields = frozen.user_attrs["trial"]
                number, scores = fields["number"], tuple(RunScore(**run) for run in fields["runs"])
                self.done[number] = Trial(label, number, fields["gains"], scores)
        except (LookupError, TypeError) as error:
            raise MobmanError(f"{path} holds what is no trial of a tuning; {_REMEDY}") from error

    @property
    def default(self) -> dict[str, float] | None:
        """The suite's own gains as a point of the space; None if they are none.

        They are none where one is not a number (``"auto"``, a list), is outside its range, or is not
        the same for all robots and tasks.
        """
        point: dict[str, float] = {}
        for name, own in self.space.items():
            values = {str(run.settings.get(name)): run.settings.get(name) for run in self.runs}
            value: Any = next(iter(values.values()))
            if len(values) > 1 or value not in own:
                return None
            point[name] = float(value)
        return point

    def missing(self, numbers: range) -> dict[int, dict[str, float]]:
        """The gains of a batch's trials that are not done, by number.

        They follow from the batch's number and the trials of earlier batches, in their order.
        """
        import optuna

        missing = [number for number in numbers if number not in self.done]
        if not missing:
            return {}
        seed = np.random.SeedSequence([_SEED, numbers.start // _BATCH]).generate_state(1)[0]
        sampler = optuna.samplers.TPESampler(
            seed=int(seed), n_startup_trials=_STARTUP, multivariate=True, constant_liar=True
        )
        study = optuna.create_study(sampler=sampler)
        before = [self._frozen(self.done[number]) for number in range(numbers.start)]
        study.add_trials([trial for trial in before if trial.params])
        asked: dict[int, dict[str, float]] = {}
        for number in numbers:
            params = study.ask(self._distributions).params if number else {}
            asked[number] = {name: self.space[name].rounded(params[name]) for name in params}
        return {number: asked[number] for number in missing}

    def run(self, position: int, gains: dict[str, float]) -> RunSpec:
        """A run of the tuning set with other gains."""
        run = self.runs[position]
        return replace(run, gains={**gains_by_field(run.law, run.gains), **gains})

    def keep(self, trial: Trial) -> None:
        """Keep a trial, on the disk when this returns; a MobmanError if it cannot be written, or if the
        suite's own gains cannot be run: that is no matter of gains."""
        broken = [run for run in trial.runs if run.status in ("failed", "infeasible")]
        if trial.number == 0 and len(broken) == len(trial.runs):
            raise MobmanError(
                f"cannot tune {self.label!r}: it fails with the suite's own gains, in all runs of the "
                f"tuning set: {broken[0].message}"
            )
        try:
            self._study.add_trial(self._frozen(trial))
        except OSError as error:
            raise MobmanError(f"cannot write {self._path}: {error.strerror}") from error
        self.done[trial.number] = trial

    def _frozen(self, trial: Trial) -> optuna.trial.FrozenTrial:
        """A trial of a study; without parameters if its gains are no point of the space."""
        import optuna

        params = (trial.gains if trial.number else self.default) or {}
        return optuna.trial.create_trial(
            params=params,
            distributions=self._distributions if params else {},
            value=trial.score,
            user_attrs={"trial": trial.as_dict()},
        )


def require_extra() -> None:
    """Raise a MobmanError, with the remedy, if what only tuning needs is not installed."""
    try:
        import optuna
        import tomli_w  # noqa: F401
    except ImportError as error:
        raise MobmanError(
            f"tuning needs {error.name}, which is not installed; install it with: "
            "pip install 'mobman[tune]'"
        ) from error
    optuna.logging.set_verbosity(optuna.logging.ERROR)


def sampler_settings() -> dict[str, Any]:
    """Settings that the proposals depend on in addition to the trials, for records."""
    import optuna

    return {
        "sampler": "TPE",
        "optuna": optuna.__version__,
        "multivariate": True,
        "startup_trials": _STARTUP,
        "batch": _BATCH,
        "seed": _SEED,
    }


def journal(path: Path, *, fresh: bool) -> optuna.storages.BaseStorage:
    """The storage in a file, without what a killed process left: half of a line, or a lock.

    Neither the file nor its folder need exist; a fresh one is begun again.

    Raises:
        MobmanError: If it holds something else, or cannot be used.
    """
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if fresh:
            path.unlink(missing_ok=True)
        lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
        where = f"{path}, line 1,"
        for number, line in enumerate(lines, 1):
            where = f"{path}, line {number},"
            if line.endswith(b"\n"):
                json.loads(line)["op_code"]
            else:
                os.truncate(path, sum(map(len, lines[:-1])))
        # a killed process may have left its lock, for which optuna would wait for long, or for ever
        path.with_name(f"{path.name}.lock").unlink(missing_ok=True)
        return JournalStorage(JournalFileBackend(str(path.absolute())))
    except OSError as error:
        raise MobmanError(f"cannot use {path}: {error.strerror}") from error
    except Exception as error:  # lines of something else may mean anything to optuna
        raise MobmanError(f"{where} is no trial, or one of an earlier mobman; {_REMEDY}") from error


def steps(searches: Sequence[Search], count: int, backend: Backend, limit: float) -> Iterator[Step]:
    """Do so many trials of every controller, those that are done already excepted, and keep them.

    The searches share the objective; the limit is the wall time that a run may take (s).

    Raises:
        MobmanError: If the suite's own gains of a controller cannot be run at all, or a trial cannot be
            kept.
        OSError: If this machine, and no gains, made a run fail.
    """
    for first in range(0, count, _BATCH):
        numbers = range(first, min(first + _BATCH, count))
        missing = [search.missing(numbers) for search in searches]
        # trial by trial, and of each controller in turn: an interruption costs few that are half done
        asked = [
            (search, number, own[number])
            for number in numbers
            for search, own in zip(searches, missing, strict=True)
            if number in own
        ]
        owners = [(trial, i) for trial in asked for i in range(len(trial[0].runs))]
        runs = [search.run(i, gains) for (search, _, gains), i in owners]
        scores: dict[tuple[str, int], dict[int, RunScore]] = defaultdict(dict)
        for position, run in scores_of(runs, searches[0].objective, backend, limit):
            (search, number, gains), i = owners[position]
            own_scores = scores[search.label, number]
            own_scores[i] = run
            trial = None
            if len(own_scores) == len(search.runs):
                ordered = tuple(score for _, score in sorted(own_scores.items()))
                trial = Trial(search.label, number, gains, ordered)
                search.keep(trial)
            yield Step(search.label, number, run, trial)


def scores_of(
    runs: Sequence[RunSpec], objective: Objective, backend: Backend, limit: float
) -> Iterator[tuple[int, RunScore]]:
    """The scores of runs, each with its position, as they come."""
    jobs = jobs_of(runs, limit, with_file=False)
    positions = {id(job): position for position, job in enumerate(jobs)}
    for job, result in results(jobs, backend):
        position = positions[id(job)]
        yield position, _score(result, objective, runs[position].duration)


def _score(result: Result, objective: Objective, duration: float) -> RunScore:
    """The score of a run's result; what the law does wrong is scored, too."""
    if result.fault == "machine":
        raise OSError(result.message)
    if result.status == "failed":
        status = "infeasible" if result.fault == "gains" else "failed"
        message = result.message.removeprefix("GainError: ")
        return RunScore(objective.score(status, {}, 0.0), status, message, {}, result.seconds)
    if missing := [name for name in objective.metrics if name not in result.metrics]:
        raise MobmanError(
            f"the objective {objective.name!r} needs the metric {missing[0]!r}, which no run has"
        )
    metrics = {name: result.metrics[name] for name in objective.metrics}
    score = objective.score(result.status, metrics, result.end / duration)
    return RunScore(score, result.status, result.message, metrics, result.seconds)
