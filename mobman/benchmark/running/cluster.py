"""Runs on a cluster, by Dask distributed."""

from __future__ import annotations

import contextlib
import logging
import sys
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from types import TracebackType
from typing import Any, Self

from mobman.benchmark.running.job import Job, Result
from mobman.benchmark.running.parcel import Parcel
from mobman.benchmark.running.perform import perform
from mobman.benchmark.running.place import Place
from mobman.errors import MobmanError, UsageError
from mobman.provenance import versions

_ANSWER = 5.0  # s, for a scheduler to answer in
_LOGGERS = ("distributed", "distributed.client", "distributed.core", "distributed.utils")


class Cluster(Place):
    """The workers of a Dask scheduler.

    Args:
        address: The scheduler's, such as ``"tcp://10.0.0.1:8786"``.

    Raises:
        MobmanError: If Dask is not installed, or nothing answers at the address.
        UsageError: If it is no address.
    """

    blames_exactly = False  # a worker's next runs are with it already when it dies

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError as error:
            raise MobmanError(
                "running on a cluster needs Dask; install it with: pip install 'mobman[dask]'"
            ) from error
        _check_address(address)  # before there is a client that has to be closed
        connect: Any = distributed.Client  # its signature has no types
        self._address = address
        self._levels = {name: logging.getLogger(name).level for name in _LOGGERS}
        for name in _LOGGERS:  # what they would tell is told here, in one line
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            self._client = connect(address, timeout=_ANSWER, set_as_default=False, name="mobman")
        except (OSError, TimeoutError) as error:
            raise MobmanError(
                f"no Dask scheduler answers at {address}; start one with: dask scheduler"
            ) from error
        except (ValueError, TypeError) as error:
            raise _no_address(address, error) from error
        self._executor: Executor = self._client.get_executor(pure=False)
        self._parcels: Sequence[Parcel] = ()
        self._known: set[str] = set()

    def slots(self) -> int:
        threads = self._threads()
        if new := sorted(set(threads) - self._known):
            self._check(new)
        self._known = set(threads)
        return sum(threads.values())

    def submit(self, job: Job) -> Future[Result]:
        try:
            return self._executor.submit(perform, job)
        except OSError as error:
            raise self._lost() from error

    def loss(self, error: BaseException) -> str | None:
        from distributed import KilledWorker

        if not isinstance(error, KilledWorker):
            return None
        count = error.allowed_failures + 1
        many = f"{count} workers" if count > 1 else "the worker"
        return f"{many} that had it died (out of memory, over its time limit, or killed)"

    def dumps(self) -> Callable[[Any], bytes]:
        import cloudpickle

        by: Callable[[Any], bytes] = cloudpickle.dumps
        return by

    def prepare(self, parcels: Sequence[Parcel]) -> None:
        self._parcels = parcels

    @property
    def waits_for(self) -> str:
        return f"the scheduler at {self._address} has no workers"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with contextlib.suppress(Exception):
            if self._client.status == "running":
                self._executor.shutdown(wait=False)
        with contextlib.suppress(Exception):
            self._client.close(timeout=1)
        for name, level in self._levels.items():
            logging.getLogger(name).setLevel(level)

    def _threads(self) -> dict[str, int]:
        """Of each worker."""
        if self._client.status != "running":
            raise self._lost()
        try:
            return dict(self._client.nthreads())
        except Exception as error:  # whatever its connection meets
            raise self._lost() from error

    def _lost(self) -> MobmanError:
        return MobmanError(f"lost the Dask scheduler at {self._address}")

    def _check(self, workers: list[str]) -> None:
        """Whether these workers can do the same runs with the same result.

        Raises:
            MobmanError: If they cannot.
        """
        here = versions()
        for worker, there in self._ask(workers, _versions_there).items():
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
        """What the workers lack."""
        packed = [(parcel.name, parcel.pack()) for parcel in self._parcels]
        found = self._ask(workers, _problems_there, packed)
        return [problem for problems in found.values() for problem in problems]

    def _send_by_value(self) -> None:
        """Send modules that are not installed, such as those beside a script, with what they define."""
        import cloudpickle

        for parcel in self._parcels:
            module = sys.modules.get(getattr(parcel.open(), "__module__", ""))
            if module is not None and module.__name__ != "__main__":
                top = sys.modules[module.__name__.partition(".")[0]]
                if top.__name__ != "mobman":
                    cloudpickle.register_pickle_by_value(top)
            parcel.pack_anew()

    def _ask(self, workers: list[str], function: Callable[..., Any], *args: Any) -> dict[str, Any]:
        """Call a function on workers; those that leave meanwhile are left out."""
        answers = self._client.run(function, *args, workers=workers, on_error="return")
        return {
            worker: answer
            for worker, answer in answers.items()
            if not isinstance(answer, BaseException)
        }


def _check_address(address: str) -> None:
    from distributed.comm.addressing import get_address_host_port

    if address.startswith("inproc:"):  # of a cluster in this process, which has no port
        return
    try:
        get_address_host_port(address)
    except (ValueError, TypeError) as error:
        raise _no_address(address, error) from error


def _no_address(address: str, error: Exception) -> UsageError:
    return UsageError(
        f"{address!r} is no address of a Dask scheduler ({error}); it is like tcp://host:8786"
    )


def _by_value() -> tuple[
    Callable[[], dict[str, str]], Callable[[list[tuple[str, bytes]]], list[str]]
]:
    """Functions for workers that may have no mobman, or another one: local ones are sent whole."""

    def versions_there() -> dict[str, str]:
        """Of the libraries on a worker; none if it has no mobman."""
        try:
            from mobman.provenance import versions

            return versions()
        except ImportError:
            return {}

    def problems_there(packed: list[tuple[str, bytes]]) -> list[str]:
        """What of these things, by name, a worker cannot unpack, and why."""
        import pickle

        problems = []
        for name, content in packed:
            try:
                pickle.loads(content)
            except Exception as error:
                problems.append(
                    f"{name} cannot be had on the workers ({type(error).__name__}: {error}); install "
                    "there what defines it"
                )
        return problems

    return versions_there, problems_there


_versions_there, _problems_there = _by_value()
