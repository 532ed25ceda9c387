"""Processes of this machine to evaluate trials in."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor

from mobman.benchmark.running.one_thread import one_thread_for_children
from mobman.benchmark.running.worker_processes import WorkerProcesses
from mobman.errors import MobmanError


@contextlib.contextmanager
def local_processes(workers: int) -> Iterator[Executor]:
    """An executor of so many processes; on Ctrl-C they end at once.

    Raises:
        MobmanError: If they cannot be started.
    """
    with one_thread_for_children():
        processes = WorkerProcesses(workers)
        try:
            yield processes
        except BaseException as error:
            processes.kill()
            if isinstance(error, BrokenExecutor):
                raise MobmanError(str(error)) from error
            raise
        processes.shutdown()
