"""The robot's derivatives against finite differences of what they are derivatives of."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mobman.arrays import Array
from mobman.checks.check import Remark, check, ok, some, wrong
from mobman.checks.differences import derivative, relative
from mobman.checks.subject import Subject
from mobman.errors import SingularityError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.task_map import TaskMap

_STATES = 6
_TOLERANCE = 1e-5
_STEP = 4e-3  # rad or m of the fastest coordinate
_SHORT = 5e-4  # the same, for f_a, which bends sharply near singular postures
_REGULAR = 1e-3  # singular value of [J_f; A] below which it does so too sharply for any step


@check("derivatives", "Jacobians and rates agree with finite differences at random states")
def derivatives(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    worst: dict[str, float] = {}
    for q, z in subject.states(_STATES):
        for name, error in (*_tip_and_maps(subject, q, z), *_extended(subject, q, z)):
            worst[name] = float(np.maximum(worst.get(name, 0.0), error))  # a NaN stays
    bad = [f"{name} by {error:.2g}" for name, error in worst.items() if not error <= _TOLERANCE]
    if bad:
        yield wrong(
            f"disagree with finite differences: {some(bad)}, relative",
            f"check the platform's A, N and their derivatives (type {robot.spec.platform.type!r}) of "
            f"robot {robot.name!r}, and that its numbers are of a size that doubles can carry",
        )
    else:
        largest = max(worst, key=worst.__getitem__)
        yield ok(f"{', '.join(worst)}: agree to {worst[largest]:.1g} or better")


def _tip_and_maps(subject: Subject, q: Array, z: Array) -> Iterator[tuple[str, float]]:
    robot = subject.robot
    q_dot = robot.velocity_map(q) @ z
    tip = robot.tip_kinematics(q, z)
    step = _STEP / max(1.0, float(np.abs(q_dot).max()))

    def along(function: Callable[[Array], Array]) -> Array:
        return derivative(lambda s: function(q + s * q_dot), step)

    speed = along(lambda here: np.array(robot.tip_pose(here).translation))
    yield "tip Jacobian", relative(tip.jacobian[:3] @ q_dot, speed)
    yield "its rate", relative(tip.jacobian_rate, along(robot.tip_jacobian))
    yield "C'", relative(robot.velocity_map_rate(q, z), along(robot.velocity_map))
    yield "A'", relative(robot.constraint_matrix_rate(q, q_dot), along(robot.constraint_matrix))


def _extended(subject: Subject, q: Array, z: Array) -> Iterator[tuple[str, float]]:
    """J z against p' and J' z against the rate of J z at constant z, in axes carried from q."""
    robot, task_map = subject.robot, TaskMap()
    if robot.nz < task_map.m:
        return
    j = np.vstack([robot.tip_jacobian(q)[: task_map.m], robot.constraint_matrix(q)])
    if np.linalg.svd(j, compute_uv=False)[-1] < _REGULAR:
        return
    extended = ExtendedJacobian(robot, task_map, Posture.of(robot))
    extended.at(q, z)
    axes, J, J_dot_z = extended.complement.copy(), extended.J.copy(), extended.J_dot_z.copy()
    q_dot = robot.velocity_map(q) @ z
    step = _SHORT / max(1.0, float(np.abs(q_dot).max()))

    def at(s: float) -> ExtendedJacobian:
        extended.complement[:] = axes
        extended.at(q + s * q_dot, z)
        return extended

    try:
        p_dot = derivative(lambda s: at(s).f.copy(), step)
        p_ddot = derivative(lambda s: at(s).J @ z, step)
    except SingularityError:
        return
    yield "J", relative(J @ z, p_dot)
    yield "J' z", relative(J_dot_z, p_ddot)
