"""The robot's own limits: how far a run went beyond them, for how long, and where.

Limits are those of ``robot.limits``, which the URDF states; what it leaves open has none. They count
whether or not the simulated plant enforces any.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.metrics import Run, metric
from mobman.simulation.pieces import Setting
from mobman.simulation.record import Record
from mobman.simulation.record_file import APPLIED
from mobman.simulation.scenario import Scenario

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

_TIMES = "reached {:.3g} times its "

_metric = partial(metric, section="limits")


def _position_excess(run: Run) -> float:
    bounds = zip(run.q.T, run.limits.lower, run.limits.upper, strict=True)
    return float(np.max([(low - q.min(), q.max() - high, 0.0) for q, low, high in bounds]))


def _torque_ratio(run: Run) -> float:
    motors = zip(run.torque.T, run.limits.torque, strict=True)
    return float(np.max([max(v.max(), -v.min()) / limit for v, limit in motors]))


_metric(
    "position_limit_excess",
    "rad or m",
    "how far a joint went beyond its position limits at most; 0 without limits",
)(_position_excess)
_metric(
    "velocity_limit_ratio",
    "1",
    "largest |q'| of a joint or wheel over its velocity limit; 0 without limits",
)(lambda run: float(run.velocity_ratio.max()))
_metric(
    "torque_limit_ratio", "1", "largest torque of a motor over its effort limit; 0 without limits"
)(_torque_ratio)


@_metric(
    "time_beyond_limits",
    "1",
    "share of the ticks at which a position, a velocity or a torque was beyond its limit",
    short="share of ticks beyond a limit",
)
def time_beyond_limits(run: Run) -> float:
    # motor by motor, since what is computed on the way should not be as large as the record
    beyond = run.velocity_ratio > 1.0 + BEYOND
    for q, low, high in zip(run.q.T, run.limits.lower, run.limits.upper, strict=True):
        beyond |= (low - q > BEYOND) | (q - high > BEYOND)
    for v, limit in zip(run.torque.T, run.limits.torque, strict=True):
        beyond |= np.abs(v) / limit > 1.0 + BEYOND
    return float(np.mean(beyond))


# In words ----------------------------------------------------------------------------------------


def limit_remarks(record: Record, robot: MobileManipulator) -> Iterator[str]:
    """Say which limits of the nominal robot a run broke, one line a kind: by what, by how much, and when
    at worst."""
    limits, joints, motors = robot.limits, record.joint_names, record.velocity_names
    excess = np.maximum(limits.lower - record.q, record.q - limits.upper)
    rates = np.abs([robot.velocity_map(q) @ z for q, z in zip(record.q, record.z, strict=True)])
    torque = np.abs(record.signals.get(APPLIED, record.torque))
    for sizes, most, names, size, kind in (
        (excess, BEYOND, joints, "left its limits by {:.3g} {unit}", "joints"),
        (rates / limits.joint_velocity, 1.0 + BEYOND, joints, _TIMES + "velocity limit", "joints"),
        (torque / limits.torque, 1.0 + BEYOND, motors, _TIMES + "torque limit", "motors"),
    ):
        if sizes.max() > most:
            tick, i = np.unravel_index(sizes.argmax(), sizes.shape)
            unit = "m" if robot.slides[robot.joint_names.index(joints[i])] else "rad"  # of excess
            others = int((sizes.max(axis=0) > most).sum()) - 1
            more = f" ({others} other {kind if others > 1 else kind[:-1]} went beyond theirs)"
            text = (
                f"{names[i]} {size.format(sizes[tick, i], unit=unit)} at t = {record.t[tick]:.3g} s"
            )
            yield text + (more if others else "")


def limits_in_the_way(record: Record, robot: MobileManipulator) -> Iterator[str]:
    """Say which limits a run met that no law can help: motors that cannot hold the nominal robot where
    it starts, and the joint that was first at its stop, where there are stops."""
    limits, scenario = robot.limits, Scenario.model_validate(record.spec["scenario"])
    chain = scenario.actuation_chain(
        Setting(robot, record.spec["dt"], np.random.default_rng(record.seed))
    )
    if chain is not None and chain.level is not None:
        holding, arm = np.abs(robot.holding_torque(record.q[0])), slice(robot.n_alpha, None)
        for name, needed, level in zip(
            robot.velocity_names[arm], holding[arm], chain.level[arm], strict=True
        ):
            if needed > level:
                unit = "N" if robot.slides[robot.joint_names.index(name)] else "N m"
                yield (
                    f"{name} cannot hold the robot where it starts: that takes {needed:.3g} of "
                    f"{level:.3g} {unit}"
                )
    excess = np.maximum(limits.lower - record.q, record.q - limits.upper)
    if scenario.stops and excess.max() > BEYOND:
        tick = int((excess > BEYOND).any(axis=1).argmax())
        name = record.joint_names[excess[tick].argmax()]
        yield f"{name} was the first joint at its stop, at t = {record.t[tick]:.3g} s"


def unlimited_motors(record: Record) -> list[str]:
    """Names of the motors without a limit that the law keeps to; none for a law that keeps to none."""
    limits = record.settings.get("torque_limits")
    if not isinstance(limits, list):
        return []
    return [name for name, x in zip(record.velocity_names, limits, strict=True) if x is None]
