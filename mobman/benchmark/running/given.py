"""Runs by an executor that the caller has."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from types import TracebackType
from typing import Self

from mobman.benchmark.running.job import Job, Result
from mobman.benchmark.running.local import default_workers
from mobman.benchmark.running.perform import perform
from mobman.benchmark.running.place import Place
from mobman.errors import MobmanError


class Given(Place):
    """Any :class:`concurrent.futures.Executor`.

    Args:
        executor: The executor, which stays the caller's; or what makes one, again when one breaks.
    """

    blames_exactly = False

    def __init__(self, executor: Executor | Callable[[], Executor]) -> None:
        self._make = None if isinstance(executor, Executor) else executor
        self._executor = executor if isinstance(executor, Executor) else executor()
        self._futures: set[Future[Result]] = set()

    def slots(self) -> int:
        # what Python's own executors have; another one gets a little more than it needs
        return int(getattr(self._executor, "_max_workers", default_workers()))

    def submit(self, job: Job) -> Future[Result]:
        future = self._executor.submit(perform, job)
        self._futures.add(future)
        future.add_done_callback(self._futures.discard)
        return future

    def loss(self, error: BaseException) -> str | None:
        return "its worker process died" if isinstance(error, BrokenExecutor) else None

    def renew(self, error: BaseException) -> None:
        if self._make is None:
            raise MobmanError(
                f"the executor broke ({error}), since a run ended its process; what was done is kept. "
                "Give a function that makes an executor, and it is replaced instead"
            ) from error
        self._executor.shutdown(wait=False)
        self._executor = self._make()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for future in list(self._futures):
            future.cancel()
        if self._make is not None:
            self._executor.shutdown(wait=kind is None, cancel_futures=True)
