"""The loop that runs a law on a robot, against its stand-in in another process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "docs/examples/deploy.py"


def told(*arguments):
    done = subprocess.run(
        [sys.executable, EXAMPLE, *arguments], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(("base", "reached"), [("torque", 1e-4), ("velocity", 1e-3)])
def test_the_tip_comes_to_its_path(base, reached):
    """With z' from differences, and torques that act a tick after what was measured."""
    found = told("--robot", "youbot", "--base", base, "--seconds", "4", "--lockstep")
    assert found["ticks"] == 4000
    assert found["error_start"] == pytest.approx(0.1)
    assert found["error_late"] < reached


@pytest.mark.slow
def test_the_clock_is_kept_or_overruns_are_told():
    """In real time, for which the machine must have nothing else to do."""
    found = told("--robot", "youbot", "--seconds", "0.3")
    assert found["ticks"] == 300
    assert 0 <= found["overruns"] <= 300
    assert 0.0 < found["step_median_us"] <= found["step_99th_us"]
