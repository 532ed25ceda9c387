"""Reading files of unknown origin in a process of its own, with limits on time and memory.

The readers of HDF5 and of meshes are C and C++ libraries that a damaged file can crash, or keep busy
without end. They run in one helper process, which lives as long as this process and is started again
after a crash. A process pool of the standard library cannot serve: it imports the user's script again
(so that a script without a main guard would run twice), and cannot stop a C function.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mobman.errors import MobmanError

_START = "import sys; sys.path[:] = {path!r}; from mobman.isolation import serve; serve()"
_SIZE = 8  # bytes of a length in a message
_CALM = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
"""Environment of the helper: no thread pools, whose memory counts, and no plug-ins of HDF5."""


class Crash(MobmanError):
    """The helper process ended while it read a file; the message says how."""


class Helper:
    """A process that runs functions of mobman on files, one at a time; threads may share it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def call(self, function: str, *arguments: Any, seconds: float, megabytes: float) -> Any:
        """Run a function of mobman's own, ``"module:name"`` (never a name from a file), in the helper,
        with arguments that JSON holds; its result is numbers, text, bytes, arrays, and lists and
        dictionaries of these. It may take so much processor time (s), and memory in addition to what the
        helper has (MB).

        MobmanError as the function raises it; Crash at other exceptions, if the helper ended, or took
        more.
        """
        with self._lock:
            try:
                process = self._started()
                _send(process.stdin, [function, list(arguments), seconds, megabytes])
                answer = _receive(process.stdout)
            except (EOFError, BrokenPipeError):
                raise Crash(self._reason(seconds)) from None
            except OSError as error:
                raise Crash(f"its reader cannot be started: {error.strerror or error}") from error
            except BaseException:  # interrupted halfway: the rest of the answer must not be read
                self.close()
                raise
        if "error" not in answer:
            return answer["result"]
        module, name = answer["error"]
        # the helper reads hostile files: what it answers is not taken for the name of just anything
        own = module.startswith("mobman.")
        kind = getattr(importlib.import_module(module), name) if own else None
        if not (isinstance(kind, type) and issubclass(kind, MobmanError)):
            raise Crash(f"its reader answers with {module}.{name}")
        raise kind(answer["message"])

    def close(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def forget(self) -> None:
        """Leave the process to the one that this one was forked from."""
        process, self._process, self._lock = self._process, None, threading.Lock()
        if process is not None:
            process.returncode = 0  # or its destructor warns
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            self.close()
            path = [place for place in sys.path if place]
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START.format(path=path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **_CALM},
                start_new_session=True,  # Ctrl-C is for this process
            )
        return self._process

    def _reason(self, seconds: float) -> str:
        process, self._process = self._process, None
        assert process is not None
        process.communicate()
        status = process.returncode
        if status == -getattr(signal, "SIGPROF", 0):
            return f"it takes more than {seconds:.3g} s of processor time"
        if status < 0:
            return f"its reader was ended by signal {-status} ({signal.strsignal(-status)})"
        return f"its reader ended with status {status}"


helper = Helper()
atexit.register(helper.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=helper.forget)


def serve() -> None:
    """Answer requests until the pipe that they come from is closed: the helper's main function."""
    source, target = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1):  # libraries print to them
        os.dup2(nowhere, number)
    with contextlib.suppress(EOFError):
        while True:
            _send(target, _answer(*_receive(source)))


def _answer(function: str, arguments: list[Any], seconds: float, megabytes: float) -> Any:
    module, _, name = function.partition(":")
    kind: type[MobmanError] = Crash
    try:
        found: Callable[..., Any] = getattr(importlib.import_module(module), name)
        with _limited(seconds, megabytes):
            return {"result": found(*arguments)}
    except MobmanError as error:
        kind, text = type(error), str(error)
    except MemoryError:
        text = f"it takes more than {megabytes:.0f} MB of memory"
    except Exception as error:
        text = " ".join(f"{type(error).__name__}: {error}".split())
    return {"error": [kind.__module__, kind.__name__], "message": text}


@contextlib.contextmanager
def _limited(seconds: float, megabytes: float) -> Any:
    """Limits on what the block takes; time that is exceeded ends the process, also within C."""
    try:
        import resource
    except ImportError:  # a system without such limits
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    most = memory_in_use() + int(megabytes * 1e6)
    if before[1] != resource.RLIM_INFINITY:
        most = min(most, before[1])
    signal.setitimer(signal.ITIMER_PROF, seconds)
    with contextlib.suppress(ValueError, OSError):  # not every system has this limit
        resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def memory_in_use() -> int:
    """Address space of this process (bytes); a generous guess where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 1 << 32


def _send(stream: Any, value: Any) -> None:
    """A value as JSON, followed by its arrays and bytes as they are."""
    parts: list[Any] = []

    def plain(item: Any) -> Any:
        if isinstance(item, bytes):
            parts.append(item)
            return {"bytes": len(item)}
        if isinstance(item, np.ndarray):
            parts.append(np.ascontiguousarray(item).data.cast("B") if item.size else b"")
            return {"array": item.dtype.str, "shape": item.shape}
        if isinstance(item, dict):
            return {"dict": {key: plain(part) for key, part in item.items()}}
        if isinstance(item, (list, tuple)):
            return [plain(part) for part in item]
        return item

    head = json.dumps(plain(value)).encode("ascii")
    stream.write(len(head).to_bytes(_SIZE, "little") + head)
    for part in parts:
        stream.write(part)
    stream.flush()


def _receive(stream: Any) -> Any:
    """The value that :func:`_send` was given; EOFError if the stream ends before."""

    def value(item: Any) -> Any:
        if isinstance(item, list):
            return [value(part) for part in item]
        if not isinstance(item, dict):
            return item
        if "dict" in item:
            return {key: value(part) for key, part in item["dict"].items()}
        if "bytes" in item:
            return bytes(_read(stream, item["bytes"]))
        kind = np.dtype(item["array"])
        content = _read(stream, kind.itemsize * math.prod(item["shape"]))
        return np.frombuffer(content, dtype=kind).reshape(item["shape"])

    size = int.from_bytes(_read(stream, _SIZE), "little")
    return value(json.loads(_read(stream, size)))


def _read(stream: Any, size: int) -> bytearray:
    content = bytearray(size)  # which makes arrays that can be written
    if stream.readinto(content) < size:
        raise EOFError
    return content
