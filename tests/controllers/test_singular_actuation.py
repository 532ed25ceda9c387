"""B(q) that is singular on the way, condition (67) of the paper: passed with the transpose."""

from __future__ import annotations

import numpy as np
import pytest
from support.variants import description

import mobman as mm
from mobman.files import resource_folder

TIME = 1.0  # of the passage (s)


def _cranked(**options):
    crank = resource_folder("benchmarks") / "crank.py"
    content = description(
        platform={"type": "custom", "definition": f"{crank}:Crank", "options": options},
        urdf__lock=["phi_1", "phi_2"],
    )
    return mm.load_robot(content)


@pytest.fixture(scope="module")
def passages():
    """The run with a lever at every heading, the dead heading, and the runs of two laws through it."""
    free = mm.simulate(_cranked(), "tsm", "circle", duration=1.3)
    dead = float(free.q[round(1000 * TIME), 2])
    laws = ("tsm", "tsm-inverse-actuation")
    return (
        free,
        dead,
        [mm.simulate(_cranked(dead=dead), law, "circle", duration=1.3) for law in laws],
    )


def test_the_robot_has_a_dead_heading():
    robot = _cranked(dead=0.3)
    q = robot.q_rest.copy()
    assert np.linalg.matrix_rank(robot.actuation(q)) == robot.nz
    q[2] = 0.3
    assert np.linalg.matrix_rank(robot.actuation(q)) == robot.nz - 1


def test_the_transpose_passes_a_singular_actuation_matrix(passages):
    free, dead, (transpose, inverse) = passages
    for record in (transpose, inverse):
        assert record.ok
        assert record.q[0, 2] < dead < record.q[-1, 2]
        np.testing.assert_allclose(record.task_error[-1], free.task_error[-1], atol=1e-4)
    peaks = [np.abs(record.torque[:, 1]).max() for record in (free, transpose, inverse)]
    assert peaks[0] < 1.0
    assert 10.0 * peaks[1] < peaks[2]
