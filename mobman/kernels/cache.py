"""Machine code kept on disk between processes.

numba's own cache looks at a function's own file only, not at those of the kernels that it calls, so a
changed kernel could live on inside its callers. Here the machine code of a version of the kernels has
a folder of its own, named after the contents of all files that hold one. Since machine code is unpickled
and run, a folder that another user could write to is not used.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache

_DECORATED = re.compile(rb"^@kernel\r?$", re.MULTILINE)
_HELPER = "MOBMAN_COMPILING_AHEAD"  # set in processes that help another one
_UNUSED = 30 * 24 * 3600.0  # s: folders of other versions go after this time


class _Locator:
    """Tells numba's cache where to look and what a function's machine code depends on."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _Locator:
        return cls(function)

    def get_cache_path(self) -> str:
        return str(kernel_folder())

    def ensure_cache_path(self) -> None:
        _make(kernel_folder())
        tempfile.TemporaryFile(dir=kernel_folder()).close()

    def get_source_stamp(self) -> str:
        return _contents(Path(self._function.__code__.co_filename))

    def get_disambiguator(self) -> str:
        return hashlib.sha256(self._function.__module__.encode()).hexdigest()[:10]


class KernelCache(FunctionCache):  # type: ignore[misc]  # numba ships no types
    """The machine code of one function, on disk.

    A file that cannot be read counts as missing, and a folder that cannot be written costs a warning.
    """

    class _impl_class(FunctionCache._impl_class):  # type: ignore[misc]
        _locator_classes = [_Locator]

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The machine code for a signature, None if there is none to be read."""
        try:
            found = None if unsafe() else super().load_overload(signature, target_context)
        except Exception:  # whatever unpickling half a file may raise
            found = None
            with contextlib.suppress(OSError):
                self.flush()  # an index that cannot be read cannot be added to, either
        if found is None:
            _announce()
            help_compiling()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep the machine code for a signature, if the folder lets it."""
        if reason := unsafe():
            _warn_not_kept(reason)
            return
        try:
            super().save_overload(signature, data)
        except OSError as error:
            _warn_not_kept(str(error))


@cache
def kernel_folder() -> Path:
    """The folder of this version of the kernels, in the user's cache or in NUMBA_CACHE_DIR."""
    base = _base()
    digest = hashlib.sha256()
    for file in [*kernel_files(), Path(__file__).with_name("kernel.py")]:  # which has the options
        digest.update(file.read_bytes())
    folder = base / digest.hexdigest()[:16]
    if not folder.exists():
        _forget_others(base)
    return folder


def _make(folder: Path) -> None:
    """Make a folder and those above it that are missing, for this user alone."""
    for path in reversed([path for path in (folder, *folder.parents) if not path.exists()]):
        path.mkdir(mode=0o700, exist_ok=True)


@cache
def unsafe() -> str:
    """Why another user might have written what is in the folder, and what to do; empty if none could."""
    if os.name != "posix":
        return ""
    with contextlib.suppress(OSError):  # then it cannot be written at all, which is told later
        _make(kernel_folder())
    folder = kernel_folder().absolute()
    real = folder.resolve()
    above = {*folder.parents, *real.parents}
    try:
        inside, closed = [*real.iterdir()], not real.stat().st_mode & 0o011
    except OSError:  # it is not there
        inside, closed = [], False
    for path in (folder, real, *above, *inside):
        with contextlib.suppress(OSError):
            mode = path.stat().st_mode
            # of a symbolic link: its own owner, and that of what it leads to
            if others := {path.lstat().st_uid, path.stat().st_uid} - {0, os.getuid()}:
                return f"{path} belongs to another user, {others.pop()}"
            # in a folder with the sticky bit nobody can rename or replace what is another's
            guarded = mode & stat.S_ISVTX if path in above else path in inside and closed
            # with a umask of 002, what is made may be written by the user's own group
            own_group = path.stat().st_gid == os.getgid()
            if mode & (0o002 if own_group else 0o022) and not guarded:
                return f"other users may write to {path}: chmod go-w {path}"
    return ""


def kernel_files() -> list[Path]:
    """The project's files that hold a kernel, sorted."""
    package = Path(__file__).parents[1]
    return [file for file in sorted(package.rglob("*.py")) if _DECORATED.search(file.read_bytes())]


def _base() -> Path:
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given) / "mobman"
    from platformdirs import user_cache_path

    return user_cache_path("mobman", appauthor=False) / "kernels"


def _forget_others(base: Path) -> None:
    """Remove what versions left that nobody has used for long."""
    try:
        for folder in base.iterdir():
            if time.time() - folder.stat().st_mtime > _UNUSED:
                shutil.rmtree(folder, ignore_errors=True)
    except OSError:
        pass


@cache
def _contents(file: Path) -> str:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError:  # a function without a file
        return ""


@cache
def _announce() -> None:
    """Say, once a process, why the first call takes its time."""
    if _HELPER not in os.environ:
        print(
            "mobman: compiling its kernels for this machine; once, it takes some ten seconds"
            + ("" if unsafe() else f" (kept in {kernel_folder()})"),
            file=sys.stderr,
            flush=True,
        )


@cache
def help_compiling() -> None:
    """Let another process compile from the other end of the list, as long as this one lives."""
    if _HELPER in os.environ or (os.cpu_count() or 1) < 2 or not sys.executable or unsafe():
        return
    command = [sys.executable, "-m", "mobman.kernels.ahead", "--backwards"]
    quiet = subprocess.DEVNULL
    with contextlib.suppress(OSError):  # it is a help only
        helper = subprocess.Popen(
            command, stdin=quiet, stdout=quiet, stderr=quiet, env={**os.environ, _HELPER: "1"}
        )
        atexit.register(_end, helper)


def _end(helper: subprocess.Popen[bytes]) -> None:
    helper.kill()
    helper.wait()


@cache
def _warn_not_kept(reason: str) -> None:
    warnings.warn(
        f"mobman's compiled kernels cannot be kept in {kernel_folder()} ({reason}); every process "
        "compiles them again. Set NUMBA_CACHE_DIR to a folder that can be written by you alone",
        stacklevel=2,
    )
