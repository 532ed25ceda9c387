"""How well the tip follows."""

from __future__ import annotations

import math

import numpy as np

from mobman.arrays import Array
from mobman.simulation.metrics.metric import Run, metric


def _size(run: Run) -> Array:
    return np.asarray(np.linalg.norm(run.task_error, axis=1))


def _settling_time(run: Run, threshold: float) -> float:
    above = np.flatnonzero(~(_size(run) <= threshold))
    if not run.completed or (len(above) and above[-1] == len(run.t) - 1):
        return math.inf
    return float(run.t[above[-1] + 1]) if len(above) else 0.0


@metric("settling_time_1e-2", "s", "first time from which |e^e| stays below 1e-2 m to the end")
def settling_time_2(run: Run) -> float:
    return _settling_time(run, 1e-2)


@metric("settling_time_1e-4", "s", "first time from which |e^e| stays below 1e-4 m to the end")
def settling_time_4(run: Run) -> float:
    return _settling_time(run, 1e-4)


@metric("settling_time_1e-6", "s", "first time from which |e^e| stays below 1e-6 m to the end")
def settling_time_6(run: Run) -> float:
    return _settling_time(run, 1e-6)


@metric(
    "success", "1", "1 if the run was completed and |e^e| settled below 1e-4 m, else 0", "higher"
)
def success(run: Run) -> float:
    return float(math.isfinite(_settling_time(run, 1e-4)))


@metric("task_error_max", "m", "largest |e^e| in the steady part; inf if the run ended early")
def task_error_max(run: Run) -> float:
    return float(_size(run)[run.steady].max()) if run.completed else math.inf


@metric(
    "task_error_rms", "m", "root mean square of |e^e| in the steady part; inf if it ended early"
)
def task_error_rms(run: Run) -> float:
    if not run.completed:
        return math.inf
    return float(np.sqrt(np.mean(_size(run)[run.steady] ** 2)))


@metric("task_error_final", "m", "|e^e| at the end; inf if the run ended early")
def task_error_final(run: Run) -> float:
    return float(_size(run)[-1]) if run.completed else math.inf
