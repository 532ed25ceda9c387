"""Metrics: numbers that rate a run, computed from its samples at full rate."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array
from mobman.errors import FOREIGN_ERRORS, SingularityError
from mobman.model.criterion import Criterion
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.mobile_manipulator import Limits, MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.registry import Registry
from mobman.tasks.task import Task, time_of

STEADY = 0.7
"""The steady part of a run starts at this fraction of its duration."""

_BATCH = 100  # Jacobians whose singular values are found in one call: 2 us each instead of 7
_PERIOD = 0.01  # s: between two evaluations of the extended Jacobian
_REACHING = 1.0  # s: torque steps are judged after it


@dataclass(frozen=True)
class Run:
    """A finished run at full rate, as metrics see it; shapes as in :class:`Record`."""

    completed: bool
    """True if it went to its end."""
    duration: float
    """As requested (s)."""
    dt: float
    t: Array
    q: Array
    z: Array
    torque: Array
    """The torque that acts, which is not always the commanded one."""
    task_error: Array
    auxiliary_error: Array
    compute_time: Array
    work: float
    """Integral of z^T (B v - D) over the run (J)."""
    constraint_residual: float
    """Largest |A(x) x'| at a tick (m/s)."""
    robot: MobileManipulator
    """The nominal robot."""
    plant: MobileManipulator
    """The true one."""
    task: Task
    task_map: TaskMap
    criterion: Criterion
    limited: NDArray[np.bool_]
    """At which ticks the commanded torque met a limit of the actuation, shape (N,)."""
    velocity_ratio: Array
    """Largest |q'| of a joint over its limit at the ticks, shape (N,); 0 without limits."""
    desired: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """p_d at the ticks (m), shape (N, min(m, 3))."""
    signals: Mapping[str, Array] = field(default_factory=dict)
    """By name, N rows each: those of a plant that is not the ideal one; those of a monitored law, and
    what :mod:`mobman.simulation.monitors` makes of them."""

    @cached_property
    def limits(self) -> Limits:
        """Those that the robot's URDF states."""
        return self.robot.limits

    @cached_property
    def steady(self) -> Array:
        """A mask of the samples in the steady part."""
        return np.asarray(self.t >= STEADY * self.duration - 1e-9)

    @cached_property
    def task_distance(self) -> Array:
        """|e^e| at the ticks (m), of an orientation's rows without these, shape (N,)."""
        distance = np.zeros(len(self.t))
        for e in self.task_error[:, :3].T:  # column by column, which takes half the memory
            distance += np.square(e)
        return np.sqrt(distance, out=distance)

    @property
    def has_orientation(self) -> bool:
        """True if the task has an orientation."""
        return bool(self.task_error.shape[1] > 3)

    @cached_property
    def task_angle(self) -> Array:
        """Angle between the tip and the desired orientation at the ticks (rad), shape (N,); 0 where the
        task has none."""
        half = 0.5 * np.linalg.norm(self.task_error[:, 3:], axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(half, 1.0)))


Function = Callable[[Run], float]


@dataclass(frozen=True)
class Metric:
    """A number that rates a run."""

    name: str
    unit: str
    description: str
    better: str
    """``"lower"``, ``"higher"`` or ``""`` where neither is better."""
    function: Function
    section: str = ""
    """Heading under which reports show it: ``"tracking"``, ``"redundancy"``, ``"effort"``,
    ``"limits"``, ``"ground"``, ``"theorems"``, ``"consistency"``, ``"timing"``; others come last."""
    short: str = ""
    """Its name in the few lines that ``mobman run`` prints; empty if it is not among them."""
    applies: Callable[[Run], bool] | None = None
    """False for runs that have no such number, which are recorded without it; None: all have it."""


metrics: Registry[Metric] = Registry("metric", "mobman.simulation", "mobman.metrics")


def metric(
    name: str,
    unit: str,
    description: str,
    better: str = "lower",
    *,
    early: float | None = None,
    section: str = "",
    short: str = "",
    applies: Callable[[Run], bool] | None = None,
) -> Callable[[Function], Function]:
    """Decorator: register a function of a :class:`Run` as a metric.

    Args:
        name: Of the metric.
        unit: SI, ``"1"`` for a pure number.
        description: One line; what ``early`` is in addition, where that is inf or NaN.
        early: The metric of a run that ended early, if the function is for completed ones only.
        better, section, short, applies: See :class:`Metric`.
    """
    if early is not None and not math.isfinite(early):
        description += f"; {'NaN' if math.isnan(early) else early} if the run ended early"

    def register(function: Function) -> Function:
        def whole(run: Run) -> float:
            return function(run) if early is None or run.completed else early

        item = Metric(name, unit, description, better, whole, section, short, applies)
        metrics.register(name, item, module=function.__module__)
        function.__doc__ = function.__doc__ or f"{name} ({unit}): {description}."
        return function

    return register


def list_metrics() -> list[Metric]:
    """All metrics, sorted by name."""
    return list(metrics.every().values())


def compute_metrics(run: Run) -> dict[str, float]:
    """Every metric of a run that applies to it."""
    applying = [one for one in list_metrics() if one.applies is None or one.applies(run)]
    with np.errstate(all="ignore"):  # of a run that diverged some are infinite
        return {item.name: _value(item, run) for item in applying}


def _value(item: Metric, run: Run) -> float:
    try:
        return float(item.function(run))
    except FOREIGN_ERRORS as error:
        if item.name in metrics.own():
            raise
        # another package's fault must not take a run down
        warnings.warn(f"metric {item.name!r} is NaN: {error!r}", stacklevel=2)
        return math.nan


# Tracking, by position and, in tasks that have one, by orientation ---------------------------------


def settled(run: Run, error: Array, threshold: float) -> float:
    """First time from which an error at the ticks, shape (N,), stays below a threshold to the end (s);
    inf if there is none."""
    above = np.flatnonzero(~(error <= threshold))
    if len(above) and above[-1] == len(run.t) - 1:
        return math.inf
    return float(run.t[above[-1] + 1]) if len(above) else 0.0


def _of_an_error(
    names: tuple[str, str],
    unit: str,
    what: str,
    size: Callable[[Run], Array],
    *,
    end: str = "",
    applies: Callable[[Run], bool] | None = None,
) -> None:
    """Register the metrics of an error, by its size at the ticks, shape (N,)."""
    add = partial(metric, section="tracking", early=math.inf, applies=applies)
    settling, name = names
    for below in ("1e-2", "1e-4", "1e-6"):
        short = f"below {below} {unit}"
        text = f"first time from which {what} stays {short} to the end"

        @add(f"{settling}_{below}", "s", text, short=short)
        def _(run: Run, below: float = float(below)) -> float:
            return settled(run, size(run), below)

    most = f"steady {what.removesuffix(' error')} at most"
    add(f"{name}_max", unit, f"largest {what} in the steady part", short=most)(
        lambda run: float(size(run)[run.steady].max())
    )
    add(f"{name}_rms", unit, f"root mean square of {what} in the steady part")(
        lambda run: float(np.sqrt(np.mean(size(run)[run.steady] ** 2)))
    )
    add(f"{name}_final", unit, f"{what} at the end", short=end)(lambda run: float(size(run)[-1]))


_of_an_error(
    *(("settling_time", "task_error"), "m", "|e^e|", lambda run: run.task_distance),
    end="|e^e| at the end",
)
_of_an_error(
    *(("orientation_settling_time", "orientation_error"), "rad", "angle error"),
    lambda run: run.task_angle,
    applies=lambda run: run.has_orientation,
)


@metric(
    *("success", "1", "1 if completed and |e^e| settled below 1e-4 m (and rad), else 0", "higher"),
    early=0.0,
    section="tracking",
)
def success(run: Run) -> float:
    errors = [run.task_distance, *([run.task_angle] if run.has_orientation else [])]
    return float(all(math.isfinite(settled(run, error, 1e-4)) for error in errors))


# Redundancy --------------------------------------------------------------------------------------

_redundancy = partial(metric, section="redundancy")
_redundancy(
    *("auxiliary_error_max", "1", "largest |e^a| in the steady part"),
    early=math.inf,
    short="steady |e^a| at most",
)(lambda run: float(np.linalg.norm(run.auxiliary_error[run.steady], axis=1).max()))
_redundancy(
    *("criterion_final", "1", "criterion F(q) at the end"), early=math.inf, short="F at the end"
)(lambda run: run.criterion.value(run.q[-1]))


@_redundancy(
    *("lambda_min", "1", "least lambda_min(J J^T), extended Jacobian, every 10 ms", "higher"),
    short="lambda_min(J J^T) at least",
)
def lambda_min(run: Run) -> float:
    """0 where the run met a kinematic singularity."""
    extended, least = ExtendedJacobian(run.robot, run.task_map, run.criterion), math.inf
    every, some = max(1, round(_PERIOD / run.dt)), np.empty((_BATCH, *extended.J.shape))
    ticks = range(0, len(run.q), every)
    for i, tick in enumerate(ticks):
        try:
            extended.at(run.q[tick], run.z[tick])
        except SingularityError:
            return 0.0
        last = i % _BATCH
        some[last] = extended.J
        if last == _BATCH - 1 or i == len(ticks) - 1:
            found = np.linalg.svd(some[: last + 1], compute_uv=False)
            least = min(least, float(found[:, -1].min()))
    return least**2


@_redundancy(
    *("repeatability", "rad, m"),
    "distance of the arm's posture from the one a period before, at the end; NaN for open paths and "
    "for runs shorter than a period",
    early=math.nan,
)
def repeatability(run: Run) -> float:
    """Between ticks the posture is interpolated, since a period is not a whole number of them."""
    period = time_of(run.task, "period")
    if period is None or run.duration < period:
        return math.nan
    exact = (run.t[-1] - period) / run.dt
    before = round(exact)
    # the nearest tick is up to dt/2 from a whole period: linear in between
    fraction = exact - before
    other = min(max(before + (1 if fraction > 0 else -1), 0), len(run.t) - 1)
    near, beyond, end = run.q[[before, other, -1]][:, run.robot.arm_index]
    past = (1 - abs(fraction)) * near + abs(fraction) * beyond
    return float(np.linalg.norm(end - past))


# Effort: motor by motor, since what is computed on the way should not be as large as the record,
# and not by BLAS, whose sum of a long column depends on how many threads it has --------------------

_effort = partial(metric, section="effort")


def _variation(run: Run, n: int) -> float:
    return sum(float(np.abs(np.diff(motor, n=n)).sum()) for motor in run.torque.T)


def _peak(run: Run) -> float:
    return max(float(run.torque.max()), -float(run.torque.min()))


_effort("torque_energy", "N^2 m^2 s", "integral of |v|^2 over the run", short="integral of |v|^2")(
    lambda run: sum(float(run.dt * np.square(motor[:-1]).sum()) for motor in run.torque.T)
)
_effort("torque_peak", "N m or N", "largest torque of any motor", short="largest torque")(_peak)
_effort("torque_variation", "N m or N", "total variation of v, summed over the motors: chattering")(
    lambda run: _variation(run, 1)
)
_effort(
    *("torque_rate_variation", "N m/s or N/s"),
    "total variation of v' = (v_k+1 - v_k)/dt, summed likewise",
)(lambda run: _variation(run, 2) / run.dt)


@_effort(
    *("torque_step", "1", "largest step of a torque from tick to tick after 1 s, over its peak"),
    short="largest step over its peak",
)
def torque_step(run: Run) -> float:
    late, peak = run.t[1:] > _REACHING, _peak(run)
    steps = [np.abs(np.diff(motor))[late].max(initial=0.0) for motor in run.torque.T]
    return float(max(steps) / peak) if peak > 0.0 else 0.0


_limits = partial(metric, section="limits")
_limits(
    *("saturation_share", "1", "share of the ticks at which a commanded torque met a limit"),
    short="share of ticks at a torque limit",
)(lambda run: float(np.mean(run.limited)))


@_limits(
    *("saturation_start", "s"),
    "first time at which a commanded torque met a limit; the duration asked for if none did",
    "higher",
)
def saturation_start(run: Run) -> float:
    return float(run.t[np.argmax(run.limited)]) if run.limited.any() else run.duration


# Ground: slip, grip, what lifts off, and where the tip is in truth --------------------------------

_ground = partial(
    metric, section="ground", early=math.inf, applies=lambda run: "contact/slip" in run.signals
)
_ground("slip_max", "m/s", "largest slip of a wheel", short="slip at most")(
    lambda run: _largest(run.signals["contact/slip"])
)
_ground("slip_way", "m", "way that the wheel which slips most slips")(
    lambda run: _largest(run.dt * run.signals["contact/slip"].sum(axis=0))
)
_ground("wheel_lift", "m", "largest gap between a wheel and the ground", short="lift at most")(
    lambda run: _largest(run.signals["contact/lift"])
)


@_ground(
    *("grip_used", "1", "largest friction over the normal force of a wheel"),
    short="friction over load at most",
)
def grip_used(run: Run) -> float:
    normal, friction = run.signals["contact/normal"], run.signals["contact/friction"]
    return _largest(np.divide(friction, normal, out=np.zeros_like(normal), where=normal > 0.0))


@_ground(
    *("true_error_max", "m"),
    "largest error of the tip in the steady part, with what the platform tilts and sinks",
    applies=lambda run: "contact/tip" in run.signals,
)
def true_error_max(run: Run) -> float:
    away = run.signals["contact/tip"][:, : run.desired.shape[1]] - run.desired
    return _largest(np.linalg.norm(away[run.steady], axis=1))


def _largest(values: Array) -> float:
    return float(values.max(initial=0.0))


# Consistency of the simulation, and cost of a control step ---------------------------------------

_consistency = partial(metric, section="consistency")
_consistency("constraint_residual", "m/s", "largest |A(x) x'| at the ticks")(
    lambda run: run.constraint_residual
)


@_consistency(
    *("energy_residual", "1"),
    "|energy gained - work done|, over the largest of |energy gained|, |work done| and 1 J",
    early=math.nan,
)
def energy_residual(run: Run) -> float:
    gained = run.plant.energy(run.q[-1], run.z[-1]) - run.plant.energy(run.q[0], run.z[0])
    return abs(gained - run.work) / max(abs(gained), abs(run.work), 1.0)


_timing = partial(metric, section="timing")
_timing(
    "compute_time_median",
    "s",
    "median time that the controller took for a tick",
    short="median of a tick",
)(lambda run: float(np.median(run.compute_time)))
_timing("compute_time_p99", "s", "99th percentile of the same", short="99th percentile")(
    lambda run: float(np.percentile(run.compute_time, 99))
)
