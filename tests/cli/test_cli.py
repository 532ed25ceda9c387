"""The command line: what it prints, where, and its exit status."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from support.command_line import mobman, mobman_process
from support.suites import small_suite

import mobman as mm
from mobman.controllers.protocol import controllers
from mobman.tasks.task import tasks


def test_version():
    done = mobman_process("--version")
    assert done.returncode == 0
    assert done.stdout == f"mobman {mm.__version__}\n"


def test_robots_lists_every_robot():
    done = mobman("robots")
    assert done.returncode == 0
    assert all(name in done.stdout for name in mm.list_robots())


def test_robots_as_json():
    rows = json.loads(mobman("robots", "--json").stdout)
    assert [row["name"] for row in rows] == mm.list_robots()
    youbot = next(row for row in rows if row["name"] == "youbot")
    assert (youbot["nq"], youbot["nz"], youbot["arm_joints"]) == (8, 5, 3)


def test_robots_show():
    done = mobman("robots", "show", "youbot")
    assert done.returncode == 0
    assert "phi_1" in done.stdout
    content = json.loads(mobman("robots", "show", "youbot", "--json").stdout)
    assert [joint["name"] for joint in content["joints"]][:3] == ["base_x", "base_y", "base_theta"]
    # JSON has no word for an unbounded joint
    assert content["joints"][0]["upper"] is None


def test_run_writes_the_record_and_says_so(tmp_path):
    path = tmp_path / "run.h5"
    done = mobman("run", "youbot", "--duration", "0.05", "--task", "paper", "-o", str(path))
    assert done.returncode == 0, done.stderr
    assert "|e^e| at the end" in done.stdout
    record = mm.load_record(path)
    assert (record.robot, record.controller, record.task) == ("youbot", "tsm", "paper")
    assert record.scenario == "nominal"
    # not in the first tick: gains that bear torques a tick late come to the torque over a few ticks
    beyond = "y_2 reached 1.07 times its torque limit at t = 0.004 s"
    assert f"beyond its limits: {beyond}" in done.stdout
    assert "no success: it went to its end, but |e^e| is " in done.stdout
    again = mobman("rerun", str(path))
    assert again.returncode == 0, again.stderr
    told = [line for line in done.stdout.splitlines() if line.startswith(("beyond", "no success"))]
    assert told == [
        line for line in again.stdout.splitlines() if line.startswith(("beyond", "no success"))
    ]


def test_a_law_that_does_not_know_that_its_torques_were_cut_says_what_does():
    words = ("run", "tiago_no_hand", "--scenario", "real-limits", "--duration", "0.6")
    done = mobman(*words)
    assert "torques were cut in" in done.stdout
    assert done.stdout.rstrip().endswith("--gain saturation=hedge")
    assert "torques were cut" not in mobman(*words, "--gain", "saturation=hedge").stdout


def test_run_as_json_with_gains():
    done = mobman(
        "run", "youbot", "--duration", "0.05", "--gain", "a=0.2", "--gain",
        "discretization=explicit", "--seed", "3", "--json",
    )  # fmt: skip
    content = json.loads(done.stdout)
    assert content["settings"]["a"] == 0.2
    assert content["settings"]["discretization"] == "explicit"
    assert content["spec"]["seed"] == 3
    assert content["metrics"]["settling_time_1e-4"] is None


def test_diverged_run_is_written_and_exits_with_1(tmp_path):
    path = tmp_path / "run.h5"
    done = mobman(
        "run", "youbot", "--duration", "2", "--dt", "0.01", "--gain", "discretization=explicit",
        "--gain", "a=1e-3", "-o", str(path),
    )  # fmt: skip
    assert done.returncode == 1
    assert "diverged at t =" in done.stderr
    assert mm.load_record(path).status == "diverged"


@pytest.mark.parametrize(
    ("arguments", "nearest"),
    [
        (("run", "yuobot"), "youbot"),
        (("robots", "show", "tiagoo"), "tiago"),
        (("run", "youbot", "--controller", "tms"), "tsm"),
        (("run", "youbot", "--task", "circel"), "circle"),
        (("run", "youbot", "--scenario", "havier"), "heavier"),
        (("run", "youbot", "--gain", "lambda_9=1"), "lambda_0"),
        (("bench", "run", "papper"), "paper"),
        (("run", "youbot", "--contoller", "tsm"), "--controller"),
        (("bnech",), "bench"),
    ],
)
def test_misspelt_names_get_one_line_and_status_2(arguments, nearest):
    done = mobman(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert nearest in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("run", "youbot", "--gain", "c=0.5"), "at least 1 (Theorem 1)"),
        (("run", "youbot", "--gain", "a=0"), "must be above 0"),
        (("run", "youbot", "--gain", "a"), "is not NAME=VALUE"),
        (("run", "youbot", "--duration", "-1"), "duration = -1.0"),
        (("run", "youbot", "--duration", "ten"), "--duration"),
        (("run", "missing.toml"), "cannot read the robot file missing.toml"),
        (("run",), "ROBOT"),
        (("run", "youbot", "--gain", f"a={'9' * 5000}"), "a = '9999"),
        (("bench", "run", "paper", "--workers", "0"), "--workers"),
        (
            ("bench", "run", "paper", "--part", "3/2"),
            "'3/2' is no part: give K/N with K from 1 to N",
        ),
        (("view", "youbot", "--scale", "2"), "give --png FILE, too"),
        (("view", "youbot", "--png", "x.png", "--size", "0x0"), "size = 0x0: allowed: 16x16 to"),
        (("robots", "--json", "show", "youbot"), "put --json behind 'show'"),
        (("robots", "add", "x.xacro", "--xacro-arg", "a"), "'a' is not NAME:=VALUE"),
        (
            ("robots", "add", "x.urdf", "--on", "base"),
            "--mount is given 0 times, --on 1 and --prefix",
        ),
        (
            ("robots", "add", "x.urdf", "--heading", "90"),
            "--heading is 90.0; allowed: a finite angle",
        ),
    ],
)
def test_wrong_values_get_one_line_and_status_2(arguments, reason):
    done = mobman(*arguments)
    assert done.returncode == 2
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1


def test_unwritable_record_is_told_before_nothing_is_lost(tmp_path):
    (tmp_path / "file").write_text("")
    done = mobman("run", "youbot", "--duration", "0.02", "-o", str(tmp_path / "file" / "run.h5"))
    assert done.returncode == 1
    assert "cannot write the record" in done.stderr


def test_help_without_arguments():
    done = mobman()
    assert done.returncode == 2
    assert "bench" in done.stderr


def test_bench_list():
    assert "paper" in mobman("bench", "list").stdout
    rows = json.loads(mobman("bench", "list", "--json").stdout)
    assert next(row for row in rows if row["name"] == "paper")["runs"] == 168


def test_bench_run_and_report(tmp_path):
    folder = tmp_path / "results"
    done = mobman("bench", "run", str(small_suite(tmp_path)), "-o", str(folder), "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert "[8/8]" in done.stderr
    assert "8 runs: 0 were there, 8 done" in done.stdout
    report = folder / "report.html"
    first = report.read_text()
    assert "damped" in first
    report.unlink()
    again = mobman("bench", "report", str(folder))
    assert again.returncode == 0
    assert str(report) in again.stdout
    assert report.is_file()


def test_a_part_that_has_no_run_says_how_the_parts_are_joined(tmp_path):
    suite = small_suite(tmp_path)
    done = mobman("bench", "run", suite, "--part", "9/9", "-o", tmp_path / "part")
    assert done.returncode == 0, done.stderr
    assert "0 runs: 0 were there" in done.stdout
    assert f"part 9 of 9 is in {tmp_path / 'part'}; the parts are joined by" in done.stdout
    assert "youbot · circle · nominal · damped" in mobman("bench", "show", suite, "--runs").stdout
    (tmp_path / "part" / "runs").mkdir(exist_ok=True)
    run_id = json.loads(mobman("bench", "show", suite, "--json").stdout)["runs"][0]["run_id"]
    (tmp_path / "part" / "runs" / f"{run_id}.h5").write_bytes(b"x")
    merged = mobman("bench", "merge", tmp_path / "part", "-o", tmp_path / "all")
    assert merged.returncode == 1
    assert f"left out: {tmp_path / 'part' / 'runs' / run_id}.h5 is not a readable" in merged.stderr


def test_report_of_nothing_is_refused(tmp_path):
    done = mobman("bench", "report", str(tmp_path))
    assert done.returncode == 1
    assert "holds no results" in done.stderr


def test_a_reader_that_has_enough_is_no_error():
    """Tables are printed by rich, JSON is not."""
    command = (
        f'for arguments in robots "robots --json"; do {sys.executable} -m mobman $arguments | true; '
        "[ ${PIPESTATUS[0]} = 0 ] || exit 1; done"
    )
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert done.stderr == ""


def test_names_with_brackets_are_printed_as_they_are(tmp_path):
    path = tmp_path / "run[b].h5"
    done = mobman("run", "youbot", "--duration", "0.02", "-o", str(path))
    assert f"record: {path}" in done.stdout


OWN = """
from dataclasses import dataclass
import numpy as np

class Push:
    name = "push"

    @dataclass(frozen=True)
    class Gains:
        torque: float = 1.0

    def __init__(self, gains):
        self.gains = gains

    def reset(self, robot, task, dt):
        self.nz = robot.nz

    def step(self, t, q, z, z_dot):
        return np.full(self.nz, self.gains.torque)

class Stay:
    def __init__(self, robot, q0):
        self.at = robot.tip_pose(q0).translation.copy()

    def desired(self, t):
        return self.at, *np.zeros((3, 3))

def stay(robot, q0, above: float = 0.0):
    task = Stay(robot, q0)
    task.at[2] += above
    return task
"""


BROKEN = """

class Broken(Push):
    def reset(self, robot, task, dt):
        self.space  # line 36

class Odd(Push):
    def step(self, t, q, z, z_dot):
        return np.linalg.solve(np.eye(3), np.ones(4))  # line 40

class Needy:
    def __init__(self, gain):
        pass

number = 5
"""


@pytest.mark.parametrize(
    ("law", "place"),
    [("Broken", "line 36, in reset: AttributeError"), ("Odd", "line 40, in step: ValueError")],
)
def test_an_error_of_ones_own_file_is_told_with_its_line(tmp_path, monkeypatch, law, place):
    """Also where a library raises it that the file calls."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(controllers, "_items", dict(controllers._items))
    (tmp_path / "mine.py").write_text(OWN + BROKEN, encoding="utf-8")
    done = mobman("run", "youbot", "--controller", f"mine.py:{law}", "--duration", "0.01")
    assert done.returncode == 1
    assert done.stderr.startswith(f"mobman: error in {tmp_path / 'mine.py'}, {place}: ")
    assert done.stderr.endswith("(-v prints the traceback)\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("option", "name", "reason"),
    [
        ("controller", "number", "cannot be made of its gains: 5 is not a callable object"),
        ("controller", "Needy", "cannot be made of its gains: missing a required argument: 'gain'"),
        ("task", "number", "cannot be made of a robot and q0: 5 is not a callable object"),
        ("task", "Needy", "cannot be made of a robot and q0: too many positional arguments"),
    ],
)
def test_what_cannot_be_made_of_ones_own_file_is_told(tmp_path, monkeypatch, option, name, reason):
    monkeypatch.chdir(tmp_path)
    for registry in (controllers, tasks):
        monkeypatch.setattr(registry, "_items", dict(registry._items))
    (tmp_path / "mine.py").write_text(OWN + BROKEN, encoding="utf-8")
    done = mobman("run", "youbot", f"--{option}", f"mine.py:{name}", "--duration", "0.01")
    assert done.returncode == 2
    assert done.stderr == f"mobman: {option} 'mine.py:{name}' {reason}\n"


def test_a_law_and_a_task_of_ones_own_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(controllers, "_items", dict(controllers._items))
    monkeypatch.setattr(tasks, "_items", dict(tasks._items))
    (tmp_path / "mine.py").write_text(OWN, encoding="utf-8")
    law, task = ("--controller", "mine.py:Push"), ("--task", "mine.py:stay")
    given = ("--gain", "torque=0.5", "--task-option", "above=0.1")
    arguments = ("run", "youbot", *law, *task, "--duration", "0.01", "-o", "run.h5")
    done = mobman(*arguments, *given)
    assert done.returncode == 0, done.stderr
    record = mm.load_record("run.h5")
    assert (record.controller, record.torque[3].tolist()) == ("push", [0.5] * 5)
    assert record.task_error[0] == pytest.approx([0.0, 0.0, -0.1])
    done = mobman("rerun", "run.h5", "--verify", *task)
    assert "--controller FILE.py:NAME" in done.stderr
    done = mobman("rerun", "run.h5", "--verify", *law, *task)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "identical, bit for bit" in done.stdout
    for wrong, reason in {"mine.py:Pull": "Pull", "none.py:Push": "none.py"}.items():
        done = mobman("run", "youbot", "--controller", wrong)
        assert done.returncode != 0
        assert reason in done.stderr
        assert len(done.stderr.splitlines()) == 1
