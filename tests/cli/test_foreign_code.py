"""Code of others that ends the process costs one line and exit status 1."""

from __future__ import annotations

import os
import sys

import pytest
from support.command_line import mobman, mobman_process

PLUGIN = """
from mobman.tasks.line import line


class Law:
    where = ""

    def __init__(self):
        self.leave("init")

    def leave(self, where):
        if where == self.where:
            raise SystemExit(0)

    def reset(self, robot, task, dt):
        self.leave("reset")

    def step(self, t, q, z, z_dot):
        self.leave("step")


class Init(Law):
    where = "init"


class Reset(Law):
    where = "reset"


class Step(Law):
    where = "step"


def task(robot, q0):
    raise SystemExit(0)


def robot():
    raise SystemExit(0)
"""
POINTS = """
[mobman.controllers]
ends-at-init = ends_plugin:Init
ends-at-reset = ends_plugin:Reset
ends-at-step = ends_plugin:Step
ends-at-import = ends_at_import:Law

[mobman.tasks]
ends-task = ends_plugin:task

[mobman.robots]
ends-robot = ends_plugin:robot
"""


@pytest.fixture(autouse=True)
def plugin(tmp_path, monkeypatch):
    """A package is installed whose code ends the process, in every way."""
    (tmp_path / "ends_plugin.py").write_text(PLUGIN, encoding="utf-8")
    (tmp_path / "ends_at_import.py").write_text("raise SystemExit(0)", encoding="utf-8")
    metadata = tmp_path / "ends_plugin-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: ends-plugin\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(POINTS, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv("MOBMAN_DEBUG", raising=False)
    yield tmp_path
    sys.modules.pop("ends_plugin", None)


@pytest.mark.parametrize("where", ["init", "reset", "step"])
def test_law_that_ends_the_process(where):
    done = mobman("run", "youbot", "--controller", f"ends-at-{where}", "--duration", "0.01")
    assert (done.returncode, done.stdout) == (1, "")
    assert "SystemExit: 0" in done.stderr
    assert done.stderr.count("\n") == 1


def test_task_that_ends_the_process(plugin):
    paths = os.pathsep.join([str(plugin), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = mobman_process(
        *("run", "youbot", "--task", "ends-task", "--duration", "0.01"),
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "SystemExit: 0" in done.stderr


def test_law_whose_package_ends_the_process():
    done = mobman("run", "youbot", "--controller", "ends-at-import", "--duration", "0.01")
    warning, error = done.stderr.splitlines()
    assert done.returncode == 2
    assert "'ends-at-import' of ends_at_import:Law is left out: SystemExit(0)" in warning
    assert "unknown controller 'ends-at-import'" in error


def test_listing_goes_on_without_a_robot_that_ends_the_process():
    done = mobman("robots")
    assert done.returncode == 0
    assert "youbot" in done.stdout
    assert done.stderr.count("'ends-robot' of ends_plugin:robot is left out: SystemExit(0)") == 1
