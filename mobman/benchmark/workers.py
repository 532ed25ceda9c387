"""Worker processes of this machine: one that dies, hangs or is stopped costs its own work only.

Each thread of a pool has a process of its own (a pebble pool of one worker): workers that share a pipe
and its lock, as those of one larger pool do, all wait when one is killed while it holds the lock.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import BaseContext
from typing import Any

from pebble import ProcessExpired, ProcessPool

from mobman.errors import MobmanError

_TRIES = 3  # to start a process
_START = 300.0  # s, for a process to start; the first on a machine compiles
_BEGIN = 30.0  # s, for a process that has started to begin with its next work
_LOOK = 0.25  # s, from one look at a process to the next
_LEAST_MEMORY = 4 << 30  # bytes of each worker, however many there are: a run takes some 0.5 GB
_SHARE = 4  # the workers together may have a quarter of the machine's memory, if that is more
_THREADS = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "VECLIB_MAXIMUM", "NUMEXPR_NUM")
_NO_START = (
    "a worker process could not start; in a script, what starts a suite must be under: "
    "if __name__ == '__main__'"
)


class WorkerLostError(Exception):
    """A worker process ended before it answered; the message says how."""


class Workers(ThreadPoolExecutor):
    """An executor of processes, each started when it is needed and again after it ended.

    Args:
        count: Number of processes.
        time_limit: Wall time that a piece of work may take (s); then its process is ended.

    Raises:
        MobmanError: If no process can start.
    """

    def __init__(self, count: int, time_limit: float) -> None:
        _require_start()
        super().__init__(count, thread_name_prefix="mobman-worker")
        self._limit = time_limit
        self._memory = max(_memory() // (_SHARE * count), _LEAST_MEMORY)
        self._thread = threading.local()
        self._pools: set[ProcessPool] = set()
        self._pools_lock = threading.Lock()
        self._killed = False

    def submit(self, function: Callable[..., Any], /, *args: Any) -> Future[Any]:  # type: ignore[override]
        """Call a function in a process.

        Returns:
            The future of its result; it has a :class:`WorkerLostError` if the process ended, a
            :class:`TimeoutError` at the time limit, a :class:`BrokenExecutor` if no process starts.
        """
        return super().submit(self._call, function, args)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes: when what was submitted is done or, without waiting, now."""
        self._killed = not wait
        super().shutdown(wait, cancel_futures=cancel_futures)
        for pool in list(self._pools):
            self._end(pool)

    def _call(self, function: Callable[..., Any], args: tuple[Any, ...]) -> Any:
        for _ in range(_TRIES):
            try:
                pool: ProcessPool | None = getattr(self._thread, "pool", None)
                if pool is None or not pool.active:
                    pool = self._start()
                future = pool.schedule(function, args, timeout=self._limit)
                return self._wait(future)
            except (BrokenExecutor, RuntimeError) as error:  # it had not begun
                self._end_own()
                if self._killed or not isinstance(error, BrokenExecutor | _NotBegunError):
                    raise
            except (ProcessExpired, WorkerLostError, TimeoutError) as error:
                self._end_own()
                if isinstance(error, ProcessExpired):
                    raise WorkerLostError(_how(error.exitcode)) from error
                raise
        raise BrokenExecutor(_NO_START)

    def _start(self) -> ProcessPool:
        pool = ProcessPool(1, initializer=_begin, initargs=(self._memory,), context=_context())
        with self._pools_lock:
            if self._killed:
                raise CancelledError
            self._pools.add(pool)
        self._thread.pool = pool
        with one_thread_for_children(), _without_interrupts():
            self._thread.pid = pool.schedule(os.getpid).result(timeout=_START)
        return pool

    def _wait(self, future: Future[Any]) -> Any:
        """The result, unless the process is gone, or was stopped before it began."""
        started = time.monotonic()
        while True:
            with contextlib.suppress(TimeoutError):
                return future.result(timeout=_LOOK)
            if future.done():
                return future.result()
            if not future.running() and time.monotonic() - started > _BEGIN:
                raise _NotBegunError
            if not _exists(self._thread.pid):
                with contextlib.suppress(TimeoutError):  # what it sent last is still read
                    return future.result(timeout=4 * _LOOK)
                raise WorkerLostError(_how(0))

    def _end_own(self) -> None:
        """End this thread's process."""
        pool, self._thread.pool = getattr(self._thread, "pool", None), None
        if pool is not None:
            self._end(pool)

    def _end(self, pool: ProcessPool) -> None:
        with self._pools_lock:
            self._pools.discard(pool)
        pool.stop()  # type: ignore[no-untyped-call]  # pebble does not annotate it
        # joining waits for a process that is stopped to be killed, some seconds
        threading.Thread(target=_join, args=(pool,), daemon=True).start()


def _require_start() -> None:
    """Start and end a process: a pool would start others for ever where each of them fails, since it
    runs the script that started this one."""
    context: Any = _context()
    with one_thread_for_children(), _without_interrupts():
        probe = context.Process(target=os.getpid)
        probe.start()
    probe.join(_START)
    if probe.exitcode:  # None of one that takes long, as where all is compiled first
        raise MobmanError(_NO_START)


class _NotBegunError(RuntimeError):
    """A process did not take its work: it was stopped."""


def _join(pool: ProcessPool) -> None:
    with contextlib.suppress(Exception):
        pool.join()


def _how(status: int) -> str:
    if status == 255:  # also what multiprocessing says where the fork server was killed
        return "its worker process was lost"
    if status >= 0:
        return f"its worker process ended with exit status {status}"
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    hint = " (out of memory?)" if name == "SIGKILL" else ""
    return f"its worker process was ended by {name}{hint}"


def _exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError as error:
        return not isinstance(error, ProcessLookupError)
    return True


def _memory() -> int:
    """The machine's memory (bytes)."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return _LEAST_MEMORY


def _begin(memory: int) -> None:
    """Prepare a worker process, which may take so much memory in addition to what it has (bytes)."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    preload()
    with contextlib.suppress(ImportError, ValueError, OSError):  # not every system has this limit
        import resource

        from mobman.isolation import memory_in_use

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        soft = memory_in_use() + memory
        if hard != resource.RLIM_INFINITY:
            soft = min(soft, hard)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _end_with_parent() -> None:
    """End this process with its parent; else it would go on with what nobody waits for."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


_loaded: set[str] = set()  # laws, in this process or the one that it was forked from


def preload(law: str | None = None) -> None:
    """Load all that runs need, once a process, by a tick of all laws of mobman's own, or of the only one
    that runs need (of any if that is not mobman's own); what is not compiled yet is compiled."""
    from mobman.controllers.protocol import controllers
    from mobman.simulation.simulate import simulate

    own = list(controllers.own())  # another may hang, or end the process: that is its runs' matter
    for name in own if law is None else [law if law in own else own[0]]:
        if name not in _loaded:
            _loaded.add(name)
            with contextlib.suppress(Exception):  # a run that needs it will say so
                simulate("youbot", name, "circle", duration=1e-3).to_bytes()


def start_ahead() -> None:
    """Let the process that workers are forked from start and load what they need, without waiting."""
    if _context().get_start_method() == "forkserver":
        resource_tracker.ensure_running()  # before SIGINT is blocked: it unblocks it again
        with one_thread_for_children(), _without_interrupts():
            forkserver.ensure_running()


@contextlib.contextmanager
def one_thread_for_children() -> Iterator[None]:
    """One BLAS thread in processes that start meanwhile: matrices are small, and workers use all
    cores already."""
    names = [f"{name}_THREADS" for name in _THREADS]
    before = {name: os.environ.pop(name) for name in names if name in os.environ}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name in names:
            os.environ.pop(name, None)
        os.environ.update(before)


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Ctrl-C goes to the whole process group; processes that start meanwhile leave it to this one."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _context() -> BaseContext:
    """Start method of processes: clean, with one thread, whatever this process has loaded."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["mobman.benchmark.preloaded"])
    return context
