"""Check of the tip's place at rest, of the workspace, and of the task 'circle' within it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.checks.checks import Remark, check, ok, some, warning, wrong
from mobman.checks.subject import Subject
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.shapes import bounds
from mobman.tasks.circle import Circle
from mobman.tasks.task import make_task

CLOSE = 1e-3
"""A point that the tip gets so near to (m) is in its reach."""

_SAMPLES = 500  # of the workspace
_POINTS = 24  # of the circle
_STARTS = 3  # postures, in addition to rest, from which a point is tried
_ITERATIONS = 200
_DAMPING = 1e-4
_LARGEST_STEP = 0.2  # rad or m an iteration


@check("reach", "the tip starts in free space above the ground, and reaches the task 'circle'")
def reach(subject: Subject) -> Iterator[Remark]:
    robot, tip = subject.robot, np.array(subject.robot.tip_pose(subject.home).translation)
    remarks, path = [*_start(subject, tip)], circle(subject)
    found = list(gaps(subject, path))
    missed = sum(gap > CLOSE for gap in found)
    lowest, highest, reached = _workspace(subject) if missed or not remarks else (0.0, 0.0, 0.0)
    if missed:
        # a base that drives may stand in ways that the search has not come upon
        drives = len(robot.platform_index) > 0
        missing = "were not found within reach" if drives else "are out of reach"
        remarks.append(
            warning(
                f"{missed} of {len(found)} points of the task 'circle' {missing}, by up to "
                f"{max(found):.2g} m; it is {path.centre[2]:.3g} m high, the arm reaches {reached:.3g} "
                f"m from its first joint and from {lowest:.3g} to {highest:.3g} m high",
                f"choose another [rest] of robot {robot.name!r}, or give it a task of its own size",
            )
        )
    yield from remarks or [
        ok(
            f"tip {tip[2]:.3g} m high at rest; sampled: {lowest:.3g} to {highest:.3g} m high, up to "
            f"{reached:.3g} m from the arm's first joint; the task 'circle' is within reach"
        )
    ]


def _start(subject: Subject, tip: Array) -> Iterator[Remark]:
    robot = subject.robot
    fix = f"choose another posture in [rest] of robot {robot.name!r}, or another 'arm.tip'"
    if len(robot.platform_index) > 0 and tip[2] < 0.0:
        yield wrong(f"the tip {robot.tip!r} rests {-tip[2]:.3g} m below the ground", fix)
    own = {link.name for link in subject.links_on(subject.carrier)}
    inside = []
    for link in subject.platform_links:
        rotation, position = subject.placement(link.name)
        point = rotation.T @ (tip - position)
        boxes = [] if link.name in own else [bounds([shape]) for shape in link.solid]
        if any(np.all(lower < point) and np.all(point < upper) for lower, upper in boxes):
            inside.append(repr(link.name))
    if inside:
        yield warning(f"the tip {robot.tip!r} rests inside the box of link {some(inside)}", fix)


def _workspace(subject: Subject) -> tuple[float, float, float]:
    """Least and largest height of the tip, and its largest distance from the arm's first joint (m)."""
    robot, model, frame = subject.robot, subject.robot.model, subject.tip_frame
    chain = [i for i in model.supports[model.getJointId(subject.carrier)] if i]
    arm = set(robot.arm_index.tolist())
    first = next(i for i in chain if model.joints[i].idx_q in arm)
    data = model.createData()
    heights, distances = [], []
    for sampled, _ in subject.states(_SAMPLES):
        q = subject.home.copy()
        q[robot.arm_index] = sampled[robot.arm_index]
        pin.forwardKinematics(model, data, q)
        tip = np.array(pin.updateFramePlacement(model, data, frame).translation)
        heights.append(float(tip[2]))
        distances.append(float(np.linalg.norm(tip - data.oMi[first].translation)))
    return min(heights), max(heights), max(distances)


# The task 'circle' -------------------------------------------------------------------------------------


def circle(subject: Subject, scale: float = 1.0) -> Circle:
    """The task 'circle' from rest, made smaller about the tip's start.

    Args:
        subject: The robot.
        scale: Scale of all distances from the tip; 1 is the task itself.

    Raises:
        TypeError: If the name stands for something else.
    """
    task = make_task("circle", subject.robot)
    if not isinstance(task, Circle):
        raise TypeError(f"the task 'circle' is a {type(task).__name__}")
    tip = np.array(subject.robot.tip_pose(subject.robot.q_rest).translation)
    x, y, z = tip + scale * (np.array(task.centre) - tip)
    return replace(task, centre=(float(x), float(y), float(z)), radius=scale * task.radius)


def gaps(subject: Subject, path: Circle) -> Iterator[float]:
    """Distances that the tip keeps from points around a circle, in their order, within the limits (m).

    Found by damped least squares from rest and from a few other postures: what is not found may be
    reached in ways that these do not find. A platform that drives stands wherever it helps: it is
    controllable, so that it gets there, whatever it cannot do at once.
    """
    robot = subject.robot
    starts = [robot.q_rest, *(q for q, _ in subject.states(_STARTS))]
    last = robot.q_rest
    for i in range(_POINTS):
        point, least = path.desired(path.period * i / _POINTS)[0], math.inf
        for start in (last, *starts):
            q, gap = _approached(subject, start, point)
            least = min(least, gap)
            if gap <= CLOSE:
                last = q
                break
        yield least


def is_within_reach(subject: Subject, path: Circle) -> bool:
    """True if the tip gets to every point of :func:`gaps`."""
    return all(gap <= CLOSE for gap in gaps(subject, path))


def _approached(subject: Subject, q: Array, point: Array) -> tuple[Array, float]:
    """A configuration whose tip is as near to a point as damped least squares get, and the gap (m)."""
    robot = subject.robot
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    names = robot.joint_names
    pose = np.eye(robot.nq)[:, [names.index(name) for name in BASE_JOINTS if name in names]]
    angles = np.isin(np.arange(robot.nq), robot.arm_index) | np.isin(names, BASE_JOINTS[2])
    best, least = q, math.inf
    for _ in range(_ITERATIONS):
        gap = point - np.array(robot.tip_pose(q).translation)
        size = float(np.linalg.norm(gap))
        if size < least:
            best, least = q, size
        if size < 0.5 * CLOSE:
            break
        c = robot.velocity_map(q)
        # in units of motion of the coordinates, whatever alpha's are
        unit = np.hstack([c / np.maximum(np.abs(c).max(axis=0), 1e-12), pose])
        j = robot.tip_jacobian(q)[:3] @ unit
        step = unit @ (j.T @ np.linalg.solve(j @ j.T + _DAMPING * np.eye(3), gap))
        largest = float(np.abs(step[angles]).max())
        step *= min(1.0, _LARGEST_STEP / max(largest, 1e-12))
        q = np.clip(q + step, lower, upper)
    return best, least
