"""The decorator of kernels."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, TypeVar

import numba

from mobman.kernels.cache import KernelCache

# Sums may be reordered and fused, which lets them use the vector units; nothing else that could
# change a result by more than rounding is allowed.
OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract"},
    "_nrt": False,  # no reference counts: what would allocate does not compile
}

KERNELS: list[Any] = []
"""All that were decorated, in order."""

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function at its first call, and keep the machine code for later processes.

    The function writes into arrays that it is given, allocates nothing, and returns None, a number,
    or a status: 0, or what went wrong. A division by 0 gives inf or NaN. As a step of a program, its
    parameters are annotated by the names of :mod:`mobman.arrays`, by ``int`` or by ``float``.
    """
    compiled: Any = numba.njit(no_cfunc_wrapper=True, **OPTIONS)(function)
    if is_compiled(compiled):
        compiled._cache = KernelCache(function)
        KERNELS.append(compiled)
    result: Function = compiled
    return result


def is_compiled(function: object) -> bool:
    """True for a kernel, unless compilation is switched off."""
    return isinstance(function, numba.core.registry.CPUDispatcher)


def plain(function: Function) -> Function:
    """The function of Python under a kernel, and under those that it calls: for a call or two, since
    compiling takes longer than that."""
    return _plain(function) if is_compiled(function) else function


@cache
def _plain(function: Any) -> Any:
    source = function.py_func
    names = dict(source.__globals__)
    for name in source.__code__.co_names:
        if is_compiled(names.get(name)):
            names[name] = plain(names[name])
    return FunctionType(source.__code__, names, source.__name__, source.__defaults__)
