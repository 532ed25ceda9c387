"""Hand-made runs, for metrics, and parts of a closed loop that do one simple thing."""

from __future__ import annotations

import numpy as np

from mobman.model.criterion import Posture
from mobman.model.task_map import TaskMap
from mobman.simulation.metrics import Run


class Still:
    """A task: stay at one point."""

    def __init__(self, point, period=None):
        self.point = np.asarray(point, dtype=float)
        if period is not None:
            self.period = period

    def desired(self, t):
        none = np.zeros_like(self.point)
        return self.point, none, none, none


class Torque:
    """A controller whose torque is a given function of time."""

    def __init__(self, function):
        self.function = function

    def reset(self, robot, task, dt):
        pass

    def step(self, t, q, z, z_dot):
        return self.function(t)


def hand_made_run(robot, *, duration=10.0, dt=0.01, **changes) -> Run:
    """A completed run in which nothing moves and every error is 0, but for ``changes``."""
    n = len(changes["t"]) if "t" in changes else round(duration / dt) + 1
    fields = {
        "completed": True,
        "duration": duration,
        "dt": dt,
        "t": np.arange(n) * dt,
        "q": np.tile(robot.q_rest, (n, 1)),
        "z": np.zeros((n, robot.nz)),
        "torque": np.zeros((n, robot.nz)),
        "task_error": np.zeros((n, 3)),
        "auxiliary_error": np.zeros((n, robot.nz - 3)),
        "compute_time": np.full(n, 1e-4),
        "work": 0.0,
        "constraint_residual": 0.0,
        "robot": robot,
        "plant": robot,
        "task": Still(np.zeros(3)),
        "task_map": TaskMap(),
        "criterion": Posture.of(robot),
        "limited": np.zeros(n, dtype=bool),
        "velocity_ratio": np.zeros(n),
    }
    return Run(**{**fields, **changes})
