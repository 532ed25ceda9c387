"""Where machine code is kept between processes.

numba's own cache looks at a function's own file only, not at those of the kernels that it calls, so a
changed kernel could live on inside its callers. Here the machine code of a version of the kernels has
a folder of its own, named after the contents of all files that hold one.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import re
import shutil
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
        folder = kernel_folder()
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()

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
            found = super().load_overload(signature, target_context)
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
            "mobman: compiling its kernels for this machine; once, it takes some ten seconds "
            f"(kept in {kernel_folder()})",
            file=sys.stderr,
            flush=True,
        )


@cache
def help_compiling() -> None:
    """Let another process compile from the other end of the list, as long as this one lives."""
    if _HELPER in os.environ or (os.cpu_count() or 1) < 2 or not sys.executable:
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
        "compiles them anew. Set NUMBA_CACHE_DIR to a folder that can be written",
        stacklevel=2,
    )
