"""What a metric is, what it is computed from, and the registry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array
from mobman.model.criterion import Criterion
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.registry import Registry
from mobman.tasks.task import Task

STEADY = 0.7
"""The steady part of a run starts at this fraction of its duration."""


@dataclass(frozen=True)
class Run:
    """A finished run at full rate, as metrics see it; shapes as in :class:`Record`."""

    completed: bool
    """Whether it went to its end."""
    duration: float
    """As asked for (s)."""
    dt: float
    t: Array
    q: Array
    z: Array
    torque: Array
    """That acts, which is not always that which was commanded."""
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
    limited: NDArray[np.bool_] | None = None
    """At which ticks the actuation cut the commanded torque, shape (N,); None if it never does."""

    @property
    def steady(self) -> Array:
        """Which samples are in the steady part."""
        return np.asarray(self.t >= STEADY * self.duration - 1e-9)


@dataclass(frozen=True)
class Metric:
    """A number that says something of a run."""

    name: str
    unit: str
    description: str
    better: str
    """``"lower"``, ``"higher"`` or ``""`` where neither is better."""
    function: Callable[[Run], float]


metrics: Registry[Metric] = Registry("metric", "mobman.simulation.metrics.kinds")


def metric(
    name: str, unit: str, description: str, better: str = "lower"
) -> Callable[[Callable[[Run], float]], Callable[[Run], float]]:
    """Decorator: register a function of a :class:`Run` as a metric."""

    def register(function: Callable[[Run], float]) -> Callable[[Run], float]:
        metrics.register(name, Metric(name, unit, description, better, function))
        return function

    return register


def list_metrics() -> list[Metric]:
    """All metrics, sorted by name."""
    return [metrics.get(name) for name in metrics.names()]


def compute_metrics(run: Run) -> dict[str, float]:
    """Every metric of a run."""
    with np.errstate(all="ignore"):  # of a run that diverged some are infinite
        return {item.name: float(item.function(run)) for item in list_metrics()}
