"""What the motion costs the motors."""

from __future__ import annotations

import numpy as np

from mobman.simulation.metrics.metric import Run, metric

_REACHING = 1.0  # s: torque steps are judged after it


@metric("torque_energy", "N^2 m^2 s", "integral of |v|^2 over the run")
def torque_energy(run: Run) -> float:
    return float(run.dt * np.sum(run.torque[:-1] ** 2))


@metric("torque_peak", "N m or N", "largest torque of any motor")
def torque_peak(run: Run) -> float:
    return float(np.abs(run.torque).max())


@metric("torque_variation", "N m or N", "total variation of v, summed over the motors: chattering")
def torque_variation(run: Run) -> float:
    return float(np.abs(np.diff(run.torque, axis=0)).sum())


@metric(
    "torque_rate_variation",
    "N m/s or N/s",
    "total variation of v' = (v_k+1 - v_k)/dt, summed likewise",
)
def torque_rate_variation(run: Run) -> float:
    return float(np.abs(np.diff(run.torque, n=2, axis=0)).sum() / run.dt)


@metric("torque_step", "1", "largest step of a torque from tick to tick after 1 s, over its peak")
def torque_step(run: Run) -> float:
    steps = np.abs(np.diff(run.torque, axis=0))[run.t[1:] > _REACHING]
    peak = np.abs(run.torque).max()
    return float(steps.max() / peak) if steps.size and peak > 0.0 else 0.0
