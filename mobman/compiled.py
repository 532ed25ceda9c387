"""Functions that numba compiles once a machine, and their binding to arrays.

A *kernel* (:func:`kernel`) is a plain function of arrays and numbers that writes its results into arrays
it is given; with ``NUMBA_DISABLE_JIT=1`` it is the Python that it is. An *entry* (:func:`bind`) is a
kernel with its arguments: one call from Python without any check of types.

Machine code is kept on disk. numba looks at a function's own file only, not at those of the kernels
that it calls, so each version of mobman's kernels has a folder of its own, named after the contents of
all files that hold one. A kernel of a user's own file is kept as long as that file and mobman do not
change; one that calls kernels of another file of the user's is compiled by every process.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
import re
import shutil
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np

PACKAGE = Path(__file__).parent
OPTIONS: dict[str, Any] = {
    # A division by 0 gives inf or NaN. Sums are not reordered or fused (no fastmath): what a function
    # gives would depend on the functions that it was compiled into, and so on the order of loading.
    "error_model": "numpy",
    # No counting of references (as the docstring of numba.extending.register_jitable has it): a row of
    # a matrix costs nothing, an entry's arrays 0.01 us each instead of 0.1; what would allocate does
    # not compile.
    "_nrt": False,
    "no_cfunc_wrapper": True,  # nobody calls them from C
}

_DECORATED = re.compile(rb"^@kernel\r?$", re.MULTILINE)
_UNUSED = 30 * 24 * 3600.0  # s: folders of other versions go after this time
_TYPES = (np.dtype(np.float64), np.dtype(np.int64))

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function at its first call or binding, and keep the machine code for later processes.

    The function writes into arrays that it is given, allocates nothing, and returns None, a number, or a
    status: 0, or what went wrong. It may call other kernels.
    """
    in_a_file = Path(function.__code__.co_filename).is_file()  # else typed in, say
    keep = in_a_file and not unsafe() and not _calls_other_files(function)
    before = numba.config.CACHE_DIR  # where others keep theirs is not changed
    numba.config.CACHE_DIR = str(kernel_folder())
    try:
        compiled: Function = numba.njit(cache=keep, **OPTIONS)(function)
    finally:
        numba.config.CACHE_DIR = before
    return compiled


def bind(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """A function without arguments that calls one with these.

    Args:
        function: A kernel, which is compiled for them now; any other function as well.
        *arguments: Contiguous arrays of floats or 64-bit integers, read and written in place, and
            numbers, which are constants of the entry; also tuples of these.

    Raises:
        TypeError: If an argument is neither.
    """
    if not is_compiled(function):
        return partial(function, *arguments)
    dispatcher: Any = function
    names = inspect.signature(function).parameters
    if len(names) != len(arguments):
        raise TypeError(
            f"kernel {function.__name__!r} takes {len(names)} arguments; given: {len(arguments)}"
        )
    for name, argument in zip(names, arguments, strict=True):
        if not _fits(argument):
            raise TypeError(
                f"kernel {function.__name__!r}: argument {name!r} is {_described(argument)}; needed: a "
                "number, or a contiguous array of float64 or int64 that can be written to"
            )
    types = tuple(map(numba.typeof, arguments))
    _compile(dispatcher, types)
    # the machine code behind the dispatcher, which would look at the arguments' types at every call
    return partial(dispatcher.get_overload(types), *arguments)


def sequence(*entries: Callable[[], Any]) -> Callable[[], int]:
    """A function that calls entries in order: 0, or the status of the first that has one, the last
    that is called."""

    def run() -> int:
        for entry in entries:
            if status := entry():
                return int(status)
        return 0

    return run


def plain(function: Function) -> Function:
    """The Python function under a kernel: for a call or two, since loading machine code takes longer."""
    unwrapped: Function = inspect.unwrap(function)
    return unwrapped


def is_compiled(function: object) -> bool:
    """True for a kernel, unless compilation is switched off."""
    return hasattr(function, "get_overload")


def _fits(argument: Any) -> bool:
    if isinstance(argument, tuple):
        return all(map(_fits, argument))
    if not isinstance(argument, np.ndarray):
        return isinstance(argument, (int, float, np.integer, np.floating))
    flags, known = argument.flags, argument.dtype in _TYPES or argument.dtype.names is not None
    return known and flags.forc and flags.aligned and flags.writeable


def _described(argument: Any) -> str:
    if not isinstance(argument, np.ndarray):
        return repr(argument)
    shape, strides = argument.shape, argument.strides
    return f"an array of {argument.dtype} of shape {shape} with strides {strides}"


def _compile(function: Any, types: tuple[Any, ...]) -> None:
    _announce(function)
    try:
        function.compile(types)
    except numba.NumbaError:
        raise
    except Exception:  # whatever unpickling half a file may raise
        for file in kernel_folder().rglob("*.nb?"):
            file.unlink(missing_ok=True)
        function.compile(types)


def _calls_other_files(function: Callable[..., Any]) -> bool:
    """True if a user's function names kernels that are in neither its own file nor mobman."""
    file = Path(function.__code__.co_filename)
    named: list[Any] = [function.__globals__.get(name) for name in function.__code__.co_names]
    called = [Path(plain(one).__code__.co_filename) for one in named if is_compiled(one)]
    return any(one != file and PACKAGE not in one.parents for one in called)


# The folder -------------------------------------------------------------------------------------------


@cache
def kernel_folder() -> Path:
    """The folder of this version of the kernels, in the user's cache or in NUMBA_CACHE_DIR."""
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        base = Path(given) / "mobman"
    else:
        from platformdirs import user_cache_path

        base = user_cache_path("mobman", appauthor=False) / "kernels"
    versions = (numba.__version__, np.__version__, version("llvmlite"), sys.version)
    digest = hashlib.sha256(repr(versions).encode())
    for file in [*kernel_files(), Path(__file__)]:  # this one has the options
        digest.update(file.read_bytes())
    folder = base / digest.hexdigest()[:16]
    if not folder.exists():
        with contextlib.suppress(OSError):
            for other in base.iterdir():
                if time.time() - other.stat().st_mtime > _UNUSED:
                    shutil.rmtree(other, ignore_errors=True)
    return folder


def kernel_files() -> list[Path]:
    """The project's files that hold a kernel, sorted."""
    return [file for file in sorted(PACKAGE.rglob("*.py")) if _DECORATED.search(file.read_bytes())]


@cache
def unsafe() -> str:
    """Why machine code cannot be kept, empty if it can: there is no such folder, or another user might
    have written what is in it. Machine code is unpickled and run."""
    folder = kernel_folder().absolute()
    try:
        # for this user alone
        for path in reversed([path for path in (folder, *folder.parents) if not path.exists()]):
            path.mkdir(mode=0o700, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return str(error)
    if os.name != "posix":
        return ""
    real = folder.resolve()
    above, inside = {*folder.parents, *real.parents}, [*real.rglob("*")]
    closed = not real.stat().st_mode & 0o011
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


@cache
def _kept() -> frozenset[str]:
    """Names of the functions that are kept, as numba's indices begin."""
    return frozenset(file.name.rpartition("-")[0] for file in kernel_folder().rglob("*.nbi"))


def anything_kept() -> bool:
    """True if this version of the kernels has been used on this machine."""
    return bool(_kept())


def _announce(function: Any) -> None:
    file = Path(plain(function).__code__.co_filename)
    if unsafe() or f"{file.stem}.{function.__qualname__}" not in _kept():
        _say_that_it_takes_time()


@cache
def _say_that_it_takes_time() -> None:
    """Say, once a process, why the first call takes its time."""
    reason = unsafe()
    print(
        "mobman: compiling its kernels for this machine; once, it takes some twenty seconds"
        + ("" if reason else f" (kept in {kernel_folder()})"),
        file=sys.stderr,
        flush=True,
    )
    if reason:
        warnings.warn(
            f"mobman's compiled kernels cannot be kept in {kernel_folder()} ({reason}); every process "
            "compiles them again. Set NUMBA_CACHE_DIR to a folder that can be written by you alone",
            stacklevel=2,
        )
