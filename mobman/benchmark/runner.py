"""Running a suite: in parallel, resumable, and never stopped by one run."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from typing import Any

from mobman.benchmark.running.given import Given
from mobman.benchmark.running.job import Job, Result, this_process
from mobman.benchmark.running.local import Local, default_workers
from mobman.benchmark.running.loop import results
from mobman.benchmark.running.outcome import (
    Again,
    Ended,
    Event,
    Outcome,
    Running,
    Started,
    Summary,
    Waiting,
)
from mobman.benchmark.running.parcel import Parcel
from mobman.benchmark.running.place import Place
from mobman.benchmark.store import Store
from mobman.benchmark.suite import Suite
from mobman.controllers.protocol import controllers
from mobman.errors import MobmanError, UsageError
from mobman.kernels.ahead import compile_ahead, compiled_ahead
from mobman.robots.catalogue import find_spec
from mobman.simulation.run_spec import RunSpec
from mobman.tasks.task import tasks

__all__ = [
    "Again",
    "Ended",
    "Event",
    "Outcome",
    "Running",
    "Started",
    "Summary",
    "Waiting",
    "default_workers",
    "run_suite",
]


def run_suite(
    suite: Suite,
    folder: str | os.PathLike[str],
    *,
    executor: Executor | Callable[[], Executor] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    fresh: bool = False,
    part: tuple[int, int] | None = None,
    time_limit: float | None = None,
    on_event: Callable[[Event], None] | None = None,
) -> Summary:
    """Run what a suite asks for and is not in the folder yet.

    By default in processes of this machine. Only this process writes to the folder; workers send what
    they have, and need no file system in common with it.

    Args:
        suite: The suite.
        folder: Where its results are kept; see :class:`Store`.
        executor: What does the runs instead; or a function that makes it, so that it can be replaced
            when it breaks.
        workers: Processes; one for each core by default.
        dask: Address of the scheduler of a Dask cluster that does the runs instead.
        fresh: Re-run everything, ignoring existing results.
        part: ``(k, n)``: only every n-th run, from the k-th on, the first being 1; so that n machines
            share a suite.
        time_limit: Wall time that a run may take (s); the suite's by default.
        on_event: Is told what happens.

    Raises:
        SpecError: If the suite names what is not there.
        MobmanError: If the folder cannot be used, or the executor or cluster is lost; what was done
            is kept.
        UsageError: If an argument makes no sense.
    """
    limit = suite.time_limit if time_limit is None else time_limit
    if not limit > 0:
        raise UsageError(f"time_limit = {limit!r}: must be above 0 s")
    _check_place(executor, workers, dask)
    tell = on_event or _nothing
    asked = suite.runs()
    runs = asked if part is None else _part(asked, *part)
    store = Store(folder)
    store.begin(suite, asked)
    if fresh:
        store.forget(runs)
    todo = [run for run in runs if not store.done(run)]
    summary = Summary(asked=len(runs), skipped=len(runs) - len(todo))
    tell(Started(summary.asked, summary.skipped, tuple(todo)))
    started = time.monotonic()
    if todo:
        with _place(executor, workers, dask, len(todo), limit) as place:
            try:
                _run(todo, place, store, limit, summary, tell)
            except MobmanError as error:
                raise MobmanError(
                    f"{error}; the suite stopped: {len(summary.outcomes)} of {len(todo)} runs were done "
                    f"and are kept in {store.folder}, and it goes on from there when started again"
                ) from error
    summary.seconds = time.monotonic() - started
    store.finish(
        summary.seconds if summary.outcomes else None, summary.workers if summary.outcomes else None
    )
    return summary


def _place(
    executor: Executor | Callable[[], Executor] | None,
    workers: int | None,
    dask: str | None,
    runs: int,
    limit: float,
) -> Place:
    if dask is not None:
        from mobman.benchmark.running.cluster import Cluster

        return Cluster(dask)
    if executor is not None:
        if not compiled_ahead():
            compile_ahead()  # here and once, instead of in every worker
        return Given(executor)
    return Local(min(default_workers() if workers is None else workers, runs), limit)


def _check_place(executor: object, workers: int | None, dask: str | None) -> None:
    given = {"executor": executor, "workers": workers, "dask": dask}
    chosen = [name for name, value in given.items() if value is not None]
    if len(chosen) > 1:
        raise UsageError(f"{' and '.join(chosen)} are given: choose one of them")
    if workers is not None and workers < 1:
        raise UsageError(f"workers = {workers!r}: must be 1 or more")


def _run(
    todo: list[RunSpec],
    place: Place,
    store: Store,
    limit: float,
    summary: Summary,
    tell: Callable[[Event], None],
) -> None:
    jobs = jobs_of(todo, limit, place.dumps())
    place.prepare(list({id(p): p for job in jobs for p in (job.robot, job.law, job.task)}.values()))
    for news in results(jobs, place):
        if not isinstance(news, tuple):
            if isinstance(news, Running):
                summary.workers = max(summary.workers, news.count)
            tell(news)
            continue
        job, result = news
        _keep(job.run, result, store)
        outcome = Outcome(job.run, result.status, result.message, result.task_error)
        summary.outcomes.append(outcome)
        tell(Ended(outcome))


def _keep(run: RunSpec, result: Result, store: Store) -> None:
    if result.content is None:
        store.fail(run, result.message)
    else:
        store.keep(run, result.content)


def jobs_of(runs: Iterable[RunSpec], time_limit: float, dumps: Callable[[Any], bytes]) -> list[Job]:
    """The runs with what their names mean here."""
    parcels: dict[tuple[str, str], Parcel] = {}

    def parcel(kind: str, name: str, find: Callable[[str], Any]) -> Parcel:
        if (kind, name) not in parcels:
            parcels[kind, name] = Parcel(f"{kind} {name!r}", find(name), dumps)
        return parcels[kind, name]

    return [
        Job(
            run=run,
            robot=parcel("robot", run.robot, find_spec),
            law=parcel("controller", run.law, controllers.get),
            task=parcel("task", run.task_name, tasks.get),
            time_limit=time_limit,
            origin=this_process(),
        )
        for run in runs
    ]


def _part(runs: list[RunSpec], k: int, n: int) -> list[RunSpec]:
    if not 1 <= k <= n:
        raise UsageError(f"part {k}/{n}: the first number must be from 1 to the second")
    return runs[k - 1 :: n]


def _nothing(event: Event) -> None:
    """Nobody listens."""
