"""How often the motors could not do what was asked of them."""

from __future__ import annotations

import numpy as np

from mobman.simulation.metrics.metric import Run, metric


@metric("saturation_share", "1", "share of the ticks at which a limit cut a commanded torque")
def saturation_share(run: Run) -> float:
    return 0.0 if run.limited is None else float(np.mean(run.limited))


@metric(
    "saturation_start",
    "s",
    "first time at which a limit cut a commanded torque; the duration asked for if none did",
    "higher",
)
def saturation_start(run: Run) -> float:
    if run.limited is None or not run.limited.any():
        return run.duration
    return float(run.t[np.argmax(run.limited)])
