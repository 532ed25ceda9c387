"""An executor of processes in which one that dies costs its own work only.

:class:`concurrent.futures.ProcessPoolExecutor` breaks as a whole when a process dies, and a queue that
processes share is left locked, or with half a message, by one that is killed at the wrong moment. Here
each has a pipe and a thread of its own.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import BaseContext
from queue import SimpleQueue
from typing import Any

from mobman.benchmark.running.one_thread import one_thread_for_children
from mobman.benchmark.running.worker_process import WorkerLostError, WorkerProcess
from mobman.kernels.ahead import compile_ahead, compiled_ahead

_PRELOAD = ("mobman.benchmark.running.quiet_server", "mobman.benchmark.running.preloaded")
_TRIES = 3  # to start a process


def start_ahead() -> None:
    """Let the process that workers are forked from start and load what they need, and do not wait.

    It takes a second or two, in which the caller may load what it needs itself. Where kernels are still
    to be compiled, nothing is done: one process is to do it.
    """
    if compiled_ahead() and _context().get_start_method() == "forkserver":
        resource_tracker.ensure_running()  # before SIGINT is blocked: it unblocks it again
        # Ctrl-C is this process's matter until the other one knows what to do about it
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with one_thread_for_children():
                forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class WorkerProcesses(Executor):
    """Processes, started when they are needed and again when they die.

    The future of work whose process died has a :class:`WorkerLostError`.

    Args:
        count: How many.
    """

    def __init__(self, count: int) -> None:
        if not compiled_ahead():
            compile_ahead()  # here and once, instead of in every process
        self._context = _context()
        # Before a thread blocks SIGINT: starting it, Python's own helper unblocks the signal again.
        resource_tracker.ensure_running()
        self._count = count
        self._waiting: SimpleQueue[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]] | None]
        self._waiting = SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._workers: set[WorkerProcess] = set()
        self._lock = threading.Lock()
        self._stopped = False

    def submit(  # type: ignore[override]
        self, function: Callable[..., Any], /, *args: Any
    ) -> Future[Any]:
        """Have a function called in a process."""
        if self._stopped:
            raise RuntimeError("the processes were shut down")
        future: Future[Any] = Future()
        self._waiting.put((future, function, args))
        if len(self._threads) < self._count:
            self._threads.append(threading.Thread(target=self._attend, daemon=True))
            self._threads[-1].start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more work; end the processes once what was submitted is done."""
        self._stopped = True
        if cancel_futures:
            self._cancel()
        for _ in self._threads:
            self._waiting.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def kill(self) -> None:
        """End the processes now, whatever they do."""
        with self._lock:
            self._stopped = True
            for worker in self._workers:
                worker.kill()
        self._cancel()
        for _ in self._threads:
            self._waiting.put(None)
        for thread in self._threads:
            thread.join(timeout=2.0)

    def _cancel(self) -> None:
        while not self._waiting.empty():
            with contextlib.suppress(Exception):
                if (item := self._waiting.get_nowait()) is not None:
                    item[0].cancel()

    def _attend(self) -> None:
        """Keep one process at work."""
        # Processes inherit it: Ctrl-C is the parent's matter from their very start on.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        seat = _Seat()
        while (item := self._waiting.get()) is not None:
            future, function, args = item
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(self._ask(seat, function, args))
                except BaseException as error:
                    future.set_exception(error)
            del item, future, function, args  # not to be held while waiting for the next
        self._end(seat)

    def _ask(self, seat: _Seat, function: Callable[..., Any], args: tuple[Any, ...]) -> Any:
        if seat.worker is not None and not seat.worker.usable:
            self._end(seat)
        for left in reversed(range(_TRIES)):
            if seat.worker is None:
                seat.worker = self._start()
            try:
                return seat.worker.ask(function, args)
            except WorkerLostError as error:
                self._end(seat)
                if error.began or self._stopped:
                    raise
                if not left:
                    raise BrokenExecutor(
                        f"a worker process could not start: it {error.how}; in a script, what starts "
                        "a suite must be under: if __name__ == '__main__'"
                    ) from error
        raise AssertionError  # the last try has left the loop

    def _start(self) -> WorkerProcess:
        worker = WorkerProcess(self._context)
        with self._lock:
            self._workers.add(worker)
            if self._stopped:
                worker.kill()
        return worker

    def _end(self, seat: _Seat) -> None:
        if seat.worker is None:
            return
        seat.worker.close()
        with self._lock:
            self._workers.discard(seat.worker)
        seat.worker = None


class _Seat:
    """A thread's process, if it has one at the moment."""

    worker: WorkerProcess | None = None


def _context() -> BaseContext:
    """How processes start: clean, with one thread, whatever this process has loaded."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*_PRELOAD])
    return context
