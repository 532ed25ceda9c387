"""Metrics of runs on the ground: slip, grip, what lifts off, and where the tip is in truth."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from mobman.arrays import Array
from mobman.simulation.metrics import Run, metric


def _on_wheels(run: Run) -> bool:
    return "contact/slip" in run.ground


def _on_ground(run: Run) -> bool:
    return "contact/tip" in run.ground


_ground = partial(metric, section="ground", early=math.inf, applies=_on_wheels)


def _largest(values: Array) -> float:
    return float(values.max(initial=0.0))


@_ground(
    "slip_max",
    "m/s",
    "largest slip of a wheel; inf if the run ended early",
    short="slip at most",
)
def slip_max(run: Run) -> float:
    return _largest(run.ground["contact/slip"])


@_ground(
    "slip_way",
    "m",
    "way that the wheel which slips most slips; inf if the run ended early",
)
def slip_way(run: Run) -> float:
    return _largest(run.dt * run.ground["contact/slip"].sum(axis=0))


@_ground(
    "grip_used",
    "1",
    "largest friction over the normal force of a wheel; inf if the run ended early",
    short="friction over load at most",
)
def grip_used(run: Run) -> float:
    normal, friction = run.ground["contact/normal"], run.ground["contact/friction"]
    return _largest(np.divide(friction, normal, out=np.zeros_like(normal), where=normal > 0.0))


@_ground(
    "wheel_lift",
    "m",
    "largest gap between a wheel and the ground; inf if the run ended early",
    short="lift at most",
)
def wheel_lift(run: Run) -> float:
    return _largest(run.ground["contact/lift"])


@_ground(
    "true_error_max",
    "m",
    "largest error of the tip in the steady part, with what the platform tilts and sinks; inf if it "
    "ended early",
    applies=_on_ground,
)
def true_error_max(run: Run) -> float:
    away = run.ground["contact/tip"][:, : run.desired.shape[1]] - run.desired
    return _largest(np.linalg.norm(away[run.steady], axis=1))
