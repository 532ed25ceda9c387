"""How well the redundant degrees of freedom are used."""

from __future__ import annotations

import math

import numpy as np

from mobman.errors import SingularityError
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.simulation.metrics.metric import Run, metric

_BATCH = 100  # Jacobians whose singular values are found in one call
_PERIOD = 0.01  # s: how often the extended Jacobian is looked at


@metric("auxiliary_error_max", "1", "largest |e^a| in the steady part; inf if the run ended early")
def auxiliary_error_max(run: Run) -> float:
    if not run.completed:
        return math.inf
    return float(np.linalg.norm(run.auxiliary_error[run.steady], axis=1).max())


@metric("criterion_final", "1", "criterion F(q) at the end; inf if the run ended early")
def criterion_final(run: Run) -> float:
    return run.criterion.value(run.q[-1]) if run.completed else math.inf


@metric("lambda_min", "1", "least lambda_min(J J^T), extended Jacobian, every 10 ms", "higher")
def lambda_min(run: Run) -> float:
    """0 where the run met a kinematic singularity."""
    every = max(1, round(_PERIOD / run.dt))
    extended = ExtendedJacobian(run.robot, run.task_map, run.criterion)
    least = math.inf
    looked_at = list(range(0, len(run.q), every))
    for some in (looked_at[i : i + _BATCH] for i in range(0, len(looked_at), _BATCH)):
        jacobians = np.empty((len(some), run.robot.nz, run.robot.nz))
        for jacobian, tick in zip(jacobians, some, strict=True):
            try:
                extended.at(run.q[tick], run.z[tick])
            except SingularityError:
                return 0.0
            jacobian[:] = extended.J
        least = min(least, float(np.linalg.svd(jacobians, compute_uv=False)[:, -1].min()) ** 2)
    return least


@metric(
    "repeatability",
    "rad, m",
    "distance of the arm's posture from the one a period before, at the end; NaN for open paths and "
    "for runs shorter than a period",
)
def repeatability(run: Run) -> float:
    """Between ticks the posture is interpolated, since a period is no whole number of them."""
    period = getattr(run.task, "period", None)
    if period is None or not run.completed or run.duration < period:
        return math.nan
    before = round((run.t[-1] - period) / run.dt)
    arm = run.robot.arm_index
    # the nearest tick is up to dt/2 from a whole period: linear in between
    fraction = (run.t[-1] - period) / run.dt - before
    other = before + (1 if fraction > 0 else -1)
    other = min(max(other, 0), len(run.t) - 1)
    past = (1 - abs(fraction)) * run.q[before, arm] + abs(fraction) * run.q[other, arm]
    return float(np.linalg.norm(run.q[-1, arm] - past))
