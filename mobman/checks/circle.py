"""The task 'circle' and whether a robot's tip gets to it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mobman.arrays import Array
from mobman.checks.subject import Subject
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.tasks.circle import Circle
from mobman.tasks.task import make_task

CLOSE = 1e-3
"""A point that the tip gets so near to (m) is in its reach."""

_POINTS = 24  # of the circle
_STARTS = 3  # postures beside rest from which a point is tried
_ITERATIONS = 200
_DAMPING = 1e-4
_LARGEST_STEP = 0.2  # rad or m an iteration


def circle(subject: Subject, scale: float = 1.0) -> Circle:
    """The task 'circle' from rest, made smaller about the tip's start.

    Args:
        subject: The robot.
        scale: Of all distances from the tip; 1 is the task itself.

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
    """How near the tip gets to points around a circle, one after the other, within the limits (m).

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
    """Whether the tip gets to all of :func:`gaps`."""
    return all(gap <= CLOSE for gap in gaps(subject, path))


def _approached(subject: Subject, q: Array, point: Array) -> tuple[Array, float]:
    """A configuration whose tip is as near to a point as damped least squares get, and the gap (m)."""
    robot = subject.robot
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    names = robot.joint_names
    pose = np.eye(robot.nq)[:, [names.index(name) for name in BASE_JOINTS if name in names]]
    angles = np.isin(np.arange(robot.nq), robot.arm_index)
    if BASE_JOINTS[2] in names:
        angles[names.index(BASE_JOINTS[2])] = True
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
