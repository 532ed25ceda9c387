"""A limit to the wall time of a piece of work, in any thread of any process.

At the limit an exception is raised in the work's thread; Python code meets it wherever it is. Compiled
code does not, and may hold the interpreter for ever: some time later the process is ended by SIGALRM,
whose exit status tells why. That is for processes that are there for such work only.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

ENDED_BY = signal.SIGALRM
"""What ends a process that does not heed a limit."""


class TimeLimitError(BaseException):
    """Raised in the work's thread at the limit; none of ``Exception``, which the work may catch."""


def grace(seconds: float) -> float:
    """How long after a limit the process is ended (s)."""
    return max(1.0, 0.1 * seconds)


@contextlib.contextmanager
def time_limit(seconds: float, *, fatal: bool) -> Iterator[None]:
    """Limit the wall time of a block.

    Args:
        seconds: The limit (s).
        fatal: Whether the process ends if the block does not heed the exception.

    Raises:
        TimeLimitError: At the limit, in the thread that runs the block.
    """
    now = time.monotonic()
    # whoever has a use of their own for the signal keeps it
    fatal = fatal and signal.getsignal(ENDED_BY) == signal.SIG_DFL
    end = now + seconds + grace(seconds) if fatal else None
    limit = _Limit(threading.get_ident(), now + seconds, end)
    watch = _watch_of_this_process()
    watch.add(limit)
    try:
        yield
    finally:
        try:
            watch.remove(limit)
        except TimeLimitError:  # it came just now, and comes once
            watch.remove(limit)
        if limit.struck:
            _catch(limit.thread)


@dataclass(eq=False)
class _Limit:
    thread: int
    deadline: float
    end: float | None
    """When the process ends."""
    struck: bool = False

    def strike(self) -> None:
        self.struck = True
        _raise_in(self.thread)


class _Watch:
    """A thread that strikes at deadlines; one for a process, since starting one takes a while."""

    def __init__(self) -> None:
        self.process = os.getpid()
        self._limits: set[_Limit] = set()
        self._changed = threading.Condition()
        self._wakes = float("inf")
        threading.Thread(target=self._run, name="time limits", daemon=True).start()

    def add(self, limit: _Limit) -> None:
        with self._changed:
            self._limits.add(limit)
            self._arm()
            if limit.deadline < self._wakes:
                self._changed.notify()

    def remove(self, limit: _Limit) -> None:
        with self._changed:
            self._limits.discard(limit)
            self._arm()

    def _arm(self) -> None:
        """Set the process's one timer to the first end."""
        ends = [limit.end for limit in self._limits if limit.end is not None]
        left = max(min(ends) - time.monotonic(), 1e-3) if ends else 0.0
        signal.setitimer(signal.ITIMER_REAL, left)

    def _run(self) -> None:
        with self._changed:
            while True:
                now = time.monotonic()
                due = [each for each in self._limits if not each.struck]
                for limit in due:
                    if limit.deadline <= now:
                        limit.strike()
                # one that is over by then wakes it in vain, and costs less than waking it at once
                self._wakes = min((e.deadline for e in due if not e.struck), default=float("inf"))
                forever = self._wakes == float("inf")
                self._changed.wait(None if forever else max(0.0, self._wakes - now))


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
