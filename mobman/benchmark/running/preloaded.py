"""The last import of the process that workers are forked from: each has in it all that runs need."""

from __future__ import annotations

import mobman.benchmark.running.perform  # noqa: F401
from mobman.benchmark.running.preload import preload
from mobman.kernels.ahead import compiled_ahead

if compiled_ahead():  # otherwise who starts a suite is compiling at this moment
    preload()
