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
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from functools import cache, cached_property, partial
from importlib.metadata import version
from itertools import chain, groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

from mobman.files import write_whole

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
    # Arrays are several numbers each, of which a call would put hundreds on the stack: a tick takes a
    # tenth less.
    "forceinline": True,
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
    compiled: Function = _njit(function, cache=keep, **OPTIONS)
    return compiled


def _njit(function: Any, *signatures: str, **options: Any) -> Any:
    with _own_settings():
        return numba.njit(*signatures, **options)(function)


@contextlib.contextmanager
def _own_settings() -> Iterator[None]:
    """numba's settings of kernels, while one is made; those of others' functions do not change."""
    config, before = numba.config, (numba.config.CACHE_DIR, numba.config.OPT)
    config.CACHE_DIR = str(kernel_folder())
    # loops are vectorised at the first level, too; the third takes a third longer and saves no time
    config.OPT = type(config.OPT)(1)
    try:
        yield
    finally:
        config.CACHE_DIR, config.OPT = before


class Call:
    """A kernel with its arguments; TypeError if one is neither a number nor an array that fits.

    Attributes:
        kinds: The properties of the arguments that decide their types: numba's own look at one takes
            10 us, and a run has a thousand.
        leaves: The arrays and numbers in them, those of tuples one by one, and before each its id if it
            is an array with entries, else 0.
    """

    def __init__(self, function: Any, arguments: tuple[Any, ...]) -> None:
        self.function, self.arguments, self.leaves = function, arguments, list[tuple[int, Any]]()
        kinds = []
        for name, given in zip(signature(function).parameters, arguments, strict=True):
            try:
                kinds.append(self._kind(given))
            except ValueError:
                found = repr(given)
                if isinstance(given, np.ndarray):
                    kind, strides = f"{given.dtype} of shape {given.shape}", given.strides
                    found = f"an array of {kind} with strides {strides}"
                raise TypeError(
                    f"kernel {function.__name__!r}: argument {name!r} is {found}; needed: a number, or "
                    "a contiguous array of float64 or int64 that can be written to"
                ) from None
        self.kinds = tuple(kinds)

    def _kind(self, argument: Any) -> Any:
        if isinstance(argument, tuple):
            return type(argument), *map(self._kind, argument)
        if not isinstance(argument, np.ndarray):
            self.leaves.append((0, argument))
            if isinstance(argument, (int, float, np.integer, np.floating)):
                return type(argument)
            raise ValueError
        flags, dtype = argument.flags, argument.dtype
        if not (flags.forc and flags.aligned and flags.writeable):
            raise ValueError
        numbers = dtype in _TYPES
        if not numbers and dtype.names is None:
            raise ValueError
        self.leaves.append((id(argument) if numbers and argument.size else 0, argument))
        return dtype, argument.ndim, flags.c_contiguous

    def compiled(self) -> Callable[[], Any]:
        """The machine code for these arguments, with them."""
        key = self.function, self.kinds
        if key not in _found:
            _found[key] = _compiled_for(self.function, tuple(map(numba.typeof, self.arguments)))
        return partial(_found[key], *self.arguments)


_found: dict[Any, Callable[..., Any]] = {}


class BoundKernels:
    """Kernels of mobman with their arguments, called in order."""

    def __init__(self, *calls: Call) -> None:
        self.calls = calls

    def __call__(self) -> int:
        for run in self._each:
            if status := run():
                return int(status)
        return 0

    @cached_property
    def _each(self) -> list[Callable[[], Any]]:
        return [call.compiled() for call in self.calls]

    @cached_property
    def joined(self) -> Callable[[], int]:
        """The same as one compiled function; see :func:`_written`."""
        call, table = _written(self.calls)
        run: Any = call.compiled()
        run.parts, run.kept = [self], table  # self keeps the other arrays
        return cast(Callable[[], int], run)


def _compiled_for(function: Any, types: tuple[Any, ...]) -> Callable[..., Any]:
    """The function behind the dispatcher, which would look at the arguments' types at every call."""
    if types not in function.overloads:
        file = Path(plain(function).__code__.co_filename)
        if unsafe() or f"{file.stem}.{function.__qualname__}" not in _kept():
            _say_that_it_takes_time()
        with _own_settings():
            try:
                function.compile(types)
            except numba.NumbaError:
                raise
            except Exception:  # whatever unpickling half a file may raise
                for kept in kernel_folder().rglob("*.nb?"):
                    kept.unlink(missing_ok=True)
                function.compile(types)
    found: Callable[..., Any] = function.get_overload(types)
    return found


def bind(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """A function without arguments that calls one with these.

    Args:
        function: A kernel, which is compiled for them at the first call; any other function as well.
        *arguments: Contiguous arrays of floats or 64-bit integers, read and written in place, and
            numbers, which are constants of the entry; also tuples of these.

    Raises:
        TypeError: If an argument is neither.
    """
    if not is_compiled(function):
        return partial(function, *arguments)
    needed = len(signature(function).parameters)
    if needed != len(arguments):
        raise TypeError(
            f"kernel {function.__name__!r} takes {needed} arguments; given: {len(arguments)}"
        )
    call = Call(function, arguments)
    return BoundKernels(call) if _of_mobman(function) else call.compiled()


@cache
def _of_mobman(function: Callable[..., Any]) -> bool:
    return PACKAGE in Path(plain(function).__code__.co_filename).parents


signature = cache(inspect.signature)  # 20 us, of some hundred functions a run


_joining: ContextVar[dict[int, Any] | None] = ContextVar("_joining", default=None)
"""Arrays with their places in memory, a microsecond each, by their ids; None if nothing is joined."""


@contextlib.contextmanager
def worth_joining(worth: bool) -> Iterator[None]:
    """Sequences made meanwhile are compiled as one function each: for a run of many ticks, since that
    takes some ten seconds more, once for each combination of kernels."""
    token = _joining.set({} if worth else None)
    try:
        yield
    finally:
        _joining.reset(token)


def sequence(*entries: Callable[[], Any], join: bool = True) -> Callable[[], int]:
    """A function that calls entries in order: 0, or the status of the first that has one, the last
    that is called.

    Neighbours that are mobman's kernels become one compiled function where that is
    :func:`worth_joining`; the results are the same to the last bit. A sequence that is there to be part
    of others does without (``join``): it becomes one with their kernels.
    """
    flat = [part for one in entries for part in getattr(one, "parts", [one])]
    steps: list[Any] = []
    for ours, group in groupby(flat, lambda one: isinstance(one, BoundKernels)):
        members: list[Any] = list(group)
        if ours:
            entry = BoundKernels(*(call for one in members for call in one.calls))
            members = [entry if not join or _joining.get() is None else entry.joined]
        steps += members
    if len(steps) == 1:
        only: Callable[[], int] = steps[0]
        return only

    def run() -> int:
        for step in steps:
            if status := step():
                return int(status)
        return 0

    run.parts = flat  # type: ignore[attr-defined]
    return run


def _written(calls: Sequence[Call]) -> tuple[Call, Any]:
    """A kernel that calls others, and an array to keep with it.

    To unpack an array from its Python object takes as long as a short kernel, so that it is given one
    array, and at which place from there a table is of where the others are and how long.
    """
    arrays: dict[int, Any] = {}
    others: list[Any] = []  # numbers, records, and arrays without an entry
    places: list[int] = []  # of all, in order: in the arrays, or from -1 down in the others
    numbers: dict[int, int] = {}
    for key, leaf in (leaf for call in calls for leaf in call.leaves):
        if key:
            arrays[key] = leaf
            places.append(numbers.setdefault(key, len(numbers)))
        else:
            others.append(leaf)
            places.append(-len(others))
    if (known := _joining.get()) is None:
        known = {}
    for key in arrays.keys() - known.keys():
        known[key] = arrays[key], _address(arrays[key])
    table = np.zeros(sum(1 + array.ndim for array in arrays.values()) or 1, dtype=np.int64)
    rows = [*(known[key] for key in arrays), (table, _address(table))]
    first, begin = min(rows, key=itemgetter(1))  # the others are behind it in memory
    *told, at = [((address - begin) // 8, *array.shape) for array, address in rows]
    told = list(chain.from_iterable(told))
    table[: len(told)] = told
    written = _kernel_of(tuple((call.function, call.kinds) for call in calls), tuple(places))
    return Call(written, (first.ravel("K").view(np.float64), at[0], *others)), table


def _address(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


@cache
def _kernel_of(calls: tuple[tuple[Any, Any], ...], places: tuple[int, ...]) -> Any:
    """A kernel that calls functions, each with the kinds of its arguments; see :func:`_written`."""
    names: dict[str, Any] = {}
    head: list[str] = []
    lines: list[str] = []
    following, size = iter(places), 0

    def named(one: Any) -> str:
        name = f"{one.__module__}.{one.__qualname__}".replace(".", "_")
        names[name] = one
        return name

    def text(kind: Any) -> str:
        nonlocal size
        if isinstance(kind, tuple) and isinstance(kind[0], type):
            inside = "".join(f"{text(part)}, " for part in kind[1:])
            return f"{named(kind[0]) if hasattr(kind[0], '_fields') else ''}({inside})"
        place = next(following)
        if place == len(head):  # an array that was not there before
            dtype, ndim, by_rows = kind
            base = f"first.ctypes, table[{size}]"
            sizes = "".join(f", table[{size + i}]" for i in range(1, ndim + 1))
            if ndim > 1:
                base = f"_vector({base}, 1).ctypes"
            view = _BY_ROWS[ndim, dtype.kind] if by_rows else "_columns"
            head.append(f"a{place} = {view}({base}{sizes})")
            size += 1 + ndim
        return f"a{place}" if place >= 0 else f"b{-place - 1}"

    for function, kinds in calls:
        line = f"{named(function)}({', '.join(map(text, kinds))})"
        if signature(function).return_annotation == "None":
            lines += [line]
        else:
            lines += [f"status = {line}", "if status != 0:", "    return status"]
    rest = "".join(f", b{i}" for i in range(sum(place < 0 for place in places)))
    head.insert(0, f"table = _index(first.ctypes, at, {size})")
    source = "\n    ".join([f"(first, at{rest}):", *head, *lines, "return 0\n"])
    # a name of its own: machine code is found by the function's name and the arguments' types
    name = f"written_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    file, source = kernel_folder() / f"{name}.py", f"def {name}{source}"
    if not unsafe() and not file.exists():  # numba keeps machine code by the file of its source
        with contextlib.suppress(OSError):  # it is compiled by every process then
            write_whole(file, source.encode())
    inside = {"__name__": __name__, **_views(), **names}
    exec(compile(source, str(file), "exec"), inside)
    return kernel(inside[name])


_BY_ROWS = {(1, "f"): "_vector", (2, "f"): "_matrix", (3, "f"): "_tensor", (1, "i"): "_index"}


def _vector(base: Any, at: int, n: int) -> Any:
    return numba.carray(base, (at + n,), np.float64)[at:]


def _index(base: Any, at: int, n: int) -> Any:
    return numba.carray(base, (at + n,), np.int64)[at:]


def _matrix(place: Any, n: int, m: int) -> Any:
    return numba.carray(place, (n, m), np.float64)


def _columns(place: Any, n: int, m: int) -> Any:
    return numba.farray(place, (n, m), np.float64)


def _tensor(place: Any, n: int, m: int, l: int) -> Any:
    return numba.carray(place, (n, m, l), np.float64)


@cache
def _views() -> dict[str, Any]:
    """Functions that give an array by its place, counted from another's in memory."""
    options = {key: value for key, value in OPTIONS.items() if key != "_nrt"}
    signatures = {
        _vector: "float64[::1](voidptr, int64, int64)",
        _index: "int64[::1](voidptr, int64, int64)",
        _matrix: "float64[:, ::1](voidptr, int64, int64)",
        _columns: "float64[::1, :](voidptr, int64, int64)",
        _tensor: "float64[:, :, ::1](voidptr, int64, int64, int64)",
    }
    return {
        view.__name__: _njit(view, types, cache=not unsafe(), **options)
        for view, types in signatures.items()
    }


def plain(function: Function) -> Function:
    """The Python function under a kernel: for a call or two, since loading machine code takes longer."""
    unwrapped: Function = inspect.unwrap(function)
    return unwrapped


def is_compiled(function: object) -> bool:
    """True for a kernel, unless compilation is switched off."""
    return hasattr(function, "get_overload")


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
    """Reason why machine code cannot be kept, empty if it can: there is no such folder, or another
    user might have written what is in it. Machine code is unpickled and run."""
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


@cache
def _say_that_it_takes_time() -> None:
    """Say, once a process, why the first call takes its time."""
    reason, which = unsafe(), "once, it takes about half a minute"
    if anything_kept() and not reason:
        which = "those that were not used before"
    where = "" if reason else f" (kept in {kernel_folder()})"
    what = f"mobman: compiling its kernels for this machine; {which}{where}"
    print(what, file=sys.stderr, flush=True)
    if reason:
        warnings.warn(
            f"mobman's compiled kernels cannot be kept in {kernel_folder()} ({reason}); every process "
            "compiles them again. Set NUMBA_CACHE_DIR to a folder that can be written by you alone",
            stacklevel=2,
        )
