"""Checks of the tip at rest, of its reach around the task 'circle', of a closed loop on it, and of what
long runs lead to: singularities, and a criterion that pulls at what grows with the way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mobman.arrays import Array
from mobman.checks.checks import Finding, Findings, Subject, check, some, warning, wrong
from mobman.model.metric import conditioning, heading_weight
from mobman.robots.infer.findings import MOST_REACH
from mobman.robots.spec import DRIVEN
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.shapes import bounds
from mobman.simulation.record import Record
from mobman.simulation.simulate import simulate
from mobman.simulation.singularity import predict_singularity
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
def reach(subject: Subject) -> Findings:
    yield from _start(subject)
    path = circle(subject)
    found = list(gaps(subject, path))
    lowest, highest, reached = _workspace(subject)
    if reached > MOST_REACH:
        yield wrong(
            f"the arm reaches {reached:.4g} m from its first joint, above {MOST_REACH:g} m: is it in "
            "millimetres?",
            "scale the <origin> of its joints, its shapes and meshes to metres",
        )
    if missed := sum(gap > CLOSE for gap in found):
        # a base that drives may stand in ways that the search has not come upon
        drives = len(subject.robot.platform_index) > 0
        missing = "were not found within reach" if drives else "are out of reach"
        yield warning(
            f"{missed} of {len(found)} points of the task 'circle' {missing}, by up to "
            f"{max(found):.2g} m; it is {path.centre[2]:.3g} m high, the arm reaches {reached:.3g} "
            f"m from its first joint and from {lowest:.3g} to {highest:.3g} m high",
            f"choose another [rest] of {subject.name}, or give it a task of its own size",
        )
    tip = subject.robot.tip_pose(subject.home).translation
    return (
        f"tip {tip[2]:.3g} m high at rest; sampled: {lowest:.3g} to {highest:.3g} m high, up to "
        f"{reached:.3g} m from the arm's first joint; the task 'circle' is within reach"
    )


def _start(subject: Subject) -> Iterator[Finding]:
    robot, tip = subject.robot, np.array(subject.robot.tip_pose(subject.home).translation)
    fix = f"choose another posture in [rest] of {subject.name}, or another 'arm.tip'"
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
    robot, arm = subject.robot, subject.robot.arm.joints
    heights, distances = [], []
    for sampled, _ in subject.states(_SAMPLES):
        q = subject.home.copy()
        q[arm] = sampled[arm]
        tip = np.array(robot.tip_pose(q).translation)
        heights.append(float(tip[2]))
        distances.append(float(np.linalg.norm(tip - robot.arm_origin(q))))
    return min(heights), max(heights), max(distances)


# The task 'circle' -------------------------------------------------------------------------------------


def circle(subject: Subject, scale: float = 1.0) -> Circle:
    """The task 'circle' from rest, all its distances from the tip's start times the scale.

    Raises:
        TypeError: If the name stands for something else.
    """
    task = make_task("circle", subject.robot)
    if not isinstance(task, Circle):
        raise TypeError(f"the task 'circle' is a {type(task).__name__}")
    tip = np.array(subject.robot.tip_pose(subject.robot.q_rest).translation)
    x, y, z = (tip + scale * (np.array(task.centre) - tip)).tolist()
    return replace(task, centre=(x, y, z), radius=scale * task.radius)


def gaps(subject: Subject, path: Circle) -> Iterator[float]:
    """Distances that the tip keeps from points around a circle, in their order, within the limits (m).

    Found by damped least squares from rest and from a few other postures: what is not found may be
    reached in ways that these do not find. A platform that drives stands wherever it helps: it is
    controllable, so that it gets there, whatever it cannot do at once.
    """
    last = subject.robot.q_rest
    starts = [last, *(q for q, _ in subject.states(_STARTS))]
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
    robot, best, least = subject.robot, q, math.inf
    names = np.array(robot.joint_names)
    pose = np.eye(robot.nq)[:, np.isin(names, BASE_JOINTS)]
    angles = np.isin(np.arange(robot.nq), robot.arm_index) | (names == BASE_JOINTS[2])
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
        step *= min(1.0, _LARGEST_STEP / max(float(np.abs(step[angles]).max()), 1e-12))
        q = np.clip(q + step, subject.model.lowerPositionLimit, subject.model.upperPositionLimit)
    return best, least


# A second of closed loop -------------------------------------------------------------------------------

_DURATION = 1.0  # s
_RESIDUAL = 1e-9  # m/s
_CONTROLLER, _TASK = "tsm", "circle"
_SCALES = (1.0, 0.5, 0.25, 0.1)  # of the circle, the largest within reach is driven
_SMALL = 0.5  # a platform that drives ought to get round a larger one


@check(
    "closed-loop",
    f"a second of {_CONTROLLER!r} on the task {_TASK!r} brings the tip nearer",
    simulates=True,
)
def closed_loop(subject: Subject) -> Findings:
    robot = subject.robot
    if few := subject.few:
        return few
    # an arm that cannot drive rarely gets round the whole circle: then a smaller one
    paths = {scale: circle(subject, scale) for scale in _SCALES}
    scale = next((s for s in _SCALES if is_within_reach(subject, paths[s])), None)
    fix = f"correct what the other checks find, and try another [rest] of {subject.name}"
    if scale is None:
        smallest = f"even {_SCALES[-1]:g} times as large"
        yield warning(f"not run: the task {_TASK!r} is out of reach, {smallest}", fix)
        return ""
    record = simulate(robot, _CONTROLLER, paths[scale], duration=_DURATION)
    path = f"{_TASK!r}" if scale == 1.0 else f"{_TASK!r}, {scale:g} times as large"
    if not record.ok:
        yield wrong(f"the run on {path} ended as {record.status} {record.message}", fix)
        return ""
    if not all(np.all(np.isfinite(part)) for part in (record.q, record.z, record.torque)):
        yield wrong("the run has numbers that are not finite", fix)
    residual = record.metrics["constraint_residual"]
    if not residual <= _RESIDUAL:
        found = f"the constraints A q' = 0 are broken by {residual:.2g} m/s"
        yield wrong(found, f"check [platform] of {subject.name}")
    first, last = np.linalg.norm(record.task_error[[0, -1]], axis=1)
    if not last < first:
        yield warning(f"{path}: the tip's error went from {first:.3g} to {last:.3g} m in 1 s", fix)
    if scale < _SMALL and len(robot.platform_index) > 0:
        yield warning(
            f"only run on {path}: the tip was not found to reach larger ones, though the "
            "platform drives",
            f"see what the check 'reach' says, and try another [rest] of {subject.name}",
        )
    yield from _efforts(subject, record)
    return (
        f"{path}: the tip's error went from {first:.3g} to {last:.2g} m in 1 s; |A q'| "
        f"{residual:.1g} m/s; peak torque {np.abs(record.torque).max():.3g}"
    )


def _efforts(subject: Subject, record: Record) -> Iterator[Finding]:
    """Joints whose motors would have to give more than they have."""
    robot, limits = subject.robot, subject.model.effortLimit
    states = zip(record.q, record.torque, strict=True)
    peaks = np.max([np.abs(robot.actuation(q) @ torque) for q, torque in states], axis=0)
    if over := some(
        f"joint {name!r} {peak:.3g} of {most:.3g}"
        for name, peak, most in zip(robot.joint_names, peaks, limits, strict=True)
        if 0.0 < most < peak
    ):
        yield warning(
            f"torques above the effort limits: {over}",
            "start nearer to the path or with lower gains on the real robot, or check <limit effort> of "
            f"these joints in {subject.files}",
        )


# Singularities on the way ----------------------------------------------------------------------------

_MINUTES = 120.0  # s


@check(
    "fold",
    f"the motion on the task {_TASK!r} leads to no singularity within {_MINUTES:g} s",
    simulates=True,
)
def fold(subject: Subject) -> Findings:
    if few := subject.few:
        return few
    found = predict_singularity(subject.robot, circle(subject), duration=_MINUTES)
    if found.singular is not None:
        yield warning(
            f"laws on the extended task (13) that follow the task {_TASK!r} become singular at "
            f"t = {found.singular.time:.3g} s: {found.singular}",
            f"lower the weights of wheels and platform in [criterion] of {subject.name}, choose "
            "another posture in [rest], or a law without the extended Jacobian",
        )
        return ""
    least = int(found.sigma.argmin())
    return (
        f"{_MINUTES:g} s of the task {_TASK!r}: sigma_min(J) at least {found.sigma[least]:.2g}, at "
        f"t = {found.t[least]:.3g} s; sigma_min(J_e) at least {found.sigma_tip.min():.2g}"
    )


# Weights of the criterion on long runs ---------------------------------------------------------------

_WAY = 100.0  # m that are driven
_CIRCLE = 1.0  # m: radius of the circle on which the heading turns on the way
_POOR = 0.5  # of the conditioning that the rule gives


@check("weights", "the criterion pulls at nothing that grows with the way, and is well conditioned")
def weights(subject: Subject) -> Findings:
    robot, base = subject.robot, subject.robot.platform.base_joints
    if not base:
        return "does not apply: the base is fixed"
    own = dict(zip(robot.joint_names, robot.criterion_weights.tolist(), strict=True))
    rule, heading = heading_weight(robot), base[-1]
    grown = {wheel.joint: _WAY / wheel.radius for wheel in robot.platform.wheels}
    grown |= {heading: _WAY / _CIRCLE} if rule <= DRIVEN else {}
    grown |= dict.fromkeys(base[:-1], _WAY)
    arm = max(own[robot.joint_names[i]] for i in robot.arm_index)
    pulls = {name: own[name] * way for name, way in grown.items()}
    where = f"[criterion] of {subject.name}: see docs/robots.md#the-criterion"
    if pulling := [name for name, pull in pulls.items() if pull > arm]:
        yield warning(
            f"after {_WAY:g} m of way the criterion pulls harder at {some(map(repr, pulling))} than "
            "at a joint of the arm that is a radian from rest, and the longer the way the harder: it "
            "drives the arm into singularities",
            f"set 'platform', 'wheels' and 'heading' to {DRIVEN:g}, {DRIVEN:g} and {rule:g} in {where}",
        )
    by_rule = np.where(np.array(robot.joint_names) == heading, rule, robot.criterion_weights)
    found, best = conditioning(robot, robot.criterion_weights), conditioning(robot, by_rule)
    if found < _POOR * best:
        yield warning(
            f"the criterion is badly conditioned in the tip's null space at rest: {found:.2g}, where "
            f"the heading's weight {own[heading]:g} could be {rule:g} for {best:.2g}",
            f"set 'heading' to {rule:g} in {where}",
        )
    return (
        f"conditioning of the criterion in the tip's null space at rest: {found:.2g}; after {_WAY:g} m "
        f"the platform pulls as {max(pulls.values()) / arm:.1g} rad of the arm do"
    )
