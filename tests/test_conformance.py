"""Every robot with every law: runs that must be finite, repeatable and without slip; and the promise
that the paper's law settles on every arm."""

from __future__ import annotations

import numpy as np
import pytest
from support.differences import relative

import mobman as mm

RECORDED = ("t", "q", "z", "torque", "task_error")


@pytest.mark.parametrize("duration", [0.2, pytest.param(1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("controller", mm.list_controllers())
def test_short_run(robot, controller, duration):
    """A run that ends early (tsm-simplified may, see the docs) says when and why, and is finite too."""
    record = mm.simulate(robot, controller, "circle", duration=duration)
    again = mm.simulate(robot, controller, "circle", duration=0.25 * duration)
    for name in RECORDED:
        values = getattr(record, name)
        assert np.all(np.isfinite(values)), name
        repeated = getattr(again, name)
        assert np.array_equal(values[: len(repeated)], repeated), name
    assert record.metrics["constraint_residual"] < 1e-9
    assert (record.status == "ok") == (not record.message)
    if controller != "tsm-simplified":
        assert record.status == "ok", record.message
        # q' = C z along the whole run
        q_dot = np.array(
            [robot.velocity_map(q) @ z for q, z in zip(record.q, record.z, strict=True)]
        )
        steps = np.diff(record.q, axis=0) / np.diff(record.t)[:, None]
        mean = 0.5 * (q_dot[1:] + q_dot[:-1])
        assert relative(steps[1:], mean[1:]) < 1e-3


@pytest.mark.parametrize("dt", [2.5e-3, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_paper_law_settles(robot, dt):
    """On every robot whose arm has three joints or more, to 1e-4 within 5 s of a circle in reach."""
    assert robot.n >= 3
    record = mm.simulate(robot, "tsm", "circle", duration=5.0, dt=dt)
    assert record.status == "ok", record.message
    assert record.metrics["settling_time_1e-4"] < 5.0
    late = np.linalg.norm(record.task_error[record.t > 4.0], axis=1)
    assert late.max() < 1e-6
