"""The families of paths, and the named tasks of them on every robot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.differences import derivative

import mobman as mm
from mobman.checks.checks import Subject
from mobman.checks.closed_loop import CLOSE, gaps
from mobman.errors import UsageError
from mobman.tasks.paths import Harmonics, PointToPoint
from mobman.tasks.task import make_task, task_entry

CLOSED = ["figure-eight", "ellipse", "square", "lissajous"]
MADE = {
    "harmonics": Harmonics(
        (1.0, -2.0, 0.5),
        -0.7,
        ((0.5, 0.0, 0.1), (0.0, 0.0, 0.0), (0.1, 0.2, 0.3)),
        ((0.0, 0.4, 0.0), (0.3, 0.0, 0.2), (0.0, 0.1, 0.0)),
    ),
    "once": PointToPoint(((0.0, 0.0, 0.0), (1.0, 2.0, -1.0), (1.5, 0.0, 0.0)), (0.5, 2.0, 5.0)),
    "again": PointToPoint(
        ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
        (0.0, 2.0, 3.0, 4.0),
        repeats=True,
    ),
}


@pytest.fixture(params=[*MADE, *CLOSED, "line"])
def task(request, tiago):
    return MADE.get(request.param) or make_task(request.param, tiago)


def test_derivatives(task):
    for t in (0.31, 0.9, 2.4, 3.7, 6.1, 13.3):
        for order in range(3):
            expected = derivative(lambda s, t=t, k=order: task.desired(t + s)[k], h=0.02)
            assert np.allclose(task.desired(t)[order + 1], expected, atol=1e-7)


def test_steps_do_the_same(task):
    t, p_d = np.zeros(1), np.zeros((4, 3))
    run = task_entry(task, t, p_d)
    for t[0] in (0.0, 0.7, 2.0, 3.3, 9.1, 21.0):
        assert not run()
        assert np.allclose(p_d, task.desired(t[0]), atol=1e-12)


def test_path_closes_after_its_period_and_not_before(task):
    if task.period is None:
        return
    now, later = (task.desired(0.3 + after) for after in (0.0, task.period))
    assert np.allclose(now, later, atol=1e-11)
    states = [np.ravel(task.desired(0.3 + task.period * k / 60)[:2]) for k in range(1, 60)]
    assert min(np.linalg.norm(state - np.ravel(now[:2])) for state in states) > 1e-3


def test_third_derivative_is_continuous_where_a_path_rests():
    for path in (MADE["once"], MADE["again"]):
        for time, point in zip(path.times, path.points, strict=True):
            for side in (-1e-6, 0.0, 1e-6):
                p_d = path.desired(time + side)
                assert np.allclose(p_d[0], point, atol=1e-9)
                assert np.allclose(p_d[1:], 0.0, atol=1e-3)


def test_path_holds_its_ends():
    path = MADE["once"]
    assert np.array_equal(path.desired(-1.0)[0], path.points[0])
    assert np.array_equal(path.desired(99.0)[0], path.points[-1])
    assert path.period is None


def test_period_is_that_of_the_coarsest_harmonic():
    none = (0.0, 0.0, 0.0)
    path = Harmonics(none, 0.5, (none, (1.0, 0.0, 0.0)), (none, (0.0, 1.0, 0.0)))
    assert math.isclose(path.period, 2.0 * math.pi)


@pytest.mark.parametrize(
    ("points", "times", "repeats", "text"),
    [
        (((0.0, 0.0, 0.0),), (0.0,), False, "two points or more"),
        (((0.0,) * 3, (1.0,) * 3), (0.0, 0.0), False, "later than the one before"),
        (((0.0,) * 3, (1.0,) * 3), (0.0, 1.0), True, "ends where it begins"),
    ],
)
def test_what_is_no_path_is_refused(points, times, repeats, text):
    with pytest.raises(UsageError, match=text):
        PointToPoint(points, times, repeats)


@pytest.mark.parametrize("name", [*CLOSED, "line"])
def test_path_is_in_reach(robot, name):
    task = make_task(name, robot)
    assert task.name == name
    assert max(gaps(Subject(robot), task)) <= CLOSE


@pytest.mark.parametrize("name", CLOSED)
def test_path_begins_just_ahead_along_the_heading(driving_robot, name):
    robot, q0 = driving_robot, driving_robot.q_rest.copy()
    q0[robot.joint_names.index("base_theta")] = 0.8
    for rate in (0.5, -0.5):
        p, p_dot, *_ = make_task(name, robot, q0, rate=rate).desired(0.0)
        heading = np.array([math.cos(0.8), math.sin(0.8), 0.0])
        assert np.allclose(p, robot.tip_pose(q0).translation + 0.1 * heading, atol=1e-12)
        level = p_dot[:2]
        assert np.allclose(level, np.linalg.norm(level) * heading[:2], atol=1e-12)
        assert np.linalg.norm(level) > 0.05


def test_line_begins_at_rest_at_the_tip(robot):
    tip = robot.tip_pose(robot.q_rest).translation
    p_d = make_task("line", robot).desired(0.0)
    assert np.allclose(p_d[0], tip, atol=1e-15)
    assert not np.any(p_d[1:])


def test_line_goes_where_it_is_told_and_rests(tiago):
    q0 = tiago.q_rest.copy()
    q0[tiago.joint_names.index("base_theta")] = 0.5 * math.pi
    tip = tiago.tip_pose(q0).translation
    task = make_task("line", tiago, q0, displacement=[1.0, 0.5, 0.2], travel=2.0, pause=1.0)
    for t in (2.0, 2.5, 3.0):
        assert np.allclose(task.desired(t)[0], tip + np.array([-0.5, 1.0, 0.2]), atol=1e-12)
    assert task.period == 6.0
    once = make_task("line", tiago, q0, travel=2.0, returns=False)
    assert once.period is None
    assert np.allclose(once.desired(50.0)[0], tip + np.array([0.0, 1.0, 0.0]), atol=1e-12)
    with pytest.raises(UsageError, match="must not be 0 in all directions"):
        make_task("line", tiago, displacement=[0.0, 0.0, 0.0])


def test_square_is_nearly_one(tiago):
    task = make_task("square", tiago, side=2.0)
    points = np.array([task.desired(t)[0][:2] for t in np.linspace(0.0, task.period, 400)])
    points -= np.array(task.centre)[:2]
    assert np.allclose(np.abs(points).max(axis=0), 1.0, atol=0.04)  # bulges by 3 % towards corners
    assert np.linalg.norm(points, axis=1).max() > 1.2
    # straight in the middle of a side
    _, first, second, _ = task.desired(0.0)
    assert abs(first[0] * second[1] - first[1] * second[0]) < 1e-12


def test_ellipse_is_as_high_as_it_is_told(tiago):
    task = make_task("ellipse", tiago, height=0.4)
    heights = [task.desired(t)[0][2] for t in np.linspace(0.0, task.period, 201)]
    assert math.isclose(max(heights) - min(heights), 0.4, rel_tol=1e-9)


def test_laps_are_repeated():
    """The metric of repeatability works with every closed path's period."""
    for name in ("square", "line"):
        task = make_task(
            name, "fixed_panda", **({"rate": 6.0} if name == "square" else {"travel": 0.5})
        )
        record = mm.simulate("fixed_panda", "pseudo-inverse", task, duration=2.2)
        assert 0.0 < record.metrics["repeatability"] < 10.0
