"""Backends: workers that do a suite's runs, of any Executor, on this machine, or on a Dask cluster."""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import sys
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from typing import Any, Self

from mobman.benchmark.work import Job, Result, packed, parts_of, perform, perform_packed
from mobman.benchmark.workers import WorkerLostError, Workers
from mobman.errors import MobmanError, UsageError
from mobman.provenance import versions

_ANSWER = 5.0  # s, for a scheduler to answer in
_LOGGERS = ("distributed", "distributed.client", "distributed.core", "distributed.utils")


def default_workers() -> int:
    """One for each core that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Backend:
    """Workers that jobs are given to; a context, at whose end none is left behind.

    Args:
        executor: Any executor, which stays the caller's; or a function that makes one, again when one
            breaks.
    """

    ahead = 2
    """Jobs submitted for each that can be in progress, so that no worker waits for its next."""
    blames_exactly = False
    """True if a worker has one piece of work at a time: what it died with is what it died of. Those of a
    cluster have their next with them already."""
    waits_for = "there are no workers"
    """Reason for which there are no slots."""
    _make: Callable[[], Executor] | None = None

    def __init__(self, executor: Executor | Callable[[], Executor]) -> None:
        self._make = None if isinstance(executor, Executor) else executor
        self._executor = executor if isinstance(executor, Executor) else executor()
        self._futures: set[Future[Result]] = set()

    def slots(self) -> int:
        """Number of runs that can be in progress now; a MobmanError if the workers are lost."""
        # an attribute of Python's own executors; another one gets a little more than it needs
        return int(getattr(self._executor, "_max_workers", default_workers()))

    def submit(self, job: Job) -> Future[Result]:
        """Have a job done; a BrokenExecutor if no more jobs are taken, see :meth:`renew`."""
        future = self._executor.submit(perform, job)
        self._futures.add(future)
        future.add_done_callback(self._futures.discard)
        return future

    def loss(self, error: BaseException) -> str | None:
        """In words, how the worker that had a job was lost; None if the error is another."""
        return "its worker process died" if isinstance(error, BrokenExecutor) else None

    def renew(self, error: BaseException) -> None:
        """Go on after an executor broke as a whole; a MobmanError if there is no way to."""
        if self._make is None:
            raise MobmanError(
                f"the executor broke ({error}), since a run ended its process; what was done is kept. "
                "Give a function that makes an executor, and it is replaced instead"
            ) from error
        self._executor.shutdown(wait=False)
        self._executor = self._make()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        for future in list(self._futures):
            future.cancel()
        if self._make is not None:
            self._executor.shutdown(wait=kind is None, cancel_futures=True)


class Local(Backend):
    """So many processes of this machine, and the wall time that a run may take (s)."""

    blames_exactly = True

    def __init__(self, count: int, time_limit: float) -> None:
        super().__init__(lambda: Workers(count, time_limit))
        self._limit = time_limit

    def submit(self, job: Job) -> Future[Result]:
        """Have a job done; the future has the error of one that cannot be pickled."""
        try:
            return self._executor.submit(perform_packed, packed(job, pickle.dumps))
        except MobmanError as error:
            refused: Future[Result] = Future()
            refused.set_exception(error)
            return refused

    def loss(self, error: BaseException) -> str | None:
        if isinstance(error, TimeoutError):
            return f"took longer than its time limit of {self._limit:g} s"
        return str(error) if isinstance(error, WorkerLostError) else None

    def renew(self, error: BaseException) -> None:
        raise MobmanError(str(error)) from error  # no process starts any more


class Cluster(Backend):
    """The workers of a Dask scheduler at an address such as ``"tcp://10.0.0.1:8786"``, each of which can
    load what some jobs have in common.

    Raises:
        MobmanError: If Dask is not installed, or nothing answers at the address.
        UsageError: If it is not an address.
    """

    def __init__(self, address: str, jobs: Sequence[Job]) -> None:
        try:
            import distributed
            from distributed.comm.addressing import get_address_host_port
        except ImportError as error:
            raise MobmanError(
                "running on a cluster needs Dask; install it with: pip install 'mobman[dask]'"
            ) from error
        connect: Any = distributed.Client  # its signature has no types
        self._address = address
        self.waits_for = f"the scheduler at {address} has no workers"
        self._levels = {name: logging.getLogger(name).level for name in _LOGGERS}
        try:
            # before there is a client that has to be closed; one in this process has no port
            if not address.startswith("inproc:"):
                get_address_host_port(address)
            for name in _LOGGERS:  # their news are reported here, in one line
                logging.getLogger(name).setLevel(logging.CRITICAL)
            self._client = connect(address, timeout=_ANSWER, set_as_default=False, name="mobman")
        except (OSError, TimeoutError) as error:
            raise MobmanError(
                f"no Dask scheduler answers at {address}; start one with: dask scheduler"
            ) from error
        except (ValueError, TypeError) as error:
            raise UsageError(
                f"{address!r} is not an address of a Dask scheduler ({error}); it is like "
                "tcp://host:8786"
            ) from error
        self._executor: Executor = self._client.get_executor(pure=False)
        self._parts = parts_of(jobs)
        self._known: set[str] = set()

    def slots(self) -> int:
        if self._client.status != "running":
            raise self._lost()
        try:
            threads = dict(self._client.nthreads())
        except Exception as error:  # whatever its connection meets
            raise self._lost() from error
        if new := sorted(set(threads) - self._known):
            self._check(new)
        self._known = set(threads)
        return sum(threads.values())

    def submit(self, job: Job) -> Future[Result]:
        import cloudpickle

        try:
            return self._executor.submit(perform_packed, packed(job, cloudpickle.dumps))
        except OSError as error:
            raise self._lost() from error

    def loss(self, error: BaseException) -> str | None:
        from distributed import KilledWorker

        if not isinstance(error, KilledWorker):
            return None
        count = error.allowed_failures + 1
        many = f"{count} workers" if count > 1 else "the worker"
        return f"{many} that had it died (out of memory, over its time limit, or killed)"

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        with contextlib.suppress(Exception):
            if self._client.status == "running":
                self._executor.shutdown(wait=False)
        with contextlib.suppress(Exception):
            self._client.close(timeout=1)
        for name, level in self._levels.items():
            logging.getLogger(name).setLevel(level)

    def _lost(self) -> MobmanError:
        return MobmanError(f"lost the Dask scheduler at {self._address}")

    def _check(self, workers: list[str]) -> None:
        """Require that workers can do the same runs with the same result; a MobmanError if not."""

        def versions_there() -> dict[
            str, str
        ]:  # sent whole, since there may be another mobman, or none
            try:
                from mobman.provenance import versions

                return versions()
            except ImportError:
                return {}

        here = versions()
        for worker, there in self._ask(workers, versions_there).items():
            if there.get("mobman") != here["mobman"]:
                raise MobmanError(
                    f"the worker {worker} has mobman {there.get('mobman', 'not installed')}, here it is "
                    f"{here['mobman']}; install the same there"
                )
            other = [
                f"{name} {version} ({there[name]} there)"
                for name, version in here.items()
                if there.get(name, version) != version
            ]
            if other:
                warnings.warn(
                    f"the worker {worker} has other versions: {', '.join(other)}; results may differ in "
                    "their last bits",
                    stacklevel=2,
                )
        if self._problems(workers):
            self._send_by_value()
        if problems := self._problems(workers):
            raise MobmanError(problems[0])

    def _problems(self, workers: list[str]) -> list[str]:
        """Reasons for which workers cannot unpack what they are sent."""
        import cloudpickle

        def problems_there(contents: dict[str, bytes]) -> list[str]:
            import pickle

            problems = []
            for name, content in contents.items():
                try:
                    pickle.loads(content)
                except Exception as error:
                    problems.append(
                        f"{name} cannot be loaded on the workers ({type(error).__name__}: {error}); "
                        "install there what defines it"
                    )
            return problems

        contents = {k: packed(part, cloudpickle.dumps, k) for k, part in self._parts.items()}
        found = self._ask(workers, problems_there, contents)
        return [problem for problems in found.values() for problem in problems]

    def _send_by_value(self) -> None:
        """Send modules that are not installed, such as those beside a script, with what they define."""
        import cloudpickle

        for part in self._parts.values():
            module = sys.modules.get(getattr(part, "__module__", ""))
            if module is not None and module.__name__ != "__main__":
                top = sys.modules[module.__name__.partition(".")[0]]
                if top.__name__ != "mobman":
                    cloudpickle.register_pickle_by_value(top)

    def _ask(self, workers: list[str], function: Callable[..., Any], *args: Any) -> dict[str, Any]:
        """Call a function on workers; those that leave meanwhile are left out."""
        answers = self._client.run(function, *args, workers=workers, on_error="return")
        return {k: answer for k, answer in answers.items() if not isinstance(answer, BaseException)}
