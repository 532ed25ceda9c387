"""Import of the process that workers are forked from: each has in it all that runs need."""

from mobman.benchmark.work import perform  # noqa: F401
from mobman.benchmark.workers import preload

preload()
