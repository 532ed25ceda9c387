"""How far from singular the task's and the extended Jacobian are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobman.arrays import Array
from mobman.checks.check import Remark, check, does_not_apply, ok, warning, wrong
from mobman.checks.subject import Subject
from mobman.errors import SingularityError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.task_map import TaskMap

_STATES = 200
_ROUNDING = (
    1e-5  # of the largest singular value at rest: not more than rounding and a URDF's digits
)
_NEARLY = (
    0.02  # of the smallest singular value at the best posture: an elbow bent by a degree or two
)
_UNEQUAL = 1e-8  # conditioning that leaves half the digits of a double
_MANY = 0.25  # of the random postures


@check("singularities", "the tip can be moved every way at rest, and the criterion tells the rest")
def singularities(subject: Subject) -> Iterator[Remark]:
    robot, m = subject.robot, TaskMap().m
    if robot.nz < m:
        yield does_not_apply(f"{robot.nz} degrees of freedom, fewer than the tip's {m}")
        return
    states = [robot.q_rest, *(q for q, _ in subject.states(_STATES))]
    posture = list(_posture(subject, states))
    yield from posture
    if any(remark.status == "wrong" for remark in posture):
        return  # the extended Jacobian is singular with the tip's
    extended = ExtendedJacobian(robot, TaskMap(), Posture.of(robot))
    conditioning = np.array([_conditioning(extended, q, m) for q in states])
    criterion = list(_criterion(subject, conditioning))
    yield from criterion
    if not posture and not criterion:
        tip = _least(_tip(subject, robot.q_rest))
        yield ok(
            f"smallest singular value of the tip's Jacobian J_f C at rest: {tip:.2g}; conditioning of "
            f"the extended Jacobian: {conditioning[0]:.2g} at rest, "
            f"{np.median(conditioning[1:]):.2g} at random postures (median)"
        )


def _posture(subject: Subject, states: list[Array]) -> Iterator[Remark]:
    """Whether the tip can be moved every way at rest, by all joints and by the arm's alone."""
    robot = subject.robot
    fix = (
        f"choose another posture in [rest] of robot {robot.name!r}: bend the elbow, keep axes from "
        "lining up"
    )
    at_rest = _tip(subject, robot.q_rest)
    scale, least = float(np.linalg.norm(at_rest, 2)), _least(at_rest)
    best = max(_least(_tip(subject, q)) for q in states)
    if best <= _ROUNDING * scale:
        yield wrong(
            "the tip's Jacobian J_f C is singular at rest and at every random posture: some way of the "
            "tip is none that these joints move it",
            f"check 'arm.tip' and what is held in 'urdf.lock' of robot {robot.name!r}",
        )
        return
    found = f"smallest singular value {least:.2g}, {best:.2g} at the best of {len(states)} postures"
    if least <= _ROUNDING * scale:
        yield wrong(f"the tip's Jacobian J_f C is singular at rest: {found}", fix)
        return
    if least <= _NEARLY * best:
        yield warning(f"the tip's Jacobian J_f C is nearly singular at rest: {found}", fix)
        return
    least, best = _least(_arm(subject, robot.q_rest)), max(_least(_arm(subject, q)) for q in states)
    # an arm that moves its tip in a plane only does no better anywhere
    if best > _ROUNDING * scale and least <= _NEARLY * best:
        yield warning(
            "the arm is singular at rest, without the platform it cannot move the tip every way: "
            f"smallest singular value {least:.2g}, {best:.2g} at the best of {len(states)} postures",
            fix,
        )


def _criterion(subject: Subject, conditioning: Array) -> Iterator[Remark]:
    """Whether the criterion's weights let the extended Jacobian be inverted."""
    name = subject.robot.name
    fix = f"check [criterion] of robot {name!r}: weights that are too small or too unequal"
    share = float(np.mean(conditioning[1:] <= _UNEQUAL))
    if conditioning[0] <= _UNEQUAL:
        yield warning(
            "the criterion makes the extended Jacobian J nearly singular at rest: conditioning "
            f"{conditioning[0]:.2g} once its two parts are of one size",
            fix,
        )
    elif share > _MANY:
        yield warning(
            f"the extended Jacobian J is nearly singular at {100.0 * share:.0f} % of random postures "
            f"(conditioning below {_UNEQUAL:g})",
            fix,
        )


def _tip(subject: Subject, q: Array) -> Array:
    robot = subject.robot
    return robot.tip_jacobian(q)[: TaskMap().m] @ robot.velocity_map(q)


def _arm(subject: Subject, q: Array) -> Array:
    jacobian: Array = subject.robot.tip_jacobian(q)[: TaskMap().m, subject.robot.arm_index]
    return jacobian


def _least(jacobian: Array) -> float:
    """The smallest singular value, of as many as there are rows."""
    if jacobian.shape[1] < jacobian.shape[0]:
        return 0.0
    return float(np.linalg.svd(jacobian, compute_uv=False)[-1])


def _conditioning(extended: ExtendedJacobian, q: Array, m: int) -> float:
    """Smallest over largest singular value of J, the tip's rows and the criterion's of one size.

    The criterion's are in its own unit, and a factor on all weights changes no motion.
    """
    try:
        extended.at(q, np.zeros(len(extended.f)))
    except SingularityError:
        return 0.0
    if not np.all(np.isfinite(extended.J)):
        return 0.0
    parts = [part for part in (extended.J[:m], extended.J[m:]) if part.size]
    sizes = [float(np.linalg.norm(part, 2)) for part in parts]
    if min(sizes) == 0.0:
        return 0.0
    scaled = np.vstack([part / size for part, size in zip(parts, sizes, strict=True)])
    singular = np.linalg.svd(scaled, compute_uv=False)
    return float(singular[-1] / singular[0])
