"""What a control step costs; depends on the machine."""

from __future__ import annotations

import numpy as np

from mobman.simulation.metrics.metric import Run, metric


@metric("compute_time_median", "s", "median time that the controller took for a tick")
def compute_time_median(run: Run) -> float:
    return float(np.median(run.compute_time))


@metric("compute_time_p99", "s", "99th percentile of the same")
def compute_time_p99(run: Run) -> float:
    return float(np.percentile(run.compute_time, 99))
