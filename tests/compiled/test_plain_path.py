"""The kernels as the Python that they are, with NUMBA_DISABLE_JIT=1: the same results."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import mobman as mm

# robot, controller, duration (s)
RUNS = [
    ("youbot", "tsm", 0.05),
    ("tiago_no_hand", "tsm", 0.01),
    *(("youbot", name, 0.01) for name in mm.list_controllers() if name != "tsm"),
]
PARTS = ("q", "z", "torque", "task_error", "auxiliary_error")

PLAIN = """
import sys
import numba
import numpy as np
assert numba.config.DISABLE_JIT
from compiled.test_plain_path import RUNS, simulated
np.savez(sys.argv[1], **{f"{i}/{name}": part for i, run in enumerate(RUNS)
                         for name, part in simulated(*run).items()})
"""


def simulated(robot, name, duration):
    """The record's arrays. Bounds are given, since finding them takes hundreds of evaluations."""
    given = {"a": 0.2, "A": 0.2} if name.startswith("tsm") else {}
    task = "paper" if robot == "youbot" else "circle"
    record = mm.simulate(robot, mm.make_controller(name, **given), task, duration=duration)
    assert record.ok, record.message
    return {part: getattr(record, part) for part in PARTS} | record.signals


@pytest.fixture(scope="module")
def plain(tmp_path_factory, request):
    file = tmp_path_factory.mktemp("plain") / "plain.npz"
    done = subprocess.run(
        [sys.executable, "-c", PLAIN, file],
        cwd=request.config.rootpath / "tests",
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "compiling" not in done.stderr
    with np.load(file) as arrays:
        return dict(arrays)


@pytest.mark.parametrize("run", RUNS, ids=lambda run: "-".join(map(str, run[:2])))
def test_plain_python_computes_the_same(run, plain):
    compiled = simulated(*run)
    for name, part in compiled.items():
        other = plain[f"{RUNS.index(run)}/{name}"]
        assert other.shape == part.shape
        # what the compiler may do is reorder sums
        assert np.abs(other - part).max() <= 1e-12 * np.abs(part).max(), name
