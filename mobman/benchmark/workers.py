"""Worker processes of this machine: one that dies, hangs or is stopped costs its own work only.

Each has a pipe of its own: those that share one with its lock, as in the pools of libraries, all wait
when one is killed while it holds the lock.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from typing import Any

from mobman.errors import MobmanError

_TRIES = 3  # to start a process
_START = 300.0  # s, for a process to start; the first on a machine compiles
_BEGIN = 30.0  # s, for a process that has started to begin with its next work
_END = 2.0  # s, from the end of a process's pipe to its exit status
_LEAST_MEMORY = 4 << 30  # bytes of each worker, however many there are: a run takes some 0.5 GB
_SHARE = 4  # the workers together may have a quarter of the machine's memory, if that is more
_THREADS = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "VECLIB_MAXIMUM", "NUMEXPR_NUM")
_NO_START = (
    "a worker process could not start; in a script, what starts a suite must be under: "
    "if __name__ == '__main__'"
)
_LOST = 255  # exit status, as multiprocessing has it, of a process whose fork server was killed
_lock = threading.Lock()
"""Held where a process starts, since the environment is all threads', and where an exit status is read,
which works once."""


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
        super().__init__(count, thread_name_prefix="mobman-worker")
        self._limit = time_limit
        self._memory = max(_memory() // (_SHARE * count), _LEAST_MEMORY)
        self._killed = False
        self._workers: list[_Worker] = []
        try:
            self._idle = [self._start()]
        except (OSError, EOFError, WorkerLostError) as error:
            raise MobmanError(_NO_START) from error
        except BaseException:  # such as Ctrl-C meanwhile
            self.shutdown(wait=False)
            raise

    def submit(self, function: Callable[..., Any], /, *args: Any) -> Future[Any]:  # type: ignore[override]
        """Call a function in a process.

        Returns:
            The future of its result; it has a :class:`WorkerLostError` if the process ended, a
            :class:`TimeoutError` at the time limit, a :class:`BrokenExecutor` if no process starts.
        """
        return super().submit(self._call, pickle.dumps((function, args)))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes: when what was submitted is done or, without waiting, now."""
        with _lock:
            self._killed = not wait
        super().shutdown(wait, cancel_futures=cancel_futures)
        for worker in self._workers:
            worker.end()

    def _call(self, work: bytes) -> Any:
        for _ in range(_TRIES):
            try:
                worker = self._idle.pop() if self._idle else self._start()
                worker.begin(work)
            except (OSError, EOFError, IndexError, WorkerLostError):
                continue  # nothing was begun
            fine, result = worker.receive(self._limit)
            self._idle.append(worker)
            if not fine:
                raise result
            return result
        raise BrokenExecutor(_NO_START)

    def _start(self) -> _Worker:
        with _lock, one_thread_for_children(), _without_interrupts():
            if self._killed:
                raise CancelledError
            worker = _Worker(self._memory)
            self._workers.append(worker)
        worker.receive(_START)
        return worker


class _Worker:
    """A process that does one piece of work at a time, and may take so much memory (bytes)."""

    def __init__(self, memory: int) -> None:
        context: Any = _context()
        self._pipe, other = context.Pipe()
        with other:
            self._process = context.Process(target=_serve, args=(other, memory))
            self._process.start()

    def begin(self, work: bytes) -> None:
        """Give a pickled function with its arguments; what it returns, or raises, is received next."""
        self._pipe.send_bytes(work)
        self.receive(_BEGIN)

    def receive(self, seconds: float) -> Any:
        """Wait for what the process says next; one that says nothing for so long is ended.

        Raises:
            TimeoutError: If it said nothing.
            WorkerLostError: If it ended before.
        """
        ready = wait([self._pipe, self._process.sentinel], seconds)
        if not ready:
            self.end()
            raise TimeoutError
        with contextlib.suppress(EOFError, OSError):
            if self._pipe in ready or self._pipe.poll():  # what it sent last is still read
                return self._pipe.recv()
        with _lock:
            self._process.join(_END)
        raise WorkerLostError(_how(self.end()))

    def end(self) -> int | None:
        """End the process; return the exit status that it had already, if any."""
        with _lock:
            status: int | None = self._process.exitcode
        if status is None or status == _LOST:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process.pid, signal.SIGKILL)
        return status


def _serve(pipe: Connection, memory: int) -> None:
    """Do the work that comes through a pipe, once that is said to be ready; work that begins is said,
    too."""
    _begin(memory)
    pipe.send(None)
    with contextlib.suppress(EOFError, OSError):  # the parent is gone
        while True:
            work = pipe.recv_bytes()
            pipe.send(None)
            reply: tuple[bool, Any]
            try:
                function, args = pickle.loads(work)
                reply = True, function(*args)
            except BaseException as error:
                reply = False, error
            try:
                pipe.send(reply)
            except (pickle.PicklingError, TypeError, AttributeError, MemoryError) as error:
                pipe.send((False, RuntimeError(f"its result cannot be sent: {error}")))


def _how(status: int | None) -> str:
    """Say how a process ended."""
    if status is None or status == _LOST:
        return "its worker process was lost"
    if status >= 0:
        return f"its worker process ended with exit status {status}"
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    hint = " (out of memory?)" if name == "SIGKILL" else ""
    return f"its worker process was ended by {name}{hint}"


def _memory() -> int:
    """The machine's memory (bytes)."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return _LEAST_MEMORY


def _begin(memory: int) -> None:
    """Prepare a worker process, which may take so much memory in addition to what it has (bytes)."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
