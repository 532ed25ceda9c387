"""Running a suite: in parallel, resumable, and never stopped by one run."""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, NamedTuple

from mobman.benchmark.backends import Backend, Cluster, Local, default_workers
from mobman.benchmark.store import Store
from mobman.benchmark.suite import Suite, load_suite
from mobman.benchmark.work import Job, Result, failure, jobs_of
from mobman.benchmark.workers import preload
from mobman.compiled import anything_kept
from mobman.display import Displayed, Shown
from mobman.errors import MobmanError, UsageError
from mobman.simulation.run_spec import RunSpec

if TYPE_CHECKING:
    from mobman.benchmark.report.report import ReportFiles

_TRIES = 2  # of a run whose worker is lost, or that ran out of time or memory
_LOOK = 0.5  # s, from one look at the workers to the next


class Outcome(NamedTuple):
    """Outcome of one run."""

    run: RunSpec
    status: str  # the record's, or "failed" if there is none
    message: str
    task_error: float  # its metric task_error_max (m); NaN if there is no record


@dataclass(repr=False)
class Summary(Displayed):
    """Outcome of a suite."""

    asked: int = 0
    skipped: int = 0
    seconds: float = 0.0
    workers: int = 0  # runs at a time; on a cluster, the most that there were
    outcomes: list[Outcome] = field(default_factory=list)
    changed: list[tuple[RunSpec, str]] = field(default_factory=list)
    """Runs of ``skipped`` that mobman's present source files and libraries did not make, and the
    differences."""
    report: ReportFiles | None = None  # paths of the report, if it was written

    def _shown(self) -> Shown:
        done, failed = len(self.outcomes), len(self.failed)
        line = (
            f"Summary({self.asked} runs: {self.skipped} were there, {done} done in "
            f"{self.seconds:.1f} s, {failed} failed)"
        )
        ends = Counter(outcome.status for outcome in self.outcomes)
        facts: dict[str, object] = {"runs": self.asked, "there before": self.skipped, **ends}
        facts |= {"seconds": self.seconds, "workers": self.workers}
        return Shown(line, facts | ({"report": self.report.html} if self.report else {}))

    @property
    def failed(self) -> list[Outcome]:
        """Runs without a result."""
        return [outcome for outcome in self.outcomes if outcome.status == "failed"]


class Started(NamedTuple):
    """Event: the suite begins."""

    asked: int
    skipped: int  # runs that were there already
    todo: tuple[RunSpec, ...]


@dataclass(frozen=True)
class Running:
    """Event: the number of runs in progress has changed."""

    count: int


class Ended(NamedTuple):
    """Event: a run is done."""

    outcome: Outcome


class Again(NamedTuple):
    """Event: a run is retried once, for a reason outside its controller."""

    run: RunSpec
    reason: str


class Waiting(NamedTuple):
    """Event: nothing can go on for now; the reason is empty when it does."""

    reason: str


Event = Started | Running | Ended | Again | Waiting


def run_suite(
    suite: Suite | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    executor: Executor | Callable[[], Executor] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    fresh: bool = False,
    redo_changed: bool = False,
    part: tuple[int, int] | None = None,
    time_limit: float | None = None,
    report: bool = True,
    on_event: Callable[[Event], None] | None = None,
) -> Summary:
    """Do the runs of a suite that are not in the folder yet, and write its report.

    >>> import mobman as mm
    >>> summary = mm.run_suite("quick", "results/quick")  # doctest: +SKIP
    >>> summary.failed, summary.report.html  # doctest: +SKIP
    ([], PosixPath('results/quick/report.html'))

    By default in processes of this machine. Only this process writes to the folder; workers send what
    they have, and need no file system in common with it.

    Args:
        suite: The suite, its name, or its TOML file.
        folder: Folder of its results; see :class:`Store`.
        executor: Executor that does the runs instead; or a function that makes one, so that it can be
            replaced when it breaks. An executor of threads cannot end a law that never returns.
        workers: Processes; one for each core by default.
        dask: Address of the scheduler of a Dask cluster that does the runs instead.
        fresh: Re-run everything, ignoring existing results.
        redo_changed: Run those again that other source files of mobman or other versions of libraries
            made; by default they are kept, and listed in the summary.
        part: ``(k, n)``: only every n-th run, from the k-th on, the first being 1; so that n machines
            share a suite.
        time_limit: Wall time that a run may take (s); the suite's by default.
        report: True to write the report of all runs at the end; none is written of a part.
        on_event: Function that is called with each event.

    Raises:
        SpecError: If the suite names what is not there.
        MobmanError: If the folder cannot be used, or the executor or cluster is lost; what was done
            is kept.
        UsageError: If an argument makes no sense.
    """
    if not isinstance(suite, Suite):
        suite = load_suite(suite)
    limit = suite.time_limit if time_limit is None else time_limit
    if not (isinstance(limit, Real) and limit > 0):
        raise UsageError(f"time_limit = {limit!r}: must be above 0 s")
    given = {"executor": executor, "workers": workers, "dask": dask}
    chosen = [name for name, value in given.items() if value is not None]
    if len(chosen) > 1:
        raise UsageError(f"{' and '.join(chosen)} are given: choose one of them")
    if workers is not None and not (isinstance(workers, int) and workers >= 1):
        raise UsageError(f"workers = {workers!r}: must be a whole number, 1 or more")
    numbers = isinstance(part, tuple | list) and [k for k in part if isinstance(k, int)]
    if part is not None and not (numbers and len(numbers) == 2 and 1 <= numbers[0] <= numbers[1]):
        raise UsageError(f"part = {part!r}: must be whole numbers (k, n), k from 1 to n")
    for name, value, fine, expected in (
        ("on_event", on_event, callable(on_event), "a function"),
        ("dask", dask, isinstance(dask, str), "the address of a scheduler"),
        ("executor", executor, isinstance(executor, Executor) or callable(executor), "an executor"),
    ):
        if value is not None and not fine:
            raise UsageError(f"{name} = {value!r}: expected {expected}")
    tell = on_event or (lambda event: None)
    asked = suite.runs()
    runs = asked if part is None else asked[part[0] - 1 :: part[1]]
    store = Store(folder)
    store.begin(suite, asked)
    if fresh:
        store.forget(runs)
    there = [run for run in runs if store.done(run)]
    changed = [(run, difference) for run in there if (difference := store.changed(run))]
    if redo_changed:
        store.forget([run for run, _ in changed])
        there, changed = [run for run in there if store.done(run)], []
    ids = {run.run_id for run in there}
    todo = [run for run in runs if run.run_id not in ids]
    summary = Summary(asked=len(runs), skipped=len(there), changed=changed)
    tell(Started(summary.asked, summary.skipped, tuple(todo)))
    if todo:
        started = time.monotonic()
        if dask is None and not anything_kept():
            preload()  # compile here and once, instead of in every process that starts
        jobs = jobs_of(todo, limit)
        if dask is not None:
            backend: Backend = Cluster(dask, jobs)
        elif executor is not None:
            backend = Backend(executor)
        else:
            backend = Local(min(workers or default_workers(), len(todo)), limit)
        _do(jobs, backend, store, summary, tell)
        summary.seconds = time.monotonic() - started
        store.finish(summary.seconds, summary.workers)
    else:
        store.finish()
    if report and part is None:
        from mobman.benchmark.report.report import report_on  # which takes a second

        summary.report = report_on(folder)
    return summary


def _do(
    jobs: Sequence[Job],
    backend: Backend,
    store: Store,
    summary: Summary,
    tell: Callable[[Event], None],
) -> None:
    """Do runs, and put their results into the folder and what came of them into the summary."""

    def note(event: Event) -> None:
        if isinstance(event, Running):
            summary.workers = max(summary.workers, event.count)
        tell(event)

    with backend:
        try:
            for job, result in results(jobs, backend, note):
                if result.content is None:
                    store.fail(job.run, result.message)
                else:
                    store.keep(job.run, result.content)
                error = result.metrics.get("task_error_max", float("nan"))
                outcome = Outcome(job.run, result.status, result.message, error)
                summary.outcomes.append(outcome)
                tell(Ended(outcome))
        except MobmanError as error:
            raise MobmanError(
                f"{error}; the suite stopped: {len(summary.outcomes)} of {len(jobs)} runs were done "
                f"and are kept in {store.folder}, and it goes on from there when started again"
            ) from error


@dataclass
class _Try:
    job: Job
    number: int = 1
    executor: int = 0  # number of the backend's executor that has it, in their order


def results(
    jobs: Sequence[Job], backend: Backend, tell: Callable[[Event], None] = lambda event: None
) -> Iterator[tuple[Job, Result]]:
    """Each job's result as it comes.

    Only a window of the jobs is submitted at a time: there is little to call back. A job whose worker
    died is tried once more; where it is not certain that it is to blame, after all the others and with
    no other at the same time.

    Raises:
        MobmanError: If the backend is lost.
    """
    left, suspects = deque(_Try(job) for job in jobs), deque[_Try]()
    submitted: dict[Future[Result], _Try] = {}
    executor, running, waiting = 0, 0, False
    slots, looked = backend.slots(), time.monotonic()

    def again(
        trial: _Try, reason: str, queue: deque[_Try], fault: str = ""
    ) -> Iterator[tuple[Job, Result]]:
        run = trial.job.run
        if trial.number == _TRIES:
            yield trial.job, failure(run, f"{reason}; tried {_TRIES} times", fault=fault)
        else:
            queue.append(_Try(trial.job, trial.number + 1))
            tell(Again(run, reason))

    def renew(error: BrokenExecutor, trial: _Try) -> None:
        """Have another executor, once for all jobs that the broken one had."""
        nonlocal executor
        if trial.executor == executor:
            backend.renew(error)
            executor += 1

    while left or suspects or submitted:
        while len(submitted) < backend.ahead * slots and (left or (suspects and not submitted)):
            trial = left.popleft() if left else suspects.popleft()
            trial.executor = executor
            try:
                submitted[backend.submit(trial.job)] = trial
            except BrokenExecutor as error:
                left.appendleft(trial)  # it was not begun
                renew(error, trial)
        if (now := min(len(submitted), slots)) != running:
            running = now
            tell(Running(running))
        if waiting != (slots == 0):
            waiting = slots == 0
            tell(Waiting(backend.waits_for if waiting else ""))
        if not submitted:
            time.sleep(_LOOK)
        for future in wait(submitted, timeout=_LOOK, return_when=FIRST_COMPLETED).done:
            trial = submitted.pop(future)
            job, run = trial.job, trial.job.run
            try:
                result = future.result()
                if result.run_id != run.run_id:
                    raise MobmanError(f"a worker answered for another run, {result.run_id}")
            except CancelledError:
                backend.slots()  # raises if it is because the backend is lost
                yield from again(trial, "was cancelled from outside", left)
            except BaseException as error:
                if isinstance(error, BrokenExecutor):
                    renew(error, trial)
                if (reason := backend.loss(error)) is None:
                    kind = "" if isinstance(error, MobmanError) else f"{type(error).__name__}: "
                    yield job, failure(run, f"{kind}{error}")
                else:
                    yield from again(trial, reason, left if backend.blames_exactly else suspects)
            else:
                if result.again:
                    yield from again(trial, result.message, left, result.fault)
                else:
                    yield job, result
            del future  # and with it the result's content
        if not submitted or time.monotonic() - looked > _LOOK:
            slots, looked = backend.slots(), time.monotonic()
