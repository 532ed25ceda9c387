"""Python code that a robot's file names runs for a run or a check of that robot, and not for a look."""

from __future__ import annotations

import json
import textwrap

import pytest
from support.variants import ROLLING, description, toml, youbot_urdf

import mobman as mm
from mobman.errors import SpecError
from mobman.robots import catalogue

CODE = 'open({marker!r}, "w").close()\n' + ROLLING
SUITE = """
schema = 1
name = "own"
duration = 0.02
seeds = [0]
[controllers.pseudo-inverse]
law = "pseudo-inverse"
[[groups]]
robots = ["{robot}"]
tasks = ["circle"]
scenarios = ["nominal"]
"""
OWN = """
import numpy as np
from dataclasses import dataclass


class Nothing:
    def reset(self, robot, task, dt):
        self.torque = np.zeros(robot.nz)

    def step(self, t, q, z, z_dot):
        return self.torque


class Point:
    def __init__(self, p):
        self.p = np.array(p)

    def desired(self, t):
        return self.p, 0 * self.p, 0 * self.p, 0 * self.p


def make_point(robot, q0):
    return Point(robot.tip_pose(q0).translation)
"""


@pytest.fixture(autouse=True)
def _nothing_registered(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})


@pytest.fixture
def robot(trap):
    """A robot's file that names code beside it."""
    text = textwrap.dedent(CODE).format(marker=str(trap.marker))
    (trap.folder / "mine.py").write_text(text, encoding="utf-8")
    (trap.folder / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    content = description("youbot", name="mine", urdf__path="mine.urdf")
    content["platform"] = {"type": "custom", "definition": "mine.py:Body"}
    path = trap.folder / "mine.toml"
    path.write_text(toml(content), encoding="utf-8")
    return path


@pytest.fixture
def users(robot, monkeypatch):
    """The same robot, added by the user: known by its name."""
    folder = robot.parent
    monkeypatch.setattr("mobman.robots.catalogue.user_robots_folder", lambda: folder)
    (folder / "evil.toml").unlink()
    return "mine"


@pytest.fixture
def record(robot, trap):
    """A record of a run of it; what was run until then does not count."""
    path = mm.simulate(robot, "pseudo-inverse", "circle", duration=0.02).save(
        trap.folder / "run.h5"
    )
    trap.marker.unlink()
    return path


def test_show_says_that_there_is_code_and_does_not_run_it(robot, users, mobman, harmless):
    for name in (robot, users):
        shown = mobman("robots", "show", name)
        assert shown.status == 0
        assert "the platform is Python code, mine.py:Body, which runs when" in shown.out
        as_json = json.loads(mobman("robots", "show", name, "--json").out)
        assert as_json["code"] == "mine.py:Body"
        assert as_json["platform"] == "custom"
        assert as_json["nz"] is None
        harmless(shown.out, shown.err)


def test_list_of_robots(users, mobman, harmless):
    done = mobman("robots")
    assert done.status == 0
    assert "mine" in done.out.split()
    rows = json.loads(mobman("robots", "--json").out)
    assert {row["code"] for row in rows if row["name"] == "mine"} == {"mine.py:Body"}
    assert {row["code"] for row in rows if row["name"] != "mine"} == {None}
    harmless(done.out, done.err)


def test_file_that_is_viewed(robot, mobman, harmless, tmp_path):
    done = mobman("view", robot, "--html", tmp_path / "page.html")
    assert done.status == 2
    assert "'mine.py:Body': Python code, which runs when the robot is loaded for a run" in done.err
    harmless(done.out, done.err)
    with pytest.raises(SpecError, match="not when it is only looked at"):
        mm.view(robot, html=tmp_path / "page.html")
    harmless()


def test_suite_that_is_shown(robot, trap, mobman, harmless):
    suite = trap.folder / "suite.toml"
    suite.write_text(SUITE.format(robot=robot), encoding="utf-8")
    done = mobman("bench", "show", suite)
    assert done.status == 2
    assert "not when it is only looked at" in done.err
    harmless(done.out, done.err)


def test_record_of_a_robot_that_is_not_registered(record, mobman, harmless, tmp_path):
    page = tmp_path / "page.html"
    shown, again = mobman("view", record, "--html", page), mobman("rerun", record)
    reason = "its platform is Python code, 'mine.py:Body', which the file does not hold"
    assert shown.status == 0
    assert f"'mine' is not drawn, only the paths: {reason}" in shown.err
    assert again.status == 1
    assert reason in again.err
    assert "--robot FILE" in again.err
    harmless(shown.out, shown.err, again.out, again.err)


def test_record_of_a_registered_robot(record, users, mobman, trap, tmp_path):
    shown = mobman("view", record, "--html", tmp_path / "page.html")
    assert shown.status == 0
    assert "not drawn" not in shown.err
    assert mobman("rerun", record, "--verify").status == 0
    assert trap.marker.exists()


def test_registered_robot_of_another_description(record, users, robot, mobman, harmless, tmp_path):
    text = robot.read_text(encoding="utf-8")
    robot.write_text(text.replace("mine.py:Body", "evil.py:Body"), encoding="utf-8")
    shown = mobman("view", record, "--html", tmp_path / "page.html")
    again = mobman("rerun", record)
    assert "register the robot 'mine' with the description of the run" in shown.err
    assert again.status == 1
    harmless(shown.err, again.err)


def test_robot_that_is_named_for_a_rerun(record, robot, mobman, trap):
    done = mobman("rerun", record, "--robot", robot, "--verify")
    assert done.status == 0, done.err
    assert "identical, bit for bit" in done.out
    assert trap.marker.exists()


def test_another_robot_that_is_named_for_a_rerun(record, mobman):
    done = mobman("rerun", record, "--robot", "husky_ur5")
    assert done.status == 1
    assert "cannot be repeated" in done.err


def test_law_and_task_that_are_named_for_a_rerun(trap, mobman, monkeypatch):
    (trap.folder / "code_of_the_owner.py").write_text(OWN, encoding="utf-8")
    monkeypatch.syspath_prepend(trap.folder)
    import code_of_the_owner

    youbot = mm.load_robot("youbot")
    path = mm.simulate(
        youbot,
        code_of_the_owner.Nothing(),
        code_of_the_owner.make_point(youbot, youbot.q_rest),
        duration=0.02,
    ).save(trap.folder / "run.h5")
    refused = mobman("rerun", path)
    assert refused.status == 1
    assert "Nothing, which is not registered" in refused.err
    law = ("--controller", "code_of_the_owner.py:Nothing")
    assert "its task is an object" in mobman("rerun", path, *law).err
    done = mobman("rerun", path, *law, "--task", "code_of_the_owner.py:make_point", "--verify")
    assert done.status == 0, done.err
    for wrong in ("code_of_the_owner.py", "code_of_the_owner.py:Missing", "none.py:Nothing"):
        failed = mobman("rerun", path, "--controller", wrong)
        assert failed.status == 2
        assert wrong in failed.err


def test_run_of_the_file(robot, mobman, trap):
    assert mobman("run", robot, "--duration", "0.02").status == 0
    assert trap.marker.exists()


def test_path_is_no_name_of_a_robot(record, robot, trap, harmless):
    """A record names its robot by a name; a path would be another way to a file."""
    with pytest.raises(SpecError, match="register the robot"):
        catalogue.registered_as({"name": str(robot), "platform": {"definition": "mine.py:Body"}})
    harmless()
