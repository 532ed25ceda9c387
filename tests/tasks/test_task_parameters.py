"""Parameters of tasks: what is allowed, and what is said where it is not."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
import pytest
from click.testing import CliRunner

import mobman as mm
from mobman.cli.run import run
from mobman.errors import UnknownNameError, UsageError
from mobman.tasks.task import (
    check_parameters,
    make_task,
    parameter,
    parameters_of,
    task_parameters,
    tasks,
)

if TYPE_CHECKING:
    from nowhere import Unknown


class Still:
    """A task that stays where it is."""

    def __init__(self, point):
        self.point = point

    def desired(self, t):
        return (np.array(self.point), *np.zeros((3, 3)))


def plain(robot, q0):
    return Still((0.0, 0.0, 1.0))


def tuned(robot, q0, height: float, *, sway: Annotated[float, parameter("m", "aside", ge=0)] = 0.0):
    return Still((sway, 0.0, height))


def open_ended(robot, q0, **anything):
    return Still((0.0, 0.0, anything.get("height", 0.0)))


def unknown_types(robot: Unknown, q0: Unknown, *, height: Unknown = 1.0):
    return Still((0.0, 0.0, height))


@pytest.fixture
def registered():
    def register(factory):
        tasks.register("own", factory)
        return "own"

    yield register
    tasks._items.pop("own", None)


def test_parameters_reach_the_task(youbot):
    task = make_task("circle", youbot, radius=0.3, rate=-0.25, gap=0.0)
    assert (task.radius, task.rate) == (0.3, -0.25)
    tip = youbot.tip_pose(youbot.q_rest).translation
    assert np.allclose(task.desired(0.0)[0], tip, atol=1e-12)
    # clockwise, and along the heading first all the same
    assert np.allclose(task.desired(0.0)[1], [0.25 * 0.3, 0.0, 0.0], atol=1e-12)


def test_given_defaults_change_no_bit(robot):
    explicit = {
        item.name: item.default for item in parameters_of("circle") if item.default is not None
    }
    assert explicit == {"rate": 0.5}
    assert make_task("circle", robot, **explicit) == make_task("circle", robot)


def test_everything_that_is_wrong_is_told_at_once():
    with pytest.raises(UsageError) as caught:
        check_parameters("circle", {"radus": 1.0, "rate": 0.0, "gap": -1, "radius": "wide"})
    text = str(caught.value)
    assert text.startswith("task 'circle': ")
    assert "'radus' is unknown; did you mean 'radius'? allowed: radius, rate, gap" in text
    assert "'rate' (rad/s) is 0.0: must not be 0" in text
    assert "'gap' (m) is -1: Input should be greater than or equal to 0" in text
    assert "'radius' (m) is 'wide': Input should be a valid number" in text


@pytest.mark.parametrize("value", [math.nan, math.inf, True, "0.3", [0.3], 0.0, -1])
def test_what_is_no_radius_is_refused(value):
    with pytest.raises(UsageError, match=r"parameter 'radius' \(m\) is "):
        check_parameters("circle", {"radius": value})


def test_lists_are_told_which_entry_is_wrong():
    with pytest.raises(UsageError, match=r"integer.*\(entry 1\)"):
        check_parameters("lissajous", {"frequencies": [1, 2.5, 3]})
    with pytest.raises(UsageError, match="at least 3"):
        check_parameters("lissajous", {"frequencies": [1, 2]})


def test_an_orientation_is_a_unit_quaternion():
    for given in ([1.0, 1.0, 0.0, 0.0], [0.0] * 4):
        with pytest.raises(UsageError, match=r"'orientation' is .*, of length .*length 1"):
            make_task("pose", "youbot", orientation=given)


def test_whole_numbers_and_lists_will_do():
    assert check_parameters("circle", {"radius": 1}) == {"radius": 1.0}
    assert check_parameters("line", {"displacement": [1, 0, 0]})["displacement"] == [1, 0, 0]


def test_paper_has_none():
    with pytest.raises(UsageError, match="'radius' is unknown; allowed: none"):
        check_parameters("paper", {"radius": 1.0})


def test_unknown_task_is_told_first():
    with pytest.raises(UnknownNameError, match="unknown task 'cirle'"):
        check_parameters("cirle", {"radus": 1.0})


def test_factory_of_robot_and_q0_alone_still_works(youbot, registered):
    name = registered(plain)
    assert make_task(name, youbot).point == (0.0, 0.0, 1.0)
    with pytest.raises(UsageError, match="task 'own': parameter 'height' is unknown"):
        make_task(name, youbot, height=1.0)


def test_signature_is_the_declaration(youbot, registered):
    name = registered(tuned)
    height, sway = parameters_of(name)
    assert (height.name, height.required, height.meaning) == ("height", True, "")
    assert (sway.unit, sway.meaning, sway.default) == ("m", "aside", 0.0)
    assert make_task(name, youbot, height=2, sway=0.5).point == (0.5, 0.0, 2.0)
    with pytest.raises(UsageError, match=r"'sway'.*; parameter 'height' is missing"):
        make_task(name, youbot, sway=-1.0)


def test_types_for_type_checkers_only_are_not_checked(registered):
    name = registered(unknown_types)
    assert check_parameters(name, {"height": "high"}) == {"height": "high"}
    with pytest.raises(UsageError, match="allowed: height"):
        check_parameters(name, {"width": 1.0})


def test_factory_may_take_anything(youbot, registered):
    assert make_task(registered(open_ended), youbot, height=3.0).point[2] == 3.0


def test_robot_is_none_of_a_tasks_parameters():
    with pytest.raises(UsageError, match="parameter 'robot' is unknown"):
        check_parameters("circle", {"robot": "youbot"})


def test_every_parameter_says_what_it_is():
    for name in ("circle", "figure-eight", "kinematic-singularity", "algorithmic-singularity"):
        assert parameters_of(name)
    for name in mm.list_tasks():
        for item in parameters_of(name):
            assert item.meaning, (name, item.name)
            assert item.unit, (name, item.name)
            assert not item.required, (name, item.name)


def test_what_is_known_of_a_task_has_lists_only(youbot):
    known = task_parameters(make_task("line", youbot))
    assert known["type"] == "PointToPoint"
    assert known["points"][0] == youbot.tip_pose(youbot.q_rest).translation.tolist()


def test_command_line_passes_them_on():
    run_youbot = ["youbot", "--duration", "0.01", "--json", "--task", "square"]
    done = CliRunner().invoke(run, [*run_youbot, "--task-option", "side=0.4"])
    assert done.exit_code == 0, done.output
    known = json.loads(done.stdout)["spec"]["task_parameters"]
    assert known == task_parameters(make_task("square", "youbot", side=0.4))
    for wrong, text in [
        ("sides=0.4", "did you mean 'side'"),
        ("robot=1", "'robot' is unknown"),
        ("side=wide", "valid number"),
    ]:
        refused = CliRunner().invoke(run, [*run_youbot, "--task-option", wrong])
        assert isinstance(refused.exception, UsageError)
        assert text in str(refused.exception)
    twice = CliRunner().invoke(run, [*run_youbot, *["--task-option", "side=1"] * 2])
    assert twice.exit_code == 2
    assert "side is given twice" in twice.output
