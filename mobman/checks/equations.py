"""Checks of the equations: constraints, criterion, singularities, and derivatives by differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mobman.arrays import Array
from mobman.checks.checks import Finding, Findings, Subject, check, some, warning, wrong
from mobman.errors import SingularityError
from mobman.model.build import assemble, not_coupled
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.task_map import TaskMap
from mobman.tasks.singular import least_singular_value

_STATES = 50
_RESIDUAL = 1e-9  # of the largest products in A N
_RANK = 1e-8  # of the largest singular value
_SLIP = 5e-3  # of the platform's speed (of the rim's, when it turns): what crooked axes make


@check("constraints", "A N = 0 with full ranks, and wheels that roll where the platform goes")
def constraints(subject: Subject) -> Findings:
    robot, residual = subject.robot, 0.0
    l, p = len(robot.platform_index), robot.n_alpha
    if l == 0:
        return "does not apply: the base is fixed"
    ranks: dict[str, set[int]] = {"A": set(), "N": set()}
    for q, _ in subject.states(_STATES):
        x = q[robot.platform_index]
        a, n = robot.platform.constraint_matrix(x), robot.platform.velocity_map(x)
        size = float(np.max(np.abs(a) @ np.abs(n), initial=0.0)) or 1.0
        residual = max(residual, float(np.max(np.abs(a @ n), initial=0.0)) / size)
        for name, matrix in (("A", a), ("N", n)):
            ranks[name].add(int(np.linalg.matrix_rank(matrix, rtol=_RANK)) if matrix.size else 0)
    fix = f"check [platform] of {subject.name} (type {robot.spec.platform.type!r})"
    if not residual <= _RESIDUAL:
        yield wrong(f"A N is not 0 but up to {residual:.2g} of its terms, at random states", fix)
    for (name, found), full in zip(ranks.items(), (l - p, p), strict=True):
        if found != {full}:
            listing = ", ".join(map(str, sorted(found)))
            yield wrong(f"{name} has rank {listing} at random states; needed: {full}", fix)
    yield from _rolling(subject)
    wheels = ", ".join(f"{w.joint} (R = {w.radius:g} m)" for w in robot.platform.wheels)
    return (
        f"A ({l - p} x {l}) of rank {l - p}, N ({l} x {p}) of rank {p}, |A N| below {residual:.1g} of "
        f"its terms; wheels: {wheels or 'none among the coordinates'}"
    )


def _rolling(subject: Subject) -> Iterator[Finding]:
    """Motion of the wheels' lowest points when the platform drives ahead, and when it turns."""
    robot, kind, up = subject.robot, subject.robot.spec.platform.type, np.array([0.0, 0.0, 1.0])
    if kind == "omnidirectional":  # rollers slide: their equations say how
        return
    n = robot.platform.velocity_map(subject.home[robot.platform_index])

    def slips(rows: list[int], wanted: list[float]) -> Iterator[tuple[str, float, float]]:
        """Velocity of each wheel's lowest point along it (m/s), by the URDF's kinematics, and its
        distance from the middle (m), at a motion of the platform."""
        q_dot = np.zeros(robot.nq)
        q_dot[robot.platform_index] = n @ np.linalg.lstsq(n[rows], np.array(wanted), rcond=None)[0]
        for wheel in robot.platform.wheels:
            motion = subject.jacobian(wheel.joint) @ q_dot
            forward = np.cross(subject.axis(wheel.joint), up)
            rim = motion[:3] + np.cross(motion[3:], -wheel.radius * up)
            track = abs(float(subject.centre(wheel.joint)[1]))
            yield wheel.joint, float(forward / np.linalg.norm(forward) @ rim), track

    for joint, slip, _ in slips([0, 1, 2], [1.0, 0.0, 0.0]):
        if abs(slip) > _SLIP:
            yield wrong(
                f"wheel {joint!r} slips by {slip:+.3g} m/s when the platform drives at 1 m/s",
                f"check fields 'platform.heading' and 'platform.wheel_radius' of {subject.name}, and "
                f"<axis> of joint {joint!r} in the URDF",
            )
    if kind != "differential":  # skid-steering slips when it turns, a car cannot turn on the spot
        return
    for joint, slip, track in slips([0, 2], [0.0, 1.0]):
        if abs(slip) > _SLIP * track:
            yield warning(
                f"wheel {joint!r} slips by {slip:+.3g} m/s when the platform turns at 1 rad/s: it is "
                f"{track:.4g} m from the middle",
                f"remove field 'platform.half_track' of {subject.name}, or set it to {track:.4g}, "
                "unless the track was identified on the ground",
            )


# Joints that follow others -----------------------------------------------------------------------------

_COUPLED = 10  # states


@check("following", "joints that follow others (<mimic>) move with them, or are held off the way")
def following(subject: Subject) -> Findings:
    robot, assembly = subject.robot, assemble(subject.robot.spec, subject.robot.urdf)
    above: dict[str, tuple[str, str]] = {}  # each link's joint and the link before it
    mimics = []
    for joint in assembly.robot.findall("joint"):  # not those of transmissions
        name = joint.get("name", "")
        parent, child = (next(joint.iter(end)).get("link", "") for end in ("parent", "child"))
        above[child] = (name, parent)
        mimics += [name] if joint.find("mimic") is not None else []
    if not mimics:
        return "does not apply: no joint follows another"
    on_the_way, link = set[str](), robot.tip
    while link in above:
        joint_before, link = above[link]
        on_the_way.add(joint_before)
    held = [name for name in mimics if name in assembly.locked]
    if cut := [name for name in held if name in on_the_way]:
        yield warning(
            f"the tip loses the motion of {some(map(repr, cut))}: held, though <mimic> moves it",
            f"remove it, and what it follows, from field 'urdf.lock' of {subject.name}",
        )
    states = [q for q, _ in subject.states(_COUPLED)]
    apart = (fault for q in states for fault in not_coupled(robot, assembly.following, q))
    if fault := next(apart, None):
        yield wrong(
            fault,
            f"choose another 'platform.type' of {subject.name}, or remove <mimic> in the URDF where "
            "each has a motor of its own",
        )
    said = [
        f"{one.joint!r} follows {one.of!r} at {one.ratio:g} of its rate"
        for one in assembly.following
    ]
    said += [f"{some(map(repr, held))} held"] if held else []
    return "; ".join(said)


# Criterion ---------------------------------------------------------------------------------------------

_STEERED = 10  # states
_NONE = 1e-9  # of the largest entry: rounding
_TURN = 0.1  # rad: by which a coordinate is moved to see whether the platform then drives elsewhere


@check("criterion", "what steers the platform without moving the tip is coupled to something")
def criterion(subject: Subject) -> Findings:
    robot, steering = subject.robot, _steering(subject)
    if not steering:
        return "does not apply: the platform has no steering that leaves the tip where it is"
    others = [i for i in range(robot.nq) if i not in steering]
    named = some(repr(robot.joint_names[i]) for i in steering)
    if np.any(robot.criterion_couplings[np.ix_(steering, others)] != 0.0):
        return f"the steering ({named}) is coupled to other coordinates"
    # the arm's first joint about the vertical at rest that moves the tip, or else its first joint
    supports = subject.model.supports[subject.model.getJointId(subject.carrier)]
    moving = {subject.model.joints[i].idx_q for i in supports}
    arm: list[str] = [robot.joint_names[i] for i in robot.arm_index if i in moving]
    yaw = next((name for name in arm if subject.upright(name)), arm[0])
    yield warning(
        f"the steering is held at rest: turning {named} moves no tip at once, and the criterion "
        "without couplings has its least where they rest, so that the platform drives straight on",
        f"couple them to {yaw!r} (or another joint of the arm) by 'couplings' in [criterion] "
        f"of {subject.name}: see docs/platforms.md#car-like",
    )
    return ""


def _steering(subject: Subject) -> list[int]:
    """Coordinates of the platform that change how it drives, by velocities that move no tip."""
    robot = subject.robot
    states = [q for q, _ in subject.states(_STEERED)]
    maps = [robot.velocity_map(q)[:, : robot.n_alpha] for q in states]
    # what each alpha does to the coordinates, and to the tip, at most
    moves = np.max(np.abs(maps), axis=0)
    speeds = [robot.tip_jacobian(q)[:3] @ c for q, c in zip(states, maps, strict=True)]
    tips = np.max(np.abs(speeds), axis=(0, 1))
    still = tips <= _NONE * max(1.0, float(tips.max(initial=0.0)))

    def changes_the_way(q: Array, i: int) -> bool:
        turned = q.copy()
        turned[i] += _TURN
        before, after = robot.velocity_map(q), robot.velocity_map(turned)
        return bool(np.abs(after - before).max() > _NONE * np.abs(before).max())

    # of knuckles that turn alike one is in the equations, and all are the steering
    steers = np.zeros(robot.n_alpha, dtype=bool)
    for a in np.flatnonzero(still):
        moved = np.flatnonzero(moves[:, a]).tolist()
        steers[a] = any(changes_the_way(q, i) for q in states for i in moved)
    own = np.any(moves[:, steers] > 0.0, axis=1) & ~np.any(moves[:, ~steers] > 0.0, axis=1)
    return [int(i) for i in robot.platform_index if own[i]]


# Singularities -----------------------------------------------------------------------------------------

_POSTURES = 200
_ROUNDING = 1e-5  # of the largest singular value at rest: rounding and a URDF's digits
_NEARLY = 0.02  # of the smallest at the best posture: an elbow bent by a degree or two
_UNEQUAL = 1e-8  # conditioning that leaves half the digits of a double
_MANY = 0.25  # of the random postures


@check("singularities", "the tip can be moved every way at rest, and the criterion tells the rest")
def singularities(subject: Subject) -> Findings:
    robot, m = subject.robot, TaskMap().m
    if few := subject.few:
        return few
    states = [robot.q_rest, *(q for q, _ in subject.states(_POSTURES))]
    tips = [least_singular_value(robot.tip_jacobian(q)[:m] @ robot.velocity_map(q)) for q in states]
    remarks = list(_posture(subject, states, tips))
    yield from remarks
    if any(remark.status == "wrong" for remark in remarks):
        return ""  # the extended Jacobian is singular with the tip's
    extended = ExtendedJacobian(robot, TaskMap(), Posture.of(robot))
    at_rest, *elsewhere = (_conditioning(extended, q, m) for q in states)
    share = float(np.mean(np.array(elsewhere) <= _UNEQUAL))
    fix = f"check [criterion] of {subject.name}: weights that are too small or too unequal"
    if at_rest <= _UNEQUAL:
        yield warning(
            "the criterion makes the extended Jacobian J nearly singular at rest: conditioning "
            f"{at_rest:.2g} once its two parts are of one size",
            fix,
        )
    elif share > _MANY:
        yield warning(
            f"the extended Jacobian J is nearly singular at {100.0 * share:.0f} % of random postures "
            f"(conditioning below {_UNEQUAL:g})",
            fix,
        )
    return (
        f"smallest singular value of the tip's Jacobian J_f C at rest: {tips[0]:.2g}; conditioning "
        f"of the extended Jacobian: {at_rest:.2g} at rest, {np.median(elsewhere):.2g} at random "
        "postures (median)"
    )


def _posture(subject: Subject, states: list[Array], tips: list[float]) -> Iterator[Finding]:
    """Check that the tip can be moved every way at rest, by all joints and by the arm's alone."""
    robot, m = subject.robot, TaskMap().m
    bend = "bend the elbow, keep axes from lining up"
    fix = f"choose another posture in [rest] of {subject.name}: {bend}"
    largest = np.linalg.norm(robot.tip_jacobian(states[0])[:m] @ robot.velocity_map(states[0]), 2)
    rounding, best = _ROUNDING * float(largest), max(tips)
    if best <= rounding:
        yield wrong(
            "the tip's Jacobian J_f C is singular at rest and at every random posture: some way of the "
            "tip is none that these joints move it",
            f"check 'arm.tip' and what is held in 'urdf.lock' of {subject.name}",
        )
        return
    found = f"smallest singular value {{:.2g}}, {{:.2g}} at the best of {len(states)} postures"
    if tips[0] <= max(rounding, _NEARLY * best):
        grade, how = (wrong, "") if tips[0] <= rounding else (warning, "nearly ")
        values = found.format(tips[0], best)
        yield grade(f"the tip's Jacobian J_f C is {how}singular at rest: {values}", fix)
        return
    arm = [least_singular_value(robot.tip_jacobian(q)[:m, robot.arm_index]) for q in states]
    # an arm that moves its tip in a plane only does no better anywhere
    if max(arm) > rounding and arm[0] <= _NEARLY * max(arm):
        values = found.format(arm[0], max(arm))
        without = "without the platform it cannot move the tip every way"
        yield warning(f"the arm is singular at rest, {without}: {values}", fix)


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
    return 1.0 / float(np.linalg.cond(scaled))


# Derivatives -------------------------------------------------------------------------------------------

_COMPARED = 6  # states
_TOLERANCE = 1e-5
_STEP = 4e-3  # rad or m of the fastest coordinate
_SHORT = 5e-4  # the same, for f_a, which bends sharply near singular postures
_REGULAR = 1e-3  # singular value of [J_f; A] below which it does so too sharply for any step
_REGULAR_TURNING = 2e-2  # the same with the rows of an orientation
_MAPS = (TaskMap(), TaskMap((0, 1, 2, 3, 4, 5)), TaskMap(axis=(0.0, 0.0, 1.0)))


@check("derivatives", "Jacobians and rates agree with finite differences at random states")
def derivatives(subject: Subject) -> Findings:
    worst: dict[str, float] = {}
    for q, z in subject.states(_COMPARED):
        for name, error in _differences(subject, q, z):
            worst[name] = float(np.maximum(worst.get(name, 0.0), error))  # a NaN stays
    if bad := [
        f"{name} by {error:.2g}" for name, error in worst.items() if not error <= _TOLERANCE
    ]:
        yield wrong(
            f"disagree with finite differences: {some(bad)}, relative",
            f"check the platform's A, N and their derivatives (type "
            f"{subject.robot.spec.platform.type!r}) of {subject.name}, and that its numbers are of a "
            "size that doubles can carry",
        )
    return f"{', '.join(worst)}: agree to {max(worst.values()):.1g} or better"


def _differences(subject: Subject, q: Array, z: Array) -> Iterator[tuple[str, float]]:
    robot = subject.robot
    q_dot, tip = robot.velocity_map(q) @ z, robot.tip_kinematics(q, z)
    fastest = max(1.0, float(np.abs(q_dot).max()))

    def along(function: Callable[[Array], Array], step: float = _STEP) -> Array:
        return derivative(lambda s: function(q + s * q_dot), step / fastest)

    speed = along(lambda here: np.array(robot.tip_pose(here).translation))
    yield "tip Jacobian", relative(tip.jacobian[:3] @ q_dot, speed)
    yield "its rate", relative(tip.jacobian_rate, along(robot.tip_jacobian))
    yield "C'", relative(robot.velocity_map_rate(q, z), along(robot.velocity_map))
    yield "A'", relative(robot.constraint_matrix_rate(q, q_dot), along(robot.constraint_matrix))
    for task_map in _MAPS:
        rows = np.vstack([task_map.jacobian(tip), robot.constraint_matrix(q)])
        regular = _REGULAR if task_map.m == 3 else _REGULAR_TURNING
        if robot.nz >= task_map.m and np.linalg.svd(rows, compute_uv=False)[-1] >= regular:
            extended = ExtendedJacobian(robot, task_map, Posture.of(robot))
            yield from _extended(extended, task_map.m, q, z, along)


def _extended(
    extended: ExtendedJacobian, m: int, q: Array, z: Array, along: Callable[..., Array]
) -> Iterator[tuple[str, float]]:
    """J z against p' and J' z against the rate of J z at constant z, in axes carried from q.

    An orientation has no coordinates, but rates.
    """
    extended.at(q, z)
    axes, J, J_dot_z = extended.complement.copy(), extended.J.copy(), extended.J_dot_z.copy()

    def at(here: Array) -> ExtendedJacobian:
        extended.complement[:] = axes
        extended.at(here, z)
        return extended

    try:
        p_dot = along(lambda here: at(here).f.copy(), _SHORT)
        p_ddot = along(lambda here: at(here).J @ z, _SHORT)
    except SingularityError:
        return
    coordinates = [i for i in range(len(z)) if not 3 <= i < m]
    yield "J", relative((J @ z)[coordinates], p_dot[coordinates])
    yield "J' z", relative(J_dot_z, p_ddot)


def derivative(function: Callable[[float], Array], step: float) -> Array:
    """d function(s)/ds at s = 0, by central differences of order 8 that reach nine digits: the
    truncation error is h^8/630 times the ninth derivative."""
    weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    terms = [weight * (function(i * step) - function(-i * step)) for i, weight in weights]
    return np.asarray(np.sum(terms, axis=0) / step)


def relative(found: Array, expected: Array) -> float:
    """Largest difference of two arrays over the largest entry of either, or over 1."""
    sizes = [np.abs(part).max(initial=0.0) for part in (found - expected, found, expected)]
    return float(sizes[0] / max(1.0, *sizes[1:]))
