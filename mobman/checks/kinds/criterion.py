"""Whether the posture criterion steers what the task by itself does not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobman.arrays import Array
from mobman.checks.check import Remark, check, does_not_apply, ok, some, warning
from mobman.checks.subject import Subject

_STATES = 10
_NONE = 1e-9  # of the largest entry: rounding
_TURN = 0.1  # rad: by which a coordinate is moved to see whether the platform then drives elsewhere


@check("criterion", "what steers the platform without moving the tip is coupled to something")
def criterion(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    steering = _steering(subject)
    if not steering:
        yield does_not_apply("the platform has no steering that leaves the tip where it is")
        return
    others = [i for i in range(robot.nq) if i not in steering]
    names = [repr(robot.joint_names[i]) for i in steering]
    if np.any(robot.criterion_couplings[np.ix_(steering, others)] != 0.0):
        yield ok(f"the steering ({some(names)}) is coupled to other coordinates")
        return
    yield warning(
        f"the steering is held at rest: turning {some(names)} moves no tip at once, and the criterion "
        "without couplings has its least where they rest, so that the platform drives straight on",
        f"couple them to {_yaw(subject)!r} (or another joint of the arm) by 'couplings' in [criterion] "
        f"of robot {robot.name!r}: see docs/platforms.md#car-like",
    )


def _steering(subject: Subject) -> list[int]:
    """Coordinates of the platform that change how it drives, by velocities that move no tip."""
    robot = subject.robot
    states = [q for q, _ in subject.states(_STATES)]
    # what each alpha does to the tip, and to the coordinates, at most
    tips, moves = np.zeros(robot.n_alpha), np.zeros((robot.nq, robot.n_alpha))
    for q in states:
        c = robot.velocity_map(q)[:, : robot.n_alpha]
        tips = np.maximum(tips, np.abs(robot.tip_jacobian(q)[:3] @ c).max(axis=0))
        moves = np.maximum(moves, np.abs(c))
    still = tips <= _NONE * max(1.0, float(tips.max(initial=0.0)))
    # of knuckles that turn alike one is in the equations, and all are the steering
    steers = [
        a
        for a in np.flatnonzero(still)
        if any(
            _changes_the_way(subject, q, int(i))
            for q in states
            for i in np.flatnonzero(moves[:, a])
        )
    ]
    rest = [a for a in range(robot.n_alpha) if a not in steers]
    return [
        int(i)
        for i in robot.platform_index
        if np.any(moves[i, steers] > 0.0) and not np.any(moves[i, rest] > 0.0)
    ]


def _changes_the_way(subject: Subject, q: Array, i: int) -> bool:
    turned = q.copy()
    turned[i] += _TURN
    before, after = subject.robot.velocity_map(q), subject.robot.velocity_map(turned)
    return bool(np.abs(after - before).max() > _NONE * np.abs(before).max())


def _yaw(subject: Subject) -> str:
    """The arm's first joint about the vertical at rest that moves the tip, or else its first joint."""
    robot, model = subject.robot, subject.robot.model
    moving = {
        model.joints[i].idx_q for i in model.supports[model.frames[subject.tip_frame].parentJoint]
    }
    names: list[str] = [robot.joint_names[i] for i in robot.arm_index if i in moving]
    upright = (name for name in names if subject.turns(name) and abs(subject.axis(name)[2]) > 0.9)
    return next(upright, names[0])
