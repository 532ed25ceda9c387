"""Functions for the process that reads files."""

from __future__ import annotations

import os
import signal
from collections import deque
from itertools import repeat

import numpy as np


def endless():
    """A loop within C, which no exception interrupts."""
    deque(repeat(0), maxlen=0)


def dies(*_):
    """As a library that writes where it may not."""
    os.kill(os.getpid(), signal.SIGSEGV)


def greedy():
    return len(np.ones(500_000_000))


def raising():
    return {}["x"]


def same(_number):
    return {"a": [1, None, "x", b"bytes"], "b": np.arange(6.0).reshape(2, 3), "c": float("inf")}
