"""One BLAS thread a worker: the matrices are small, and the workers use all cores already."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

from threadpoolctl import threadpool_limits

_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
_pinned: set[int] = set()


@contextlib.contextmanager
def one_thread_for_children() -> Iterator[None]:
    """Processes started meanwhile load their libraries with one thread."""
    before = {name: os.environ.get(name) for name in _VARIABLES}
    os.environ.update(dict.fromkeys(_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def pin_to_one_thread() -> None:
    """The libraries that this process has loaded use one thread from now on."""
    if os.getpid() not in _pinned:
        threadpool_limits(limits=1)
        _pinned.add(os.getpid())
