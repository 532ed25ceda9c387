"""What a task is: names, and any object with desired(t)."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.errors import UnknownNameError, UsageError
from mobman.tasks.task import task_entry, task_map_of, time_of


class Fixed:
    """A task that gives the same four things at every time."""

    def __init__(self, *parts):
        self.parts = parts

    def desired(self, t):
        return self.parts


def test_named_tasks_are_listed():
    assert {"paper", "circle"} <= set(mm.list_tasks())


def test_misspelt_task_is_answered_with_the_nearest_name(youbot):
    with pytest.raises(UnknownNameError, match="unknown task 'cirle'; did you mean 'circle'"):
        mm.make_task("cirle", youbot)


@pytest.mark.parametrize("m", [2, 3])
def test_dimension_is_that_of_the_desired_point(m):
    assert task_map_of(Fixed(*np.zeros((4, m)))).m == m


def test_lists_will_do():
    p_d = np.zeros((4, 2))
    task_entry(Fixed([1, 2], [3, 4], [5, 6], [7, 8]), np.zeros(1), p_d)()
    assert p_d.tolist() == [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]


@pytest.mark.parametrize(
    "parts",
    [
        np.zeros((3, 3)),
        [np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2)],
        [np.zeros((3, 1))] * 4,
        [0.0] * 4,
    ],
    ids=["three parts", "two lengths", "columns", "numbers"],
)
def test_wrong_shapes_are_told(parts):
    with pytest.raises(UsageError, match=r"desired\(t\) of Fixed gave arrays of shapes"):
        task_map_of(Fixed(*parts))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"parts": ([np.nan] * 3, *np.zeros((3, 3)))},
            r"gave \(\[nan.* at t = 0 s; needed: finite",
        ),
        ({"parts": (["a"] * 3, *np.zeros((3, 3)))}, "needed: finite numbers"),
        ({"period": "x"}, "task Fixed: period is 'x'; allowed: a time"),
        ({"duration": -1.0}, "task Fixed: duration is -1.0; allowed: a time"),
        ({"duration": np.nan}, "task Fixed: duration is nan; allowed: a time"),
        ({"tip_axis": "x"}, "task Fixed: tip_axis is 'x'; needed: numbers"),
    ],
    ids=str,
)
def test_what_is_no_number_or_time_is_told(change, words):
    task = Fixed(*np.zeros((4, 3)))
    vars(task).update(change)
    with pytest.raises(UsageError, match=words):
        task_map_of(task)


@pytest.mark.parametrize("what", ["period", "duration"])
def test_time_without_end_is_none(what, youbot):
    """By the laws that look ahead, by placements, and by the metrics."""

    class Still(Fixed):
        def __init__(self):
            super().__init__(*np.zeros((4, 3)))
            self.parts = (
                youbot.tip_kinematics(youbot.q_rest, np.zeros(5)).position,
                *np.zeros((3, 3)),
            )

    task = Still()
    setattr(task, what, np.inf)
    assert time_of(task, what) is None
    for law in ("tsm", "mpc"):
        record = mm.simulate(youbot, law, task, duration=0.02)
        assert record.ok, law
        assert np.isnan(record.metrics["repeatability"])


def test_other_dimensions_are_refused():
    with pytest.raises(UsageError, match="4 components and its derivatives 4; allowed: 3"):
        task_map_of(Fixed(*np.zeros((4, 4))))


def test_shapes_tell_poses_and_directions():
    none = np.zeros((3, 6))
    assert task_map_of(Fixed([0, 0, 0, 0, 0, 0, 1], *none)).m == 6
    pointing = Fixed([0, 0, 0, 0, 1, 0], *none)
    assert task_map_of(pointing).axis == (0.0, 0.0, 1.0)
    pointing.tip_axis = [0.0, -1.0, 0.0]
    assert task_map_of(pointing).axis == (0.0, -1.0, 0.0)
    assert task_map_of(pointing).m == 5


@pytest.mark.parametrize(
    "p_d", [[0, 0, 0, 0, 0, 0, 1.1], [0, 0, 0, 0, 2, 0], [0] * 7, [np.nan] * 7]
)
def test_other_lengths_than_1_are_refused(p_d):
    with pytest.raises(
        UsageError, match=r"task Fixed: the desired (quaternion|axis) at t = 0 s is"
    ):
        task_map_of(Fixed(p_d, *np.zeros((3, 6))))


def test_tip_axis_of_another_length_is_refused():
    task = Fixed([0, 0, 0, 0, 1, 0], *np.zeros((3, 6)))
    task.tip_axis = (0.0, 0.0, 0.5)
    with pytest.raises(
        UsageError, match=r"task Fixed: tip_axis is .* of length 0\.5; needed: length 1"
    ):
        task_map_of(task)


def test_object_without_desired_is_no_task():
    with pytest.raises(UsageError, match="is not a task: expected a method desired"):
        task_map_of(object())
