"""Imported once by the process that workers are forked from, so that each starts in no time."""

from __future__ import annotations

import contextlib

import mobman.benchmark.running.perform  # noqa: F401  all that a run needs
from mobman.kernels.ahead import compile_ahead, compiled_ahead

with contextlib.suppress(Exception):  # a worker that needs what failed will say so
    if compiled_ahead():
        compile_ahead()
