"""Running a suite: in parallel, resumable, and never stopped by one run."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mobman.benchmark.run_spec import RunSpec
from mobman.benchmark.store import Store
from mobman.benchmark.suite import Suite
from mobman.controllers.protocol import controllers, make_controller
from mobman.kernels.ahead import compile_ahead, compiled_ahead
from mobman.model.build import load_robot
from mobman.robots.catalogue import find_spec
from mobman.robots.spec import RobotSpec
from mobman.simulation.closed_loop import simulate
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import TaskFactory, tasks

# One thread a worker: the matrices are small, and the workers use all cores already.
_ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)


@dataclass(frozen=True)
class Outcome:
    """How one run went."""

    run: RunSpec
    status: str
    """The record's, or ``"failed"`` if there is none."""
    message: str
    task_error: float
    """Its metric task_error_max (m); NaN if there is no record."""


@dataclass
class Summary:
    """How a suite went."""

    asked: int = 0
    skipped: int = 0
    seconds: float = 0.0
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def failed(self) -> list[Outcome]:
        """Runs without a result."""
        return [outcome for outcome in self.outcomes if outcome.status == "failed"]


def default_workers() -> int:
    """One for each core that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_suite(
    suite: Suite,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    fresh: bool = False,
    on_start: Callable[[int, int], None] | None = None,
    on_done: Callable[[Outcome], None] | None = None,
) -> Summary:
    """Run what a suite asks for and is not in the folder yet.

    Args:
        suite: The suite.
        folder: Where its results are kept; see :class:`Store`.
        workers: Processes; one for each core by default.
        fresh: Run everything anew.
        on_start: Called with the number of runs and how many of them are there already.
        on_done: Called after each run.

    Raises:
        SpecError: If the suite names what is not there.
        MobmanError: If the folder cannot be used.
    """
    workers = default_workers() if workers is None else workers
    runs = suite.runs()
    store = Store(folder)
    store.begin(suite, runs)
    if fresh:
        for run in runs:
            store.path(run).unlink(missing_ok=True)
    todo = [run for run in runs if not store.done(run)]
    summary = Summary(asked=len(runs), skipped=len(runs) - len(todo))
    if on_start is not None:
        on_start(summary.asked, summary.skipped)
    if todo and not compiled_ahead():
        compile_ahead()  # here and once, instead of in every worker
    started = time.monotonic()
    with _one_thread():
        for outcome in _in_parallel(todo, store, workers):
            summary.outcomes.append(outcome)
            if on_done is not None:
                on_done(outcome)
    summary.seconds = time.monotonic() - started
    for outcome in summary.failed:
        store.fail(outcome.run, outcome.message)
    store.finish(summary.seconds if summary.outcomes else None, workers)
    return summary


def _in_parallel(todo: list[RunSpec], store: Store, workers: int) -> Iterator[Outcome]:
    """The outcomes, as they come; a run that kills its process costs nothing but itself."""
    left = {run.run_id: run for run in todo}
    while left:
        try:
            for outcome in _pool(list(left.values()), store, workers):
                del left[outcome.run.run_id]
                yield outcome
        except BrokenProcessPool:
            # One of those in progress killed its process (out of memory, say); they are the first
            # that are left. Alone in a process of its own, the culprit shows itself.
            for run in list(left.values())[: workers + 1]:
                yield _alone(run, store)
                del left[run.run_id]


def _alone(run: RunSpec, store: Store) -> Outcome:
    try:
        return next(_pool([run], store, 1))
    except BrokenProcessPool:
        return Outcome(run, "failed", "its process was killed (out of memory?)", float("nan"))


def _pool(todo: list[RunSpec], store: Store, workers: int) -> Iterator[Outcome]:
    # "spawn": a worker starts clean, with one thread, whatever this process has loaded
    executor = ProcessPoolExecutor(
        min(workers, len(todo)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
    )
    try:
        futures = [
            executor.submit(
                perform,
                run,
                find_spec(run.robot),
                controllers.get(run.law),
                tasks.get(run.task),
                store.path(run),
            )
            for run in todo
        ]
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool:
        raise
    except BaseException:
        # Ctrl-C, or an error: runs in progress are worthless half done, so do not wait for them
        for process in list((executor._processes or {}).values()):
            process.terminate()
        raise
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def perform(
    run: RunSpec, robot: RobotSpec, law: type[Any], factory: TaskFactory, path: Path
) -> Outcome:
    """Do one run and keep its record; what goes wrong is an outcome, not an exception.

    Args:
        run: What to do.
        robot: What its robot's name means where the suite was started; this process may not know.
        law: The same for its law.
        factory: The same for its task.
        path: Where the record goes.
    """
    try:
        controllers.register(run.law, law)
        tasks.register(run.task, factory)
        record = simulate(
            load_robot(robot),
            make_controller(run.law, **run.gains),
            run.task,
            duration=run.duration,
            dt=run.dt,
            scenario=Scenario.model_validate(run.scenario),
            seed=run.seed,
        )
        record.save(path, every=run.record_every)
    except Exception as error:
        # a robot that does not load, a bug in a plugin, a full disk: this run's matter alone
        return Outcome(run, "failed", f"{type(error).__name__}: {error}", float("nan"))
    return Outcome(
        run, record.status, record.message, record.metrics.get("task_error_max", float("inf"))
    )


def _start_worker() -> None:
    # Ctrl-C goes to the whole process group; only the parent acts on it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
