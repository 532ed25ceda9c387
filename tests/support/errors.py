"""Reading numbers off a record."""

from __future__ import annotations

import numpy as np


def largest_after(record, time: float, samples: np.ndarray | None = None) -> float:
    """The largest Euclidean norm from that time on; of the task error by default."""
    samples = record.task_error if samples is None else samples
    return float(np.linalg.norm(samples[record.t >= time - 1e-9], axis=1).max())


def size_at(record, time: float) -> float:
    """|e^e| at that time."""
    return float(np.linalg.norm(record.task_error[np.searchsorted(record.t, time - 1e-9)]))
