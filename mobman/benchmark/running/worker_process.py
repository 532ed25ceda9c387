"""A process that does what it is told through its own pipe."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any

from mobman.benchmark.running.time_limit import was_struck

# multiprocessing reads the exit status of a forked server's child once: whoever comes second gets
# none. Starting a process looks after the ended ones, so that counts as well.
_processes = threading.Lock()


class WorkerLostError(Exception):
    """A worker ended before it answered.

    Attributes:
        exit_code: Its exit status; negative for a signal, None if it is not known.
        began: Whether it had come to the work.
    """

    def __init__(self, exit_code: int | None, *, began: bool) -> None:
        super().__init__(exit_code, began)
        self.exit_code = exit_code
        self.began = began

    def __str__(self) -> str:
        return f"its worker process {self.how}"

    @property
    def how(self) -> str:
        """How it ended."""
        if self.exit_code is None:
            return "was lost"
        if self.exit_code >= 0:
            return f"ended with exit status {self.exit_code}"
        try:
            name = signal.Signals(-self.exit_code).name
        except ValueError:
            name = f"signal {-self.exit_code}"
        hint = " (out of memory?)" if name == "SIGKILL" else ""
        return f"was ended by {name}{hint}"


class WorkerProcess:
    """A process, and the only end of a pipe to it: when it dies, nothing else is affected.

    Args:
        context: How processes are started.
    """

    def __init__(self, context: BaseContext) -> None:
        self._pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(  # type: ignore[attr-defined]
            target=_serve, args=(theirs,), name="mobman-worker", daemon=True
        )
        with _processes:
            self._process.start()
        theirs.close()
        self._ready = False
        self._spent = False

    @property
    def usable(self) -> bool:
        """Whether it can be asked: it has not died while it had nothing to do, and is not spent."""
        return not self._spent and not wait([self._process.sentinel], timeout=0)

    def ask(self, function: Callable[..., Any], args: tuple[Any, ...]) -> Any:
        """Have a function called there.

        Returns:
            What it returned; what it raised is raised here.

        Raises:
            WorkerLostError: If the process ended before.
        """
        try:
            if not self._ready:
                self._receive()
                self._ready = True
            self._pipe.send((function, args))
            fine, answer, self._spent = self._receive()
        except (EOFError, OSError) as error:
            raise WorkerLostError(self._exit_code(), began=self._ready) from error
        if not fine:
            raise answer
        return answer

    def _receive(self) -> Any:
        # Not the pipe alone: a process that the worker left behind may hold its other end.
        if self._pipe not in wait([self._pipe, self._process.sentinel]) and not self._pipe.poll():
            raise EOFError
        return self._pipe.recv()

    def _exit_code(self) -> int | None:
        wait([self._process.sentinel], timeout=5.0)
        with _processes:
            self._process.join(timeout=0)
            return self._process.exitcode

    def kill(self) -> None:
        """End it now: it has nothing to lose."""
        with _processes, contextlib.suppress(OSError, ValueError):
            self._process.kill()

    def close(self) -> None:
        """Let it end, and wait until it has."""
        self._pipe.close()
        if not wait([self._process.sentinel], timeout=2.0):
            self.kill()
            wait([self._process.sentinel], timeout=2.0)
        with _processes:
            self._process.join(timeout=0)


def _serve(pipe: Connection[Any, Any]) -> None:
    # Ctrl-C goes to the whole process group; only the parent acts on it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    pipe.send(None)  # ready
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            # what a time limit has broken off may have left anything behind
            pipe.send((*_answer(pipe.recv_bytes()), was_struck()))


def _answer(question: bytes) -> tuple[bool, Any]:
    """Whether it went well, and what came of it."""
    try:
        function, args = pickle.loads(question)
        return True, function(*args)
    except BaseException as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            return False, RuntimeError(f"{type(error).__name__}: {error}")
        return False, error


def _end_with_parent() -> None:
    """A worker whose parent was killed would go on with what nobody waits for."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
