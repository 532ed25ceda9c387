"""Every broken input is refused by the real command line: one line, the reason, nothing left behind."""

from __future__ import annotations

import broken_descriptions
import broken_urdfs
import pytest
from cases import Case, descriptions, meshes, urdfs
from command_line import COMMANDS, Outcome, call, call_alone, contents
from good_robot import GoodRobot

import mobman as mm
from mobman.errors import MobmanError
from mobman.model.build import load_geometry

assert broken_descriptions.case is not None
assert broken_urdfs.case is not None

CASES = {**urdfs, **descriptions, **meshes}
ALONE = (
    "urdf_is_binary",
    "urdf_of_a_billion_laughs",
    "three_problems_at_once",
    "toml_is_huge",
    "both_urdf_and_body",
    "tip_that_is_not_there",
)


@pytest.fixture
def robot(tmp_path, monkeypatch) -> GoodRobot:
    """The good robot, in a folder that is the working directory."""
    monkeypatch.chdir(tmp_path)
    return GoodRobot(tmp_path)


def check_refusal(case: Case, outcome: Outcome, command: str = "") -> None:
    """One line on stderr that says what is wrong, nothing on stdout, exit status 2."""
    assert outcome.status == 2, outcome
    assert outcome.output == ""
    assert outcome.errors.count("\n") == 1, outcome.errors
    assert outcome.errors.startswith("mobman: ")
    assert "Traceback" not in outcome.errors
    assert "internal error" not in outcome.errors
    assert len(outcome.errors) < 2000
    assert outcome.errors.count("the URDF ") <= 1  # not a message in a message
    for word in case.words_of(command):
        assert word in outcome.errors


def test_there_are_enough_cases():
    assert len(CASES) == len(urdfs) + len(descriptions) + len(meshes) > 100
    assert all(case.words for case in CASES.values())


@pytest.mark.parametrize("command", COMMANDS)
def test_the_good_robot_is_not_refused(robot, command, capfd, monkeypatch):
    outcome = call(COMMANDS[command].arguments(robot), capfd, monkeypatch)
    assert (outcome.status, outcome.errors) == (0, "")
    assert outcome.output


def test_the_good_robot_has_its_geometry(robot, capfd):
    geometry = load_geometry(mm.load_robot(robot.toml))
    assert len(geometry.visual.geometryObjects) == 2
    assert len(geometry.collision.geometryObjects) == 5
    assert capfd.readouterr() == ("", "")


def test_the_good_robot_can_carry_a_mount(robot, capfd):
    robot.mount()
    assert "boom_pan" in mm.load_robot(robot.toml).joint_names
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("command", "name"),
    [(command, name) for command in COMMANDS for name in COMMANDS[command].cases()],
)
def test_broken_input_is_refused(robot, command, name, capfd, monkeypatch):
    case = CASES[name]
    case.break_it(robot)
    before = contents(robot.folder)
    check_refusal(case, call(COMMANDS[command].arguments(robot), capfd, monkeypatch), command)
    assert contents(robot.folder) == before


@pytest.mark.parametrize("name", ALONE)
def test_broken_input_is_refused_by_a_process_of_its_own(robot, name):
    case = CASES[name]
    case.break_it(robot)
    before = contents(robot.folder)
    check_refusal(case, call_alone(COMMANDS["show"].arguments(robot), robot.folder))
    assert contents(robot.folder) == before


@pytest.mark.parametrize("name", meshes)
def test_broken_mesh_is_refused_when_the_robot_is_to_be_seen(robot, name, capfd):
    case = meshes[name]
    case.break_it(robot)
    before = contents(robot.folder)
    loaded = mm.load_robot(robot.toml)  # the equations need no meshes
    with pytest.raises(MobmanError) as caught:
        load_geometry(loaded)
    message = " ".join(str(caught.value).split())
    check_refusal(case, Outcome(caught.value.exit_status, "", f"mobman: {message}\n"))
    assert capfd.readouterr() == ("", "")
    assert contents(robot.folder) == before
