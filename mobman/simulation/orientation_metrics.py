"""Metrics of the orientation, in runs whose task has one: the angle between the tip and where it should
be turned, in rad."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from mobman.arrays import Array
from mobman.simulation.metrics import Run, metric, settled


def _has_orientation(run: Run) -> bool:
    return run.task_angle is not None


_turning = partial(metric, section="tracking", early=math.inf, applies=_has_orientation)


def _angle(run: Run) -> Array:
    angle = run.task_angle
    assert angle is not None  # the metric does not apply
    return angle


def _settling_time_to(threshold: str) -> None:
    text = f"first time from which the angle error stays below {threshold} rad to the end"
    short = f"below {threshold} rad"
    register = _turning(f"orientation_settling_time_{threshold}", "s", text, short=short)
    register(lambda run: settled(run, _angle(run), float(threshold)))


for _threshold in ("1e-2", "1e-4", "1e-6"):
    _settling_time_to(_threshold)


@_turning(
    "orientation_error_max",
    "rad",
    "largest angle error in the steady part; inf if the run ended early",
    short="steady angle at most",
)
def orientation_error_max(run: Run) -> float:
    return float(_angle(run)[run.steady].max())


@_turning(
    "orientation_error_rms",
    "rad",
    "root mean square of the angle error in the steady part; inf if it ended early",
)
def orientation_error_rms(run: Run) -> float:
    return float(np.sqrt(np.mean(_angle(run)[run.steady] ** 2)))


@_turning("orientation_error_final", "rad", "angle error at the end; inf if the run ended early")
def orientation_error_final(run: Run) -> float:
    return float(_angle(run)[-1])
