"""Whether the simulation kept to its own laws."""

from __future__ import annotations

import math

from mobman.simulation.metrics.metric import Run, metric


@metric("constraint_residual", "m/s", "largest |A(x) x'| at the ticks")
def constraint_residual(run: Run) -> float:
    return run.constraint_residual


@metric(
    "energy_residual",
    "1",
    "|energy gained - work done|, over the largest of |energy gained|, |work done| and 1 J; NaN for "
    "runs that ended early",
)
def energy_residual(run: Run) -> float:
    if not run.completed:
        return math.nan
    gained = run.plant.energy(run.q[-1], run.z[-1]) - run.plant.energy(run.q[0], run.z[0])
    return abs(gained - run.work) / max(abs(gained), abs(run.work), 1.0)
