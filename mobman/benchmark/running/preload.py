"""All that runs need, loaded before the first: by the process that workers are forked from, so that each
starts in no time, and by any other that does runs.

No time limit may strike meanwhile: an import that is broken off can leave a library that will not be
imported again.
"""

from __future__ import annotations

import contextlib
import io
from functools import cache

import h5py

import mobman.simulation.simulate  # noqa: F401
from mobman.kernels.ahead import compile_ahead
from mobman.provenance import machine, versions
from mobman.simulation.metrics import list_metrics


@cache
def preload() -> None:
    """Load the machine code of every kernel, once a process; compile what is not compiled yet."""
    for step in (compile_ahead, list_metrics, versions, machine, _use_h5py):
        with contextlib.suppress(Exception):  # a run that needs what failed will say so
            step()


def _use_h5py() -> None:
    """It imports a part of itself when it is asked for it."""
    with h5py.File(io.BytesIO(), "w") as file:
        assert file.create_dataset("t", data=(0.0,)).dims is not None
