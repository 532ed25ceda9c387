"""The platform's constraints and its wheels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.checks.check import Remark, check, does_not_apply, ok, warning, wrong
from mobman.checks.subject import Subject

_STATES = 50
_RESIDUAL = 1e-9  # of the largest products in A N
_RANK = 1e-8  # of the largest singular value
_SLIP = 5e-3  # of the platform's speed (of the rim's, when it turns): what crooked axes make


@check("constraints", "A N = 0 with full ranks, and wheels that roll where the platform goes")
def constraints(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    if len(robot.platform_index) == 0:
        yield does_not_apply("the base is fixed")
        return
    l, p, k = len(robot.platform_index), robot.n_alpha, robot.k
    residual, ranks_a, ranks_n = 0.0, set(), set()
    for q, _ in subject.states(_STATES):
        x = q[robot.platform_index]
        a, n = robot.platform.constraint_matrix(x), robot.platform.velocity_map(x)
        size = float(np.max(np.abs(a) @ np.abs(n), initial=0.0)) or 1.0
        residual = max(residual, float(np.max(np.abs(a @ n), initial=0.0)) / size)
        ranks_a.add(_rank(a))
        ranks_n.add(_rank(n))
    fix = f"check [platform] of robot {robot.name!r} (type {robot.spec.platform.type!r})"
    bad = False
    if not residual <= _RESIDUAL:
        bad = True
        yield wrong(f"A N is not 0 but up to {residual:.2g} of its terms, at random states", fix)
    for name, ranks, full in (("A", ranks_a, k), ("N", ranks_n, p)):
        if ranks != {full}:
            bad = True
            listing = ", ".join(map(str, sorted(ranks)))
            yield wrong(f"{name} has rank {listing} at random states; needed: {full}", fix)
    for remark in _rolling(subject):
        bad = True
        yield remark
    if not bad:
        wheels = ", ".join(f"{w.joint} (R = {w.radius:g} m)" for w in robot.platform.wheels)
        yield ok(
            f"A ({k} x {l}) of rank {k}, N ({l} x {p}) of rank {p}, |A N| below {residual:.1g} of its "
            f"terms; wheels: {wheels or 'none among the coordinates'}"
        )


def _rank(matrix: Array) -> int:
    if matrix.size == 0:
        return 0
    singular = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(singular > _RANK * singular[0]))


def _rolling(subject: Subject) -> Iterator[Remark]:
    """What the wheels' lowest points do when the platform drives ahead, and when it turns."""
    robot = subject.robot
    kind = robot.spec.platform.type
    if kind == "omnidirectional":  # rollers slide: their equations say how
        return
    n = robot.platform.velocity_map(subject.home[robot.platform_index])
    ahead = np.linalg.lstsq(n[:3], np.array([1.0, 0.0, 0.0]), rcond=None)[0]
    for wheel in robot.platform.wheels:
        slip = _slip(subject, wheel.joint, wheel.radius, n @ ahead)
        if abs(slip) > _SLIP:
            yield wrong(
                f"wheel {wheel.joint!r} slips by {slip:+.3g} m/s when the platform drives at 1 m/s",
                f"check fields 'platform.heading' and 'platform.wheel_radius' of robot {robot.name!r}, "
                f"and <axis> of joint {wheel.joint!r} in the URDF",
            )
    if kind != "differential":  # skid-steering slips when it turns, a car cannot turn on the spot
        return
    turn = np.linalg.lstsq(n[[0, 2]], np.array([0.0, 1.0]), rcond=None)[0]
    for wheel in robot.platform.wheels:
        slip = _slip(subject, wheel.joint, wheel.radius, n @ turn)
        track = abs(float(subject.centre(wheel.joint)[1]))
        if abs(slip) > _SLIP * track:
            yield warning(
                f"wheel {wheel.joint!r} slips by {slip:+.3g} m/s when the platform turns at 1 rad/s: "
                f"it is {track:.4g} m from the middle",
                f"remove field 'platform.half_track' of robot {robot.name!r}, or set it to {track:.4g}, "
                "unless the track was identified on the ground",
            )


def _slip(subject: Subject, joint: str, radius: float, x_dot: Array) -> float:
    """Velocity of a wheel's lowest point along the wheel (m/s), by the URDF's kinematics."""
    robot = subject.robot
    q_dot = np.zeros(robot.nq)
    q_dot[robot.platform_index] = x_dot
    columns = pin.getJointJacobian(
        robot.model,
        subject.data,
        robot.model.getJointId(joint),
        pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    )
    motion = np.array(columns) @ q_dot
    axis, up = subject.axis(joint), np.array([0.0, 0.0, 1.0])
    forward = np.cross(axis, up)
    forward /= np.linalg.norm(forward)
    return float(forward @ (motion[:3] + np.cross(motion[3:], -radius * up)))
