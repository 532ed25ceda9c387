"""Runs in processes of this machine."""

from __future__ import annotations

import os
from concurrent.futures import BrokenExecutor, Future
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from mobman.benchmark.running.job import Job, Result
from mobman.benchmark.running.one_thread import one_thread_for_children
from mobman.benchmark.running.perform import perform
from mobman.benchmark.running.place import Place
from mobman.benchmark.running.time_limit import ENDED_BY, grace
from mobman.benchmark.running.worker_process import WorkerLostError
from mobman.benchmark.running.worker_processes import WorkerProcesses
from mobman.errors import MobmanError


def default_workers() -> int:
    """One for each core that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Local(Place):
    """Processes of this machine.

    Args:
        count: How many.
        time_limit: Of a run (s), for messages.
    """

    def __init__(self, count: int, time_limit: float) -> None:
        self._count = count
        self._time_limit = time_limit
        self._processes = WorkerProcesses(count)
        self._stack = ExitStack()

    def slots(self) -> int:
        return self._count

    def submit(self, job: Job) -> Future[Result]:
        return self._processes.submit(perform, job)

    def loss(self, error: BaseException) -> str | None:
        if not isinstance(error, WorkerLostError):
            return None
        if error.exit_code == -ENDED_BY:
            seconds = self._time_limit + grace(self._time_limit)
            return (
                f"did not heed its time limit of {self._time_limit:g} s, and was ended after "
                f"{seconds:g} s"
            )
        return str(error)

    def renew(self, error: BaseException) -> None:
        if isinstance(error, BrokenExecutor):
            raise MobmanError(str(error)) from error
        raise error

    def __enter__(self) -> Self:
        self._stack.enter_context(one_thread_for_children())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._stack:
            if kind is None:
                self._processes.shutdown()
            else:  # runs half done are worthless
                self._processes.kill()
