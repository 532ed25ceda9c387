"""Paths through kinematic and algorithmic singularities: ranks are lost where they are said to be."""

from __future__ import annotations

import numpy as np
import pytest
from support.platforms import ARM, on

import mobman as mm
from mobman.errors import UsageError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.task_map import TaskMap
from mobman.tasks.paths import place_of
from mobman.tasks.singular import (
    AlgorithmicPath,
    least_singular_value,
    nearest_degeneracy,
    stretched,
)
from mobman.tasks.task import make_task

KINEMATIC, ALGORITHMIC = "kinematic-singularity", "algorithmic-singularity"


def _slides(robot):
    """Whether a joint of the arm slides."""
    kinds = {joint.idx_q: joint.shortname() for joint in robot.model.joints[1:]}
    return any(kinds[i].startswith("JointModelP") for i in robot.arm_index)


def least(robot, q):
    """Least singular value of j_e."""
    return least_singular_value(robot.tip_jacobian(q)[:3] @ robot.velocity_map(q))


def _least(robot, record):
    """Least singular values of j_e, and least eigenvalues of J J^T, along a run."""
    held = Posture(AlgorithmicPath.criterion_weights(robot), robot.q_rest)
    extended = ExtendedJacobian(robot, TaskMap(), held)
    tips, wholes = [], []
    for q, z in zip(record.q[::5], record.z[::5], strict=True):
        extended.at(q, z)
        wholes.append(np.linalg.svd(extended.J, compute_uv=False)[-1] ** 2)
        tips.append(least(robot, q))
    return np.array(tips), np.array(wholes)


@pytest.mark.parametrize("direction", ["up", "down"])
def test_arm_cannot_move_its_tip_farther(robot, direction):
    way = np.array([0.0, 0.0, 1.0 if direction == "up" else -1.0])
    q = stretched(robot, robot.q_rest, way)
    assert np.array_equal(q[robot.platform_index], robot.q_rest[robot.platform_index])
    random = np.random.default_rng(1)
    height = way @ robot.tip_pose(q).translation
    limits = robot.limits
    low = np.where(np.isfinite(limits.lower), limits.lower, -np.pi)[robot.arm_index]
    high = np.where(np.isfinite(limits.upper), limits.upper, np.pi)[robot.arm_index]
    for _ in range(100):
        other = q.copy()
        other[robot.arm_index] = random.uniform(low, high)
        assert way @ robot.tip_pose(other).translation <= height + 1e-6
    # no joint that turns moves it that way; the rank is lost, but for joints that slide
    if not _slides(robot):
        assert np.abs(way @ robot.tip_jacobian(q)[:3, robot.arm_index]).max() < 1e-6
        assert least(robot, q) < 1e-6


def test_path_ends_at_the_boundary(robot):
    task = make_task(KINEMATIC, robot)
    place = place_of(robot, robot.q_rest)
    assert np.allclose(task.points[0], place.tip, atol=1e-12)
    assert task.points[0] == task.points[-1]
    assert task.period == 10.0
    assert _slides(robot) or task.singular_value == 0.0
    short, beyond = (make_task(KINEMATIC, robot, depth=depth) for depth in (-0.02, 0.05))
    assert np.isclose(np.linalg.norm(np.subtract(beyond.points[1], short.points[1])), 0.07)
    assert make_task(KINEMATIC, robot) == task


def test_limits_leave_less_room(fixed_robot):
    ways = [
        make_task(KINEMATIC, fixed_robot, direction="down", within_limits=limited).points[1][2]
        for limited in (False, True)
    ]
    assert ways[0] <= ways[1]


def test_directions_and_depths_that_make_no_sense(youbot):
    with pytest.raises(UsageError, match="drives, so that no point is too far out"):
        make_task(KINEMATIC, youbot, direction="out")
    with pytest.raises(UsageError, match=r"'direction' is 'sideways'.*'up', 'down' or 'out'"):
        make_task(KINEMATIC, youbot, direction="sideways")
    with pytest.raises(UsageError, match=r"depth = -9 m leaves nothing of the 0\.529 m"):
        make_task(KINEMATIC, youbot, depth=-9.0)


@pytest.mark.parametrize("name", ["youbot", "fixed_panda", "husky_ur5"])
def test_run_comes_near_the_loss_of_rank(name):
    """Half a millimetre short of the boundary the singular value has gone to a few per cent."""
    robot = mm.load_robot(name)
    task = make_task(KINEMATIC, robot, depth=-5e-4, travel=1.0)
    record = mm.simulate(robot, "damped-least-squares", task, duration=1.1, dt=2e-3)
    tips, _ = _least(robot, record)
    assert tips.min() < 0.1 * tips[0]


@pytest.mark.parametrize("name", ["fixed_panda", "ridgeback_panda"])
def test_run_loses_the_rank_of_the_extended_jacobian_alone(name):
    """J's goes, j's does not; half a millimetre short of it the law passes."""
    robot = mm.load_robot(name)
    task = make_task(ALGORITHMIC, robot, depth=-5e-4, travel=1.0)
    record = mm.simulate(robot, "extended-jacobian", task, duration=1.1, dt=2e-3)
    tips, wholes = _least(robot, record)
    assert wholes.min() < 0.05 * wholes[0]
    assert tips[np.argmin(wholes)] > 0.1 * tips[0]
    assert tips[np.argmin(wholes)] == pytest.approx(task.singular_value, rel=0.2)


@pytest.mark.parametrize("name", ["youbot", "fixed_panda", "husky_ur5", "tiago_no_hand"])
def test_at_the_end_of_the_way_the_extended_jacobian_is_singular(name):
    robot = mm.load_robot(name)
    robot.criterion_weights[:] = AlgorithmicPath.criterion_weights(robot)
    place = place_of(robot, robot.q_rest)
    back = np.array([*(robot.arm_origin(robot.q_rest) - place.tip)[:2], 0.0])
    back /= np.linalg.norm(back)
    up = place.axes[2]
    found = nearest_degeneracy(
        robot, robot.q_rest, [back], [up, -up], 4.0 * place.reach, place.reach
    )
    assert found is not None
    extended = ExtendedJacobian(robot, TaskMap(), Posture.of(robot))
    values = []
    for q in (robot.q_rest, found.q):
        extended.at(q, np.zeros(robot.nz))
        singular = np.linalg.svd(extended.J, compute_uv=False)
        values.append((singular[-1], least(robot, q)))
    assert values[1][0] < 0.05 * values[0][0]
    assert values[1][1] > 0.1 * values[0][1]
    # it is on the solution, at the end of the lines
    assert np.linalg.norm(extended.f[3:]) < 1e-6
    assert np.allclose(extended.f[:3], found.corners[-1], atol=1e-6)


def test_the_same_path_again(tiago):
    assert make_task(ALGORITHMIC, tiago) == make_task(ALGORITHMIC, tiago)


def test_path_begins_and_ends_at_the_tip(fixed_robot):
    task = make_task(ALGORITHMIC, fixed_robot)
    assert np.allclose(task.points[0], place_of(fixed_robot, fixed_robot.q_rest).tip, atol=1e-12)
    assert task.points[0] == task.points[-1]
    assert task.period == 10.0


def test_where_there_is_none_it_says_so(youbot):
    with pytest.raises(UsageError, match=r"no algorithmic singularity .* within 0\.1 m"):
        make_task(ALGORITHMIC, youbot, farthest=0.1)
    with pytest.raises(UsageError, match=r"depth = -5 m leaves nothing of the last 0\.\d+ m"):
        make_task(ALGORITHMIC, youbot, depth=-5.0)
    content = {**on("fixed"), "mount": [{**ARM, "lock": ["wrist_*"]}], "rest": {}}
    with pytest.raises(UsageError, match=r"'ur5_on_fixed' has no redundant degree of freedom"):
        make_task(ALGORITHMIC, mm.load_robot(content))
