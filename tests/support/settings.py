"""Settings in which pieces of a scenario start."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from mobman.simulation.pieces import Setting
from mobman.simulation.scenario import Scenario
from mobman.simulation.sensors import estimators


def setting(robot, seed=0, dt=1e-3):
    """That of a run with a robot."""
    return Setting(robot, dt, np.random.default_rng(seed))


def motors(inertia, seed=0):
    """That of a robot of which only the motors' inertias are known."""
    robot = SimpleNamespace(q_rest=None, motor_inertia=lambda q: np.asarray(inertia))
    return setting(robot, seed)


def estimator(names, dt, type, **fields):
    """An estimator of z' for a robot with such velocities."""
    robot = SimpleNamespace(velocity_names=list(names))
    return estimators.get(type)(**fields).start(setting(robot, dt=dt))


def true_robot(robot, mass_factor=1.0, inertia_factor=None, payload=0.0):
    """The robot with other inertias."""
    factors = {"mass_factor": mass_factor, "inertia_factor": inertia_factor, "payload": payload}
    return Scenario(name="s", **factors).true_robot(setting(robot))
