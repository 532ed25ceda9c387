"""Where the tip is, how far it gets, and whether the named circle is in its reach."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from mobman.checks.check import Remark, check, ok, some, warning, wrong
from mobman.checks.circle import CLOSE, circle, gaps
from mobman.checks.subject import Subject
from mobman.robots.urdf.shapes import bounds

_SAMPLES = 500


@check("reach", "the tip starts in free space above the ground, and reaches the task 'circle'")
def reach(subject: Subject) -> Iterator[Remark]:
    remarks = [*_start(subject), *_circle(subject)]
    yield from remarks
    if not remarks:
        lowest, highest, farthest = _workspace(subject)
        tip = np.array(subject.robot.tip_pose(subject.robot.q_rest).translation)
        yield ok(
            f"tip {tip[2]:.3g} m high at rest; sampled: {lowest:.3g} to {highest:.3g} m high, up to "
            f"{farthest:.3g} m from the arm's first joint; the task 'circle' is within reach"
        )


def _start(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    tip = np.array(robot.tip_pose(subject.home).translation)
    fix = f"choose another posture in [rest] of robot {robot.name!r}, or another 'arm.tip'"
    if len(robot.platform_index) > 0 and tip[2] < 0.0:
        yield wrong(f"the tip {robot.tip!r} rests {-tip[2]:.3g} m below the ground", fix)
    own = {link.name for link in subject.links_on(_carrier(subject))}
    inside = []
    for link in subject.platform_links:
        if not link.solid or link.name in own:
            continue
        rotation, position = subject.placement(link.name)
        point = rotation.T @ (tip - position)
        for shape in link.solid:
            lower, upper = bounds([shape])
            if np.all(lower < point) and np.all(point < upper):
                inside.append(repr(link.name))
                break
    if inside:
        yield warning(f"the tip {robot.tip!r} rests inside the box of link {some(inside)}", fix)


def _carrier(subject: Subject) -> str:
    """The joint that carries the tip."""
    model = subject.robot.model
    return str(model.names[model.frames[subject.tip_frame].parentJoint])


def _workspace(subject: Subject) -> tuple[float, float, float]:
    """Least and largest height of the tip, and its largest distance from the arm's first joint (m)."""
    robot = subject.robot
    model = robot.model
    chain = [i for i in model.supports[model.getJointId(_carrier(subject))] if i]
    arm = set(robot.arm_index.tolist())
    first = next(i for i in chain if model.joints[i].idx_q in arm)
    frame, data = subject.tip_frame, model.createData()
    tips, distances = [], []
    for sampled, _ in subject.states(_SAMPLES):
        q = subject.home.copy()
        q[robot.arm_index] = sampled[robot.arm_index]
        pin.forwardKinematics(model, data, q)
        tip = np.array(pin.updateFramePlacement(model, data, frame).translation)
        tips.append(float(tip[2]))
        distances.append(float(np.linalg.norm(tip - data.oMi[first].translation)))
    return min(tips), max(tips), max(distances)


def _circle(subject: Subject) -> Iterator[Remark]:
    path = circle(subject)
    found = list(gaps(subject, path))
    missed = sum(gap > CLOSE for gap in found)
    if missed:
        lowest, highest, reached = _workspace(subject)
        # a base that drives may stand in ways that the search has not come upon
        drives = len(subject.robot.platform_index) > 0
        missing = "were not found within reach" if drives else "are out of reach"
        yield warning(
            f"{missed} of {len(found)} points of the task 'circle' {missing}, by up to "
            f"{max(found):.2g} m; it is {path.centre[2]:.3g} m high, the arm reaches {reached:.3g} m "
            f"from its first joint and from {lowest:.3g} to {highest:.3g} m high",
            f"choose another [rest] of robot {subject.robot.name!r}, or give it a task of its own size",
        )
