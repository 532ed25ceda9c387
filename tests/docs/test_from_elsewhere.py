"""``docs/examples/from_elsewhere.sh``: robots of other packages, as they ship, are added and run."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mobman as mm

SCRIPT = Path(__file__).parents[2] / "docs" / "examples" / "from_elsewhere.sh"
ROBOTS = dict(re.findall(r"^robot (\S+) (\S+)", SCRIPT.read_text(encoding="utf-8"), re.MULTILINE))
THERE = [n for n, p in ROBOTS.items() if p == "example-robot-data" or importlib.util.find_spec(p)]


def run(folder, *names, seconds, status=0):
    package = str(Path(mm.__file__).parents[1])
    inherited = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        ["bash", str(SCRIPT), str(folder), *names],
        env={
            **os.environ,
            "PYTHON": sys.executable,
            "PYTHONPATH": os.pathsep.join(inherited),
            "SECONDS_EACH": str(seconds),
        },
        capture_output=True,
        encoding="utf-8",
        timeout=1800,
        check=False,
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stderr


def test_there_are_eight_of_three_packages():
    assert len(ROBOTS) == 8
    assert len(set(ROBOTS.values())) == 3


def test_a_robot_is_added_and_run(tmp_path):
    """The pr2, whose wheels are fixed in its URDF and whose arms are two."""
    run(tmp_path, "pr2", seconds=0.2)
    record = mm.load_record(tmp_path / "pr2.h5")
    assert (record.robot, record.status) == ("pr2", "ok")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pr2.h5", "pr2.toml"]


def test_a_package_that_is_not_there_is_named(tmp_path):
    missing = [name for name in ROBOTS if name not in THERE]
    if not missing:
        pytest.skip("all of them are installed")
    said = run(tmp_path, missing[0], seconds=0.2, status=1)
    assert f"{missing[0]}: the package {ROBOTS[missing[0]]} is not installed" in said


@pytest.mark.slow
def test_every_robot_that_is_there_follows_the_circle(tmp_path):
    run(tmp_path, *THERE, seconds=10.0)
    for name in THERE:
        record = mm.load_record(tmp_path / f"{name}.h5")
        assert record.ok, name
        assert np.linalg.norm(record.task_error[-1000:], axis=1).max() < 1e-4, name
