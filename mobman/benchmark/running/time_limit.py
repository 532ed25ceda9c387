"""A limit to the wall time of a piece of work, in any thread of any process.

At the limit an exception is raised in the work's thread; Python code meets it wherever it is, and
again later, should it have been lost: what is raised where C calls Python may be printed and forgotten.
Compiled code does not meet it, and may hold the interpreter for ever: some time later the process is
ended by SIGALRM, whose exit status tells why. That is for processes that are there for such work only.
"""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")

_LONGEST = 1e9  # s: timers take no more

ENDED_BY = signal.SIGALRM
"""What ends a process that does not heed a limit."""


class TimeLimitError(BaseException):
    """Raised in the work's thread at the limit; none of ``Exception``, which the work may catch."""


def grace(seconds: float) -> float:
    """How long after a limit the process is ended (s)."""
    return max(1.0, 0.1 * seconds)


def within(seconds: float, function: Callable[..., T], /, *args: Any, fatal: bool) -> T:
    """Call a function, and limit the wall time that it takes.

    Args:
        seconds: The limit (s).
        function: The work; what follows are its arguments.
        fatal: Whether the process ends if the work does not heed the exception; for one piece of work
            at a time in a process.

    Raises:
        TimeLimitError: At the limit, in the thread that does the work.
    """
    seconds = min(seconds, _LONGEST)
    # whoever has a use of their own for the signal keeps it
    fatal = fatal and signal.getsignal(ENDED_BY) == signal.SIG_DFL
    watch = _watch_of_this_process()
    limit = _Limit(threading.get_ident(), time.monotonic() + seconds, 0.25 * grace(seconds))
    try:
        if fatal:
            signal.setitimer(signal.ITIMER_REAL, seconds + grace(seconds))
        watch.add(limit)
        return function(*args)
    finally:
        # No call comes between the work and this loop, and each of its steps may be done twice: the
        # exception can arrive at any of them.
        while True:
            try:
                limit.strikes.acquire()  # for good: from here on it is not raised any more
                watch.remove(limit)
                if fatal:
                    signal.setitimer(signal.ITIMER_REAL, 0.0)
                if limit.struck:
                    _catch(limit.thread)
                break
            except TimeLimitError:
                continue


def was_struck() -> bool:
    """Whether a limit has struck in this process.

    What it broke off may have been an import, or held a lock: such a process is better not used again.
    """
    return bool(_watches) and _watches[-1].process == os.getpid() and _watches[-1].struck


@dataclass(eq=False)
class _Limit:
    thread: int
    due: float
    """When it strikes next."""
    every: float
    """After how long it strikes again (s)."""
    struck: bool = False
    strikes: Any = field(default_factory=threading.RLock)
    """Held by who strikes, and by the thread once it is over."""


class _Watch:
    """A thread that strikes when it is time; one for a process, since starting one takes a while.

    Who is struck may be anywhere, so nothing here makes it hold a lock that others wait for.
    """

    def __init__(self) -> None:
        self.process = os.getpid()
        self.struck = False
        self._limits: set[_Limit] = set()
        self._sooner: SimpleQueue[None] = SimpleQueue()
        self._wakes = float("inf")
        threading.Thread(target=self._run, name="time limits", daemon=True).start()

    def add(self, limit: _Limit) -> None:
        self._limits.add(limit)
        if limit.due < self._wakes:
            self._sooner.put(None)

    def remove(self, limit: _Limit) -> None:
        self._limits.discard(limit)

    def _run(self) -> None:
        while True:
            # before it looks at the limits: one that is added now is seen now, or wakes it again
            self._wakes = float("inf")
            now = time.monotonic()
            for limit in list(self._limits):
                if limit.due <= now:
                    self._strike(limit)
            # one that is over by then wakes it in vain, and costs less than waking it at once
            self._wakes = min((limit.due for limit in list(self._limits)), default=float("inf"))
            left = self._wakes - time.monotonic()
            try:
                self._sooner.get(timeout=None if left == float("inf") else max(0.0, left))
            except Empty:
                continue

    def _strike(self, limit: _Limit) -> None:
        if not limit.strikes.acquire(blocking=False):
            self._limits.discard(limit)  # it is over, and was interrupted while it cleared up
            return
        try:
            limit.struck = self.struck = True
            limit.due = time.monotonic() + limit.every
            _raise_in(limit.thread)
        finally:
            limit.strikes.release()


_watches: list[_Watch] = []
_starting = threading.Lock()


def _watch_of_this_process() -> _Watch:
    with _starting:
        if not _watches or _watches[-1].process != os.getpid():  # threads do not survive a fork
            _watches[:] = [_Watch()]
        return _watches[-1]


def _raise_in(thread: int) -> None:
    ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread), ctypes.py_object(TimeLimitError)
    )


def _catch(thread: int) -> None:
    """See to it that an exception which may still be on its way does not hit what follows.

    Taking it back is no way: the interpreter would then look out for it for ever, at every call.
    """
    try:
        _raise_in(thread)  # at most one is on its way
        while True:
            time.sleep(1e-3)
    except TimeLimitError:
        pass
