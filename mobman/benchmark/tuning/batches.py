"""The trials of all controllers, batch after batch; a batch of all of them at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

from mobman.benchmark.tuning.evaluation import RunScore, evaluate
from mobman.benchmark.tuning.journal import Journal
from mobman.benchmark.tuning.proposals import BATCH
from mobman.benchmark.tuning.search import Search
from mobman.benchmark.tuning.trial import Trial
from mobman.errors import MobmanError

_Key = tuple[str, int]
"""A controller's label and a trial's number."""


@dataclass(frozen=True)
class Step:
    """A run of a trial that was done, and the trial if that was its last."""

    label: str
    number: int
    run: RunScore
    trial: Trial | None


class Batches:
    """Does the trials that are not done yet, and keeps them.

    Args:
        searches: What is searched, by label; the objective is the same for all.
        journal: Where trials are kept; those that are there are not done again.
        executor: What does the runs.
        limit: Wall time that a run may take (s).
        on_step: Called after each run that was done.
    """

    def __init__(
        self,
        searches: Mapping[str, Search],
        journal: Journal,
        executor: Executor,
        limit: float,
        on_step: Callable[[Step], None] | None = None,
    ) -> None:
        self._searches, self._journal = searches, journal
        self._executor, self._limit, self._on_step = executor, limit, on_step
        self._done: dict[str, list[Trial]] = {label: [] for label in searches}

    def trials(self, count: int) -> dict[str, list[Trial]]:
        """So many trials of every controller, by label, in order.

        Raises:
            MobmanError: If the suite's own gains of a controller cannot be run at all, or a trial
                cannot be kept.
        """
        for first in range(0, count, BATCH):
            numbers = range(first, min(first + BATCH, count))
            self._do(self._missing(numbers))
            for label, done in self._done.items():
                done += [trial for n in numbers if (trial := self._journal.get(label, n))]
        return self._done

    def _missing(self, numbers: range) -> dict[_Key, dict[str, float]]:
        """The gains of a batch's trials that are not done yet."""
        asked: dict[_Key, dict[str, float]] = {}
        for label, search in self._searches.items():
            missing = [number for number in numbers if self._journal.get(label, number) is None]
            if missing:
                gains = search.gains_of_batch(self._done[label], numbers.start, len(numbers))
                asked |= {(label, number): gains[number - numbers.start] for number in missing}
        # trial by trial, and of each controller in turn: an interruption costs few that are half done
        return dict(sorted(asked.items(), key=lambda item: item[0][1]))

    def _do(self, asked: Mapping[_Key, dict[str, float]]) -> None:
        """Do trials with these gains, at once."""
        owners = [key for key in asked for _ in self._searches[key[0]].runs]
        evaluations = [
            one for key, gains in asked.items() for one in self._searches[key[0]].evaluations(gains)
        ]
        objective = next(iter(self._searches.values())).objective
        scores: dict[_Key, dict[int, RunScore]] = {key: {} for key in asked}
        for position, run in evaluate(evaluations, objective, self._executor, self._limit):
            key = label, number = owners[position]
            scores[key][position] = run
            trial = None
            if len(scores[key]) == len(self._searches[label].runs):
                runs = tuple(run for _, run in sorted(scores[key].items()))
                trial = Trial(label, number, asked[key], runs)
                _require_some_run(trial)
                self._journal.add(trial)
            if self._on_step is not None:
                self._on_step(Step(label, number, run, trial))


def _require_some_run(trial: Trial) -> None:
    """Raises MobmanError if the suite's own gains cannot be run: that is no matter of gains."""
    broken = [run for run in trial.runs if run.status in ("failed", "infeasible")]
    if trial.number == 0 and len(broken) == len(trial.runs):
        raise MobmanError(
            f"cannot tune {trial.label!r}: it fails with the suite's own gains, in all runs of the "
            f"tuning set: {broken[0].message}"
        )
