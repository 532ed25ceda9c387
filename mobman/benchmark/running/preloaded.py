"""The last import of the process that workers are forked from: each has in it all that runs need."""

from __future__ import annotations

import contextlib

with contextlib.suppress(Exception):  # a worker that needs what failed will say so
    import mobman.benchmark.running.perform  # noqa: F401
    from mobman.benchmark.running.preload import preload

    preload()
