"""Another package's things, found by their entry points: a small one, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]

CODE = '''
"""Everything that a package can bring."""

import numpy as np
from pathlib import Path

from mobman.controllers.baselines import PseudoInverse
from mobman.model.build import load_robot
from mobman.model.joint_limits import JointLimitAvoidance
from mobman.model.platforms.differential import Differential
from mobman.simulation.metrics import metric
from mobman.simulation.pieces import Piece

SUITE = Path(__file__).parent / "tiny_suite.toml"
MISSING = Path(__file__).parent / "missing.toml"


class Knock(Piece):
    torque: float

    def start(self, setting):
        return lambda t: np.full(setting.robot.nz, self.torque)


class Stuck(Piece):
    def start(self, setting):
        raise AssertionError("never asked for")


class TinyPlatform(Differential):
    pass


class TinyTerm(JointLimitAvoidance):
    pass


class TinyLaw(PseudoInverse):
    name = "tiny-law"


class Up:
    def __init__(self, robot, q0, height):
        self.p_d = robot.tip_pose(q0).translation + [0.0, 0.0, height]

    def desired(self, t):
        return self.p_d, *np.zeros((3, 3))


def up(robot, q0, height: float = 0.1):
    return Up(robot, q0, height)


def tiny_bot():
    return load_robot("youbot").spec.model_copy(update={"name": "tiny-bot"})


@metric("tiny_error", "m", "largest |e_x|")
def tiny_error(run):
    return np.abs(run.task_error[:, 0]).max()


@metric("tiny_fault", "m", "never")
def tiny_fault(run):
    raise RuntimeError("as bugs do")
'''

POINTS = """
[mobman.metrics]
tiny_error = tiny:tiny_error
tiny_fault = tiny:tiny_fault
tiny_lost = tiny:no_such_thing

[mobman.disturbances]
tiny-knock = tiny:Knock

[mobman.platforms]
tiny-base = tiny:TinyPlatform

[mobman.criteria]
tiny-term = tiny:TinyTerm

[mobman.controllers]
tiny-law = tiny:TinyLaw

[mobman.tasks]
tiny-task = tiny:up

[mobman.robots]
tiny-bot = tiny:tiny_bot

[mobman.suites]
tiny = tiny:SUITE
tiny-missing = tiny:MISSING
"""

SUITE = """
schema = 1
name = "tiny"
description = "of a package"
duration = 0.02
[controllers.pseudo-inverse]
law = "pseudo-inverse"
[[groups]]
robots = ["youbot"]
tasks = ["circle"]
"""

SCRIPT = """
import math, sys, warnings
import numpy as np
import mobman as mm

assert "tiny" not in sys.modules
assert {"tiny", "tiny-missing"} <= set(mm.list_suites())
assert "tiny" not in sys.modules  # listed without being loaded
assert mm.load_suite("tiny").size() == 1

spec = mm.load_robot("youbot").spec
platform = spec.platform.model_copy(update={"type": "tiny-base"})
robot = mm.load_robot(spec.model_copy(update={"name": "tiny_robot", "platform": platform}))
assert type(robot.platform).__name__ == "TinyPlatform"

knocked = mm.Scenario(name="knocked", disturbances=[{"type": "tiny-knock", "torque": 2.0}])
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    runs = [mm.simulate(robot, "pseudo-inverse", "paper", duration=0.02, scenario=s)
            for s in (None, knocked)]
texts = sorted({str(item.message) for item in said})
assert len(texts) == 2, texts
assert "metric 'tiny_fault' is NaN" in texts[0], texts
assert "metric 'tiny_lost' of tiny:no_such_thing is left out" in texts[1], texts
for record in runs:
    assert record.metrics["tiny_error"] == np.abs(record.task_error[:, 0]).max()
    assert math.isnan(record.metrics["tiny_fault"])
    assert "tiny_lost" not in record.metrics
assert not np.array_equal(runs[0].q, runs[1].q)

assert "tiny-bot" in mm.list_robots() and "tiny-law" in mm.list_controllers()
term = {"type": "tiny-term", "weight": 50.0, "zone": 0.5}  # of every posture
warnings.simplefilter("ignore")
pulled, plain = [
    mm.simulate("tiny-bot", mm.make_controller("tiny-law", criteria=terms),
                mm.make_task("tiny-task", "tiny-bot", height=0.05), duration=0.02)
    for terms in ([term], [])]
assert pulled.robot == "tiny-bot" and pulled.spec["law"] == "tiny-law"
assert np.allclose(pulled.tip_desired[0] - pulled.tip_position[0], [0.0, 0.0, 0.05])
assert not np.array_equal(pulled.q, plain.q)
try:
    mm.make_controller("tiny-law", criteria=[{"type": "tiny-turm", "weight": 1.0}])
except mm.MobmanError as error:
    assert "did you mean 'tiny-term'" in str(error), error
else:
    raise AssertionError
"""


def test_everything_that_a_package_can_bring_is_found(tmp_path):
    info = tmp_path / "tiny-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tiny\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(POINTS)
    (tmp_path / "tiny.py").write_text(CODE)
    (tmp_path / "tiny_suite.toml").write_text(SUITE)
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    for command in (["-c", SCRIPT], ["-m", "mobman", "bench", "list"]):
        done = subprocess.run(
            [sys.executable, *command],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    # one broken suite hides no other
    assert "tiny      " in done.stdout
    assert "of a package" in done.stdout
    assert "tiny-missing is left out" in done.stderr
