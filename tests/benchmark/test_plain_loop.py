"""The closed loop written by hand is the one that mobman runs: each checks the other."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import mobman as mm
from mobman.model.extended_jacobian import first_axes

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from peers.plain_loop import plain_loop


@pytest.mark.parametrize(
    ("name", "task_name", "gains", "dt"),
    [
        ("youbot", "paper", {"a": 0.2, "A": 0.2}, 1e-3),
        ("youbot", "paper", {"a": 0.2, "A": 0.2}, 5e-3),  # several steps of the plant a tick
        ("tiago_no_hand", "circle", None, 1e-3),
    ],
)
def test_it_gives_the_motion_and_torques_of_simulate(name, task_name, gains, dt):
    robot = mm.load_robot(name)
    task = mm.make_task(task_name, robot)
    if gains is None:
        found = mm.simulate(robot, "tsm", task, duration=dt, dt=dt).settings
        gains = {"a": found["a"], "A": found["A"]}
    # the loop by hand has the robot's own weights and the whole inertia in its metric
    own = {"K_F": robot.criterion_weights.tolist(), "metric_scale": 1.0}
    record = mm.simulate(
        robot, mm.make_controller("tsm", **gains, **own), task, duration=0.3, dt=dt
    )
    axes = first_axes(robot.nz - 3, robot.nq)  # e^a depends on them
    plain = plain_loop(robot, task, gains, duration=0.3, dt=dt, axes=axes)
    assert record.ok
    expected = {
        "t": record.t,
        "q": record.q,
        "z": record.z,
        "torque": record.torque,
        "error": record.task_error,
    }
    assert plain.keys() == expected.keys()
    for key, values in expected.items():
        np.testing.assert_allclose(plain[key], values, rtol=0, atol=1e-9 * np.abs(values).max())
