"""What the motion costs the motors."""

from __future__ import annotations

import numpy as np

from mobman.simulation.metrics.metric import Run, metric

# Motor by motor: what is computed on the way should not be as large as the record itself.

_REACHING = 1.0  # s: torque steps are judged after it


@metric("torque_energy", "N^2 m^2 s", "integral of |v|^2 over the run")
def torque_energy(run: Run) -> float:
    # not by BLAS, whose sum of a long column depends on how many threads it has
    return sum(float(run.dt * np.square(motor[:-1]).sum()) for motor in run.torque.T)


@metric("torque_peak", "N m or N", "largest torque of any motor")
def torque_peak(run: Run) -> float:
    return max(float(run.torque.max()), -float(run.torque.min()))


@metric("torque_variation", "N m or N", "total variation of v, summed over the motors: chattering")
def torque_variation(run: Run) -> float:
    return sum(float(np.abs(np.diff(motor)).sum()) for motor in run.torque.T)


@metric(
    "torque_rate_variation",
    "N m/s or N/s",
    "total variation of v' = (v_k+1 - v_k)/dt, summed likewise",
)
def torque_rate_variation(run: Run) -> float:
    return sum(float(np.abs(np.diff(motor, n=2)).sum()) for motor in run.torque.T) / run.dt


@metric("torque_step", "1", "largest step of a torque from tick to tick after 1 s, over its peak")
def torque_step(run: Run) -> float:
    late = run.t[1:] > _REACHING
    steps = [np.abs(np.diff(motor))[late].max(initial=0.0) for motor in run.torque.T]
    peak = torque_peak(run)
    return float(max(steps) / peak) if peak > 0.0 else 0.0
