"""A platform whose A and N the user writes in Python."""

from __future__ import annotations

import textwrap

import numpy as np
import pytest
from support.differences import relative
from support.states import random_states
from support.variants import description

import mobman as mm
from mobman.errors import SpecError

# The paper's platform with wheel rates, (2) and (7) with a = 0, as a user would type it.
OWN = """
import numpy as np


class Paper:
    coordinates = ("base_x", "base_y", "base_theta", "phi_1", "phi_2")
    velocity_names = ("right", "left")
    R, W = 0.05, 0.158

    def __init__(self, height=0.05):
        self.root_offset = (0.0, 0.0, height)

    def constraint_matrix(self, x):
        c, s, R, W = np.cos(x[2]), np.sin(x[2]), self.R, self.W
        return np.array([[s, -c, 0, 0, 0], [c, s, W, -R, 0], [c, s, -W, 0, -R]])

    def velocity_map(self, x):
        c, s, h = np.cos(x[2]), np.sin(x[2]), self.R / 2
        turn = h / self.W
        return np.array([[h * c, h * c], [h * s, h * s], [turn, -turn], [1, 0], [0, 1]])

    def actuation(self, x):
        return np.array([[0, 0], [0, 0], [0, 0], [1, 0], [0, 1]])


class Wheeled(Paper):
    wheels = [("phi_1", 0.05), ("phi_2", 0.05)]


class WrongShape(Paper):
    velocity_names = ("v", "omega", "more")


class BreaksConstraints(Paper):
    def velocity_map(self, x):
        return super().velocity_map(x) + 0.1


class Raises(Paper):
    def constraint_matrix(self, x):
        raise RuntimeError("not today")


class ElsewhereJoints(Paper):
    coordinates = ("base_x", "base_y", "base_theta", "phi_1", "phi_9")


class NoBase(Paper):
    coordinates = ("phi_1", "base_x", "base_y", "base_theta", "phi_2")


class Empty:
    pass


class NoConstraints(Paper):
    def constraint_matrix(self, x):
        return np.zeros((3, 5))


class WrongActuation(Paper):
    def actuation(self, x):
        return np.eye(5)


class ShortOffset(Paper):
    def __init__(self):
        self.root_offset = (1.0, 2.0)


class WrongHeading(Paper):
    heading = "north"


class EndlessHeading(Paper):
    heading = float("nan")


class JointTwice(Paper):
    coordinates = ("base_x", "base_y", "base_theta", "phi_1", "phi_1")


class NoJoint(Paper):
    coordinates = ("base_x", "base_y", "base_theta", "phi_1", "universe")


class NamesOfNumbers(Paper):
    velocity_names = (1, 2)


class WheelsWithoutRadius(Paper):
    wheels = [("phi_1",)]


class WheelsElsewhere(Paper):
    wheels = [("phi_9", 0.1)]


class LeavesWhenCalled(Paper):
    def __init__(self):
        raise SystemExit(3)


class LeavesInAProperty(Paper):
    @property
    def wheels(self):
        raise SystemExit(3)


class LeavesInItsCoordinates(Paper):
    @property
    def coordinates(self):
        raise SystemExit(3)


class LeavesInAFunction(Paper):
    def velocity_map(self, x):
        raise SystemExit(3)


class LeavesLater(Paper):
    def velocity_map(self, x):
        if x[0] > -0.39 and x[0] < 0.0:  # on the way, not at rest and not where it is checked
            raise SystemExit(3)
        return super().velocity_map(x)


class Interrupted(Paper):
    def velocity_map(self, x):
        raise KeyboardInterrupt
"""
MODERN = """
from __future__ import annotations

from dataclasses import dataclass

from own import Paper


@dataclass
class Modern(Paper):
    height: float = 0.05

    def __post_init__(self):
        self.root_offset = (0.0, 0.0, self.height)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("custom")
    (folder / "own.py").write_text(textwrap.dedent(OWN), encoding="utf-8")
    (folder / "broken.py").write_text("import no_such_module_at_all", encoding="utf-8")
    (folder / "leaves.py").write_text("raise SystemExit(0)", encoding="utf-8")
    (folder / "modern.py").write_text(textwrap.dedent(MODERN), encoding="utf-8")
    (folder / "youbot.urdf").write_bytes((description()["folder"] / "youbot.urdf").read_bytes())
    return folder


def _custom(folder, definition, **platform):
    content = description()
    return {
        **content,
        "folder": folder,
        "platform": {"type": "custom", "definition": definition, **platform},
    }


def test_another_wheel_of_python_code_is_refused(folder):
    robot = mm.load_robot(_custom(folder, "own.py:Wheeled"))
    wheels = mm.Scenario(name="s", kinematics=[{"type": "wheels", "radius": 1.1}])
    with pytest.raises(SpecError, match=r"no field 'wheel_radius'.*true robot as the run's plant"):
        mm.simulate(robot, "pseudo-inverse", "circle", duration=0.01, scenario=wheels)


def test_custom_platform_is_the_built_in_one(folder):
    """Everything, the numerical derivatives included, agrees with the closed forms."""
    own = mm.load_robot(_custom(folder, "own.py:Paper"))
    built_in = mm.load_robot(description(platform__alpha="wheel-rates"))
    assert own.velocity_names[:2] == ["right", "left"]
    random = np.random.default_rng(2)
    for q, z in random_states(own, 20):
        q_dot, multiplier = own.velocity_map(q) @ z, random.standard_normal(3)
        for name, arguments in {
            "constraint_matrix": (q,),
            "constraint_matrix_rate": (q, q_dot),
            "constraint_hessian": (q, multiplier),
            "constraint_hessian_rate": (q, q_dot, multiplier),
            "velocity_map": (q,),
            "velocity_map_rate": (q, z),
            "actuation": (q,),
        }.items():
            found, expected = getattr(own, name)(*arguments), getattr(built_in, name)(*arguments)
            assert relative(found, expected) < 1e-11, name
        assert relative(own.dynamics(q, z).M, built_in.dynamics(q, z).M) < 1e-12


def test_closed_loop_is_that_of_the_built_in_platform(folder):
    """With the wheels named: the criterion gives those another weight than other coordinates."""
    contents = _custom(folder, "own.py:Wheeled"), description(platform__alpha="wheel-rates")
    robots = [mm.load_robot(content) for content in contents]
    assert np.array_equal(robots[0].criterion_weights, robots[1].criterion_weights)
    assert not np.array_equal(
        mm.load_robot(_custom(folder, "own.py:Paper")).criterion_weights,
        robots[0].criterion_weights,
    )
    records = [mm.simulate(robot, "tsm", "circle", duration=0.2) for robot in robots]
    assert np.allclose(records[0].q, records[1].q, atol=1e-9)


def test_commands_are_by_default_the_forces_of_alpha(folder, monkeypatch):
    (folder / "plain.py").write_text(
        "from own import Paper as Base\nclass Plain:\n"
        "    coordinates, velocity_names = Base.coordinates, Base.velocity_names\n"
        "    root_offset = (0, 0, 0.05)\n"
        "    constraint_matrix = lambda self, x: Base().constraint_matrix(x)\n"
        "    velocity_map = lambda self, x: Base().velocity_map(x)\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(folder)
    robot = mm.load_robot(_custom(folder, "plain.py:Plain"))
    for q, z in random_states(robot, 5):
        assert np.allclose(robot.dynamics(q, z).B, np.eye(robot.nz), atol=1e-12)


def test_options_are_given_to_the_class(folder):
    robot = mm.load_robot(_custom(folder, "own.py:Paper", options={"height": 0.3}))
    assert np.isclose(robot.platform.root_offset[2], 0.3)


def test_definition_may_be_a_dataclass(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    robot = mm.load_robot(_custom(folder, "modern.py:Modern", options={"height": 0.2}))
    assert np.isclose(robot.platform.root_offset[2], 0.2)


@pytest.mark.parametrize(
    ("definition", "words"),
    [
        ("own.py", "definition"),
        ("nothing.py:Paper", "there is no file"),
        ("own.py:Nobody", "has no 'Nobody'"),
        ("broken.py:Paper", "no_such_module_at_all"),
        ("no_such_package.module:Paper", "no_such_package"),
        ("own.py:WrongShape", r"shape \(3, 5\); needed: \(2, 5\)"),
        ("own.py:BreaksConstraints", "is not 0"),
        ("own.py:Raises", "not today"),
        ("own.py:ElsewhereJoints", "'phi_9' is no movable joint"),
        ("own.py:NoBase", "the first three"),
        ("own.py:Empty", "needs coordinates"),
        ("own.py:NoConstraints", "rows of A"),
        ("own.py:WrongActuation", r"actuation gives shape \(5, 5\); needed: \(5, 2\)"),
        ("own.py:ShortOffset", "root_offset"),
        ("own.py:WrongHeading", "heading"),
        ("own.py:WheelsWithoutRadius", "wheels"),
        ("own.py:WheelsElsewhere", "phi_9"),
        ("own.py:EndlessHeading", "heading nan; needed: .* a finite angle"),
        ("own.py:JointTwice", r"joint 'phi_1' is there twice"),
        ("own.py:NoJoint", "'universe' is no movable joint"),
        ("own.py:NamesOfNumbers", r"velocity_names are \(1, 2\); needed: different names"),
        ("a\0b.py:Paper", "there is no file"),
        ("leaves.py:Paper", "SystemExit"),
        ("own.py:LeavesWhenCalled", r"calling it failed: SystemExit\(3\)"),
        ("own.py:LeavesInAProperty", r"reading its attributes failed: SystemExit\(3\)"),
        ("own.py:LeavesInItsCoordinates", r"reading its attributes failed: SystemExit\(3\)"),
        ("own.py:LeavesInAFunction", r"velocity_map failed: SystemExit\(3\)"),
    ],
)
def test_wrong_definitions_are_refused(folder, definition, words):
    with pytest.raises(SpecError, match=words) as caught:
        mm.load_robot(_custom(folder, definition))
    assert "platform" in str(caught.value)


def test_wrong_options_are_refused(folder):
    with pytest.raises(SpecError, match=r"calling it failed.*colour"):
        mm.load_robot(_custom(folder, "own.py:Paper", options={"colour": "red"}))


def test_interruption_goes_through(folder):
    with pytest.raises(KeyboardInterrupt):
        mm.load_robot(_custom(folder, "own.py:Interrupted"))


def test_platform_that_ends_the_process_in_a_run_is_reported(folder):
    robot = mm.load_robot(_custom(folder, "own.py:LeavesLater"))
    with pytest.raises(mm.MobmanError, match=r"at t = .* s: the code of .* \(SystemExit: 3\)"):
        mm.simulate(robot, "tsm", "circle", duration=2.0)
