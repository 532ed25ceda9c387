"""How the tests infer: a URDF in a folder of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from mobman.robots.infer.findings import Options
from mobman.robots.infer.infer import infer
from mobman.robots.urdf.read import UrdfFile


@pytest.fixture
def inferred(tmp_path):
    """A function from a made robot and options to what is inferred of it."""

    def run(robot, packages=(), **options):
        path = robot.write(tmp_path / "robot.urdf")
        return infer(UrdfFile(path, (*map(Path, packages), tmp_path)), Options(**options))

    return run
