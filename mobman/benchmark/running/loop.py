"""From a list of jobs to their results, whatever happens to the workers."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from mobman.benchmark.running.job import Job, Result
from mobman.benchmark.running.outcome import Again, Running, Waiting
from mobman.benchmark.running.place import Place

_TRIES = 2  # of a run whose worker is lost, or that ran out of time or memory
_AHEAD = 2  # jobs submitted for each that can be in progress, so that no worker waits for its next
_LOOK = 0.5  # s, from one look at the workers to the next

News = tuple[Job, Result] | Again | Running | Waiting


def results(jobs: Iterable[Job], place: Place) -> Iterator[News]:
    """Each job's result as it comes, and what is worth telling on the way.

    Only a window of the jobs is submitted at a time: there is little to call back. A job whose worker
    died is tried once more; where it is not sure that it is to blame, after all the others and with
    nothing beside it.

    Raises:
        MobmanError: If the place is lost.
    """
    return _Loop(jobs, place).run()


@dataclass
class _Try:
    job: Job
    number: int = 1
    executor: int = 0
    """Which of the place's executors, one after the other, has it."""


class _Loop:
    def __init__(self, jobs: Iterable[Job], place: Place) -> None:
        self._place = place
        self._left = deque(_Try(job) for job in jobs)
        self._suspects: deque[_Try] = deque()
        """Those that may have ended a worker."""
        self._submitted: dict[Future[Result], _Try] = {}
        self._ended: SimpleQueue[Future[Result]] = SimpleQueue()
        self._executor = 0
        self._slots, self._looked = 0, 0.0
        self._running, self._waiting = 0, False

    def run(self) -> Iterator[News]:
        """See :func:`results`."""
        self._look()
        while self._left or self._suspects or self._submitted:
            self._fill()
            yield from self._changes()
            try:
                future = self._ended.get(timeout=_LOOK)
            except Empty:
                pass
            else:
                yield from self._handle(self._submitted.pop(future), future)
                del future  # and with it the result's content
            if time.monotonic() - self._looked > _LOOK:
                self._look()
        yield from self._changes()

    def _look(self) -> None:
        self._slots, self._looked = self._place.slots(), time.monotonic()

    def _changes(self) -> Iterator[News]:
        if (running := min(len(self._submitted), self._slots)) != self._running:
            self._running = running
            yield Running(running)
        if self._waiting != (self._slots == 0):
            self._waiting = self._slots == 0
            yield Waiting(self._place.waits_for if self._waiting else "")

    def _fill(self) -> None:
        while len(self._submitted) < _AHEAD * self._slots and (trial := self._next()) is not None:
            trial.executor = self._executor
            try:
                future = self._place.submit(trial.job)
            except BrokenExecutor as error:
                self._left.appendleft(trial)  # it was not begun
                self._renew(error, trial)
                return
            self._submitted[future] = trial
            future.add_done_callback(self._ended.put)

    def _next(self) -> _Try | None:
        if self._left:
            return self._left.popleft()
        if self._suspects and not self._submitted:
            return self._suspects.popleft()
        return None

    def _handle(self, trial: _Try, future: Future[Result]) -> Iterator[News]:
        try:
            result = future.result()
        except CancelledError:
            self._look()  # raises if it is because the place is lost
            yield from self._again(trial, "was cancelled from outside", self._left)
        except BaseException as error:
            if isinstance(error, BrokenExecutor):
                self._renew(error, trial)
            if (reason := self._place.loss(error)) is None:
                yield trial.job, Result.failure(f"{type(error).__name__}: {error}")
            else:
                sure = self._place.blames_exactly
                yield from self._again(trial, reason, self._left if sure else self._suspects)
        else:
            if result.again:
                yield from self._again(trial, result.message, self._left, result.fault)
            else:
                yield trial.job, result

    def _again(
        self, trial: _Try, reason: str, where: deque[_Try], fault: str = ""
    ) -> Iterator[News]:
        if trial.number == _TRIES:
            message = f"{reason}; tried {trial.number} times"
            yield trial.job, Result.failure(message, fault=fault)
            return
        where.append(_Try(trial.job, trial.number + 1))
        yield Again(trial.job.run, reason)

    def _renew(self, error: BrokenExecutor, trial: _Try) -> None:
        """Have another executor, once for all that the broken one had."""
        if trial.executor == self._executor:
            self._place.renew(error)
            self._executor += 1
