"""The robot's own limits: how far a run went beyond them, for how long, and where.

Limits are those of ``robot.limits``, which the URDF states; what it leaves open has none. They count
whether or not the simulated plant enforces any.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial

import numpy as np

from mobman.arrays import Array
from mobman.model.mobile_manipulator import Limits, MobileManipulator
from mobman.simulation.metrics import Run, metric
from mobman.simulation.record import Record
from mobman.simulation.record_file import APPLIED

_metric = partial(metric, section="limits")

BEYOND = 1e-6
"""Excess from which a position counts as beyond its limit (rad, m), and a ratio less 1: no encoder shows
less, and a joint that rests at its limit is off by rounding."""
ALLOWED = {
    "position_limit_excess": BEYOND,
    "velocity_limit_ratio": 1.0 + BEYOND,
    "torque_limit_ratio": 1.0 + BEYOND,
    "time_beyond_limits": 0.0,
}
"""The largest value of each metric of a run that keeps to the limits."""


def position_excess(q: Array, limits: Limits) -> Array:
    """Distance of each coordinate beyond its limits (rad, m), 0 within; shape of q, (N, nq)."""
    beyond: Array = np.maximum(limits.lower - q, q - limits.upper)
    return np.maximum(beyond, 0.0, out=beyond)


def _torque_ratio(run: Run) -> Array:
    """Largest torque of a motor over its limit at the ticks, shape (N,)."""
    # motor by motor, since what is computed on the way should not be as large as the record
    limits = run.robot.limits.torque
    return _largest((np.abs(v) / limit for v, limit in zip(run.torque.T, limits, strict=True)), run)


def _excess(run: Run) -> Array:
    """Largest excess of a coordinate at the ticks (rad, m), shape (N,)."""
    limits = run.robot.limits
    bounds = zip(run.q.T, limits.lower, limits.upper, strict=True)
    return _largest((np.maximum(lower - q, q - upper) for q, lower, upper in bounds), run)


def _largest(rows: Iterable[Array], run: Run) -> Array:
    largest = np.zeros(len(run.t))
    for row in rows:
        np.maximum(largest, row, out=largest)
    return largest


@_metric(
    "position_limit_excess",
    "rad or m",
    "how far a joint went beyond its position limits at most; 0 without limits",
)
def position_limit_excess(run: Run) -> float:
    return float(_excess(run).max())


@_metric(
    "velocity_limit_ratio",
    "1",
    "largest |q'| of a joint or wheel over its velocity limit; 0 without limits",
)
def velocity_limit_ratio(run: Run) -> float:
    return 0.0 if run.velocity_ratio is None else float(run.velocity_ratio.max())


@_metric(
    "torque_limit_ratio",
    "1",
    "largest torque of a motor over its effort limit; 0 without limits",
)
def torque_limit_ratio(run: Run) -> float:
    return float(_torque_ratio(run).max())


@_metric(
    "time_beyond_limits",
    "1",
    "share of the ticks at which a position, a velocity or a torque was beyond its limit",
    short="share of ticks beyond a limit",
)
def time_beyond_limits(run: Run) -> float:
    beyond = (_excess(run) > BEYOND) | (_torque_ratio(run) > 1.0 + BEYOND)
    if run.velocity_ratio is not None:
        beyond |= run.velocity_ratio > 1.0 + BEYOND
    return float(np.mean(beyond))


# In words ----------------------------------------------------------------------------------------


def limit_remarks(record: Record, robot: MobileManipulator) -> Iterator[str]:
    """Say which limits a run broke, one line a kind: by what, by how much, and when at worst.

    Args:
        record: The run.
        robot: Its nominal robot.
    """
    limits, t = robot.limits, record.t
    excess = position_excess(record.q, limits)
    if excess.max() > BEYOND:
        tick, joint = np.unravel_index(excess.argmax(), excess.shape)
        name, others = record.joint_names[joint], int((excess.max(axis=0) > BEYOND).sum()) - 1
        turns = (
            robot.model.joints[robot.model.getJointId(name)].shortname().startswith("JointModelR")
        )
        unit = "rad" if turns else "m"
        size = f"left its limits by {excess[tick, joint]:.3g} {unit}"
        yield _remark(name, size, t[tick], others, "joints")
    torque = np.abs(record.signals.get(APPLIED, record.torque))
    rates = np.abs([robot.velocity_map(q) @ z for q, z in zip(record.q, record.z, strict=True)])
    for ratios, names, what, kind in (
        (rates / limits.joint_velocity, record.joint_names, "velocity limit", "joints"),
        (torque / limits.torque, record.velocity_names, "torque limit", "motors"),
    ):
        if ratios.max() > 1.0 + BEYOND:
            tick, i = np.unravel_index(ratios.argmax(), ratios.shape)
            others = int((ratios.max(axis=0) > 1.0 + BEYOND).sum()) - 1
            size = f"reached {ratios[tick, i]:.3g} times its {what}"
            yield _remark(names[i], size, t[tick], others, kind)


def unlimited_motors(record: Record) -> list[str]:
    """Names of the motors without a limit that the law keeps to; none for a law that keeps to none."""
    limits = record.settings.get("torque_limits")
    if not isinstance(limits, list):
        return []
    return [name for name, x in zip(record.velocity_names, limits, strict=True) if x is None]


def _remark(name: str, what: str, t: float, others: int, kind: str) -> str:
    more = f" ({others} other {kind if others > 1 else kind[:-1]} went beyond theirs)"
    return f"{name} {what} at t = {t:.3g} s" + (more if others else "")
