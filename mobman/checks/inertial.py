"""Checks of masses and inertias, of what gravity asks of the motors, and of the joints' limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.checks.checks import Finding, Findings, Link, Subject, check, ok, some, warning, wrong
from mobman.checks.equations import derivative, relative
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.shapes import bounds

_ZERO = 1e-12  # kg m^2
_TRIANGLE = 0.01  # of the largest moment: rounded numbers break the inequality by that much
_LIGHT, _DENSE = 20.0, 20_000.0  # kg/m^3: foam, and gold
_HEAVY = 1e-3  # of the robot's mass: what is lighter may have any density
_OUTSIDE = 0.05  # m, and half the geometry's diagonal
_FEW, _MANY = 0.1, 10_000.0  # kg: masses of robots
_CONDITION, _SINGULAR = 1e8, 1e12  # of M scaled to a diagonal of ones: digits that are lost
_SPREAD = 1e10  # of effective inertias: torsos of 100 kg and fingers of grams are within it


@check("inertias", "masses and inertias are those of bodies that can be")
def inertias(subject: Subject) -> Iterator[Finding]:
    weighing = [link for link in subject.links.values() if link.mass]
    total = float(sum(link.mass or 0.0 for link in weighing))
    m = subject.robot.reduced_inertia(subject.robot.q_rest)
    yield from _masses(subject, np.diag(m))
    yield from _moments(subject, weighing)
    yield from _distribution(weighing, _HEAVY * total)
    yield from _proportions(subject, total, m)
    yield ok(
        f"{total:.4g} kg in {len(weighing)} links; condition of M at rest {np.linalg.cond(m):.2g}"
    )


def _where(links: Iterable[Link]) -> str:
    return some(sorted({link.file for link in links}))


def _named(links: Iterable[Link]) -> str:
    return some(repr(link.name) for link in links)


def _masses(subject: Subject, diagonal: Array) -> Iterator[Finding]:
    """Bodies that move and weigh nothing."""
    model, without = subject.model, {}
    for name in subject.robot.joint_names:
        index, body = model.getJointId(name), subject.links_on(name)
        if name in BASE_JOINTS or model.inertias[index].mass > 0.0 or not body:
            continue
        behind = sum(model.inertias[i].mass for i in list(model.subtrees[index]))
        # a massless link between two joints that cross is common and harmless, if it has no shape
        if behind == 0.0 or any(link.shapes for link in body):
            without[name] = body[0]
    if without:
        where = _where(without.values())
        fix = f"give an <inertial> with <mass> and <inertia> to these links in {where}"
        listing = some(f"link {link.name!r} (joint {name!r})" for name, link in without.items())
        felt = dict(zip(subject.robot.velocity_names, diagonal / diagonal.max(), strict=True))
        suffers = [name for name in without if felt.get(name, 1.0) < _ZERO]
        motors = f"; the motors of {some(suffers)} feel no inertia" if suffers else ""
        yield (wrong if suffers else warning)(f"moves without mass: {listing}{motors}", fix)


def _moments(subject: Subject, weighing: list[Link]) -> Iterator[Finding]:
    spoilt, lacking = set[str](), []
    for joint in subject.robot.joint_names:
        # links that are fixed to others make up one body with them: that is what moves
        body = subject.model.inertias[subject.model.getJointId(joint)]
        if joint in BASE_JOINTS[:2] or not body.mass > 0.0:
            continue
        moments = np.linalg.eigvalsh(np.array(body.inertia))
        if moments[0] < -_ZERO:
            spoilt |= {link.name for link in subject.links_on(joint)}
        elif moments[0] <= _ZERO:
            links = [link for link in subject.links_on(joint) if link.mass]
            text = ", ".join(f"{moment:.3g}" for moment in moments)
            lacking.append(
                warning(
                    f"mass without all moments of inertia ({text}): what joint {joint!r} moves",
                    f"give <inertia> to {_named(links)} in {_where(links)}",
                )
            )
    negative = [link for link in weighing if link.moments[0] < -_ZERO]
    for spoils, grade, consequence in (
        (True, wrong, "which spoils the body that moves"),
        (False, warning, "though not of the bodies that move"),
    ):
        if links := [link for link in negative if (link.name in spoilt) is spoils]:
            yield grade(
                f"negative principal moment of inertia, {consequence}: {_values(links)}",
                f"check the signs and the unit (kg m^2) of <inertia> in {_where(links)}",
            )
    yield from lacking
    sums = [(link, *link.moments) for link in weighing if link.moments[0] >= -_ZERO]
    if odd := [link for link, a, b, c in sums if a + b < (1.0 - _TRIANGLE) * c - _ZERO]:
        yield warning(
            f"two principal moments do not add up to the third: {_values(odd)}",
            f"check <inertia> of these links in {_where(odd)}: no body has such moments",
        )
    massless = [link for link in subject.links.values() if link.mass == 0.0]
    if empty := [link for link in massless if np.any(link.moments > _ZERO)]:
        yield warning(
            f"moments of inertia without mass: links {_named(empty)}",
            f"give <mass> to these links in {_where(empty)}",
        )


def _values(links: list[Link]) -> str:
    numbers = [", ".join(f"{moment:.3g}" for moment in link.moments) for link in links]
    named = zip(links, numbers, strict=True)
    return some((f"link {link.name!r} ({moments})" for link, moments in named), "; ")


def _distribution(weighing: list[Link], floor: float) -> Iterator[Finding]:
    """Densities, and centres of mass that are not in their link; of links of some mass (kg)."""
    heavy, light, outside = dict[str, Link](), dict[str, Link](), dict[str, Link]()
    for link in weighing:
        if not link.solid:
            continue
        mass, (lower, upper) = link.mass or 0.0, bounds(link.solid)
        volume = float(np.prod(upper - lower))  # 0 if it is flat
        size = f"{1e3 * volume:.3g} litres" if volume >= 1e-6 else f"{1e9 * volume:.3g} mm^3"
        text = f"link {link.name!r} weighs {mass:.4g} kg for {size}"
        if volume > 0.0 and mass > _DENSE * volume and mass > floor:
            heavy[text] = link
        elif volume > 0.0 and mass < _LIGHT * volume and volume > floor / _LIGHT:
            light[text] = link
        away = float(np.linalg.norm(link.com - np.clip(link.com, lower, upper)))
        far = max(_OUTSIDE, 0.5 * float(np.linalg.norm(upper - lower)))
        if mass >= floor and away > far:
            outside[f"link {link.name!r} by {away:.3g} m"] = link
    for found, hint in (
        (heavy, "grams instead of kilograms, or geometry in millimetres or of a small part only?"),
        (light, "tonnes instead of kilograms, or a part that was left out?"),
    ):
        if found:
            where = f"{_named(found.values())} in {_where(found.values())}"
            yield warning(some(found, "; "), f"check <mass> of {where} ({hint})")
    if outside:
        yield warning(
            f"centre of mass outside the geometry: {some(outside)}",
            f"check <inertial><origin> of these links in {_where(outside.values())} (millimetres?)",
        )


def _proportions(subject: Subject, total: float, m: Array) -> Iterator[Finding]:
    """The robot's mass, its wheels' over its chassis's, and the reduced inertia M at rest."""
    model, wheels = subject.model, subject.robot.platform.wheels
    if not _FEW <= total <= _MANY:
        found = f"the robot weighs {total:.4g} kg in all"
        yield warning(found, f"check every <mass> in {subject.files} (kg)")
    if wheels:
        chassis = float(model.inertias[model.getJointId("base_theta")].mass)
        masses = {one.joint: model.inertias[model.getJointId(one.joint)].mass for one in wheels}
        if heavy := {joint: mass for joint, mass in masses.items() if mass > chassis}:
            links = [link for joint in heavy for link in subject.links_on(joint)]
            listing = some(f"{joint!r} {mass:.4g} kg" for joint, mass in heavy.items())
            yield warning(
                f"wheels that are heavier than the chassis of {chassis:.4g} kg: {listing}",
                f"check <mass> of {_named(links)} in {_where(links)}",
            )
    diagonal = np.diag(m)
    condition = float(np.linalg.cond(m / np.sqrt(np.outer(diagonal, diagonal))))
    if condition > _CONDITION:
        yield (wrong if condition > _SINGULAR else warning)(
            f"the reduced inertia M at rest has a condition of {condition:.2g}, units aside",
            f"check the <inertial> elements of {subject.files}: a body has hardly any inertia",
        )
    least, most = float(diagonal.min()), float(diagonal.max())
    if most > _SPREAD * least:
        name = subject.robot.velocity_names[int(np.argmin(diagonal))]
        yield warning(
            f"{name!r} feels an inertia of {least:.2g} (kg m^2 or kg), others of {most:.2g}",
            f"check the <inertial> elements of what {name!r} moves in {subject.files}",
        )


# Gravity -----------------------------------------------------------------------------------------------

_GRADIENT = 1e-6
_STEP = 1e-2
_STATES = 5
_PLATFORM = 1e-6  # of the robot's weight, at a lever of 1 m
_EARTH = (9.0, 10.0)  # m/s^2


@check("gravity", "gravity pulls down, and the motors can hold the rest posture")
def gravity(subject: Subject) -> Findings:
    robot = subject.robot
    bias = robot.dynamics(robot.q_rest, np.zeros(robot.nz)).bias
    holding: Array = robot.actuation(robot.q_rest) @ robot.holding_torque(robot.q_rest)
    pull = np.array(subject.model.gravity.linear)
    if np.any(np.abs(pull[:2]) > 1e-9) or not _EARTH[0] <= -pull[2] <= _EARTH[1]:
        yield wrong(
            f"gravity is {pull.round(4).tolist()} m/s^2",
            "set model.gravity to 9.81 m/s^2 along -z: the platform drives on level ground",
        )
    yield from _gradient(subject)
    weight = float(np.linalg.norm(pull)) * sum(float(one.mass) for one in subject.model.inertias)
    # a motion of alpha counts for as much as it moves the coordinates
    size = np.abs(robot.velocity_map(robot.q_rest)[:, : robot.n_alpha]).max(axis=0, initial=0.0)
    if unbalanced := some(
        f"{name} {force:.3g}"
        for name, force, lever in zip(robot.velocity_names, bias, size, strict=False)
        if abs(force) > _PLATFORM * weight * max(float(lever), 1e-12)
    ):
        yield warning(
            f"gravity drives the platform on level ground: {unbalanced} N m or N",
            f"check <inertial><origin> of the wheels in {subject.files}: their centre of mass is "
            "off the axle",
        )
    units = {name: "N m" if subject.turns(name) else "N" for name in robot.joint_names}
    limits = subject.model.effortLimit
    arm = {robot.joint_names[i]: (abs(float(holding[i])), limits[i]) for i in robot.arm_index}
    if weak := some(
        f"joint {name!r} needs {force:.3g} of {effort:.3g} {units[name]}"
        for name, (force, effort) in arm.items()
        if 0.0 < effort < force
    ):
        yield warning(
            f"the motors cannot hold the rest posture: {weak}",
            f"choose another [rest] of {subject.name}, or check <limit effort> of these joints and "
            f"the masses behind them in {subject.files}",
        )
    name = max(arm, key=lambda name: arm[name][0])
    return f"held at rest by at most {arm[name][0]:.3g} {units[name]}, of joint {name!r}"


def _gradient(subject: Subject) -> Iterator[Finding]:
    robot, worst, data = subject.robot, 0.0, subject.model.createData()

    def potential(q: Array, q_dot: Array, s: float) -> Array:
        return np.array([pin.computePotentialEnergy(subject.model, data, q + s * q_dot)])

    for q, z in subject.states(_STATES):
        q_dot, (_, bias, _) = robot.velocity_map(q) @ z, robot.dynamics(q, np.zeros(robot.nz))
        step = _STEP / max(1.0, float(np.abs(q_dot).max()))
        rise = derivative(partial(potential, q, q_dot), step)
        worst = max(worst, relative(np.array([bias @ z]), rise))
    if worst > _GRADIENT:
        yield wrong(
            f"the gravity term differs from the potential energy's gradient by {worst:.2g} of it",
            f"check the <inertial> elements of {subject.files} and the platform's N",
        )


# Limits ------------------------------------------------------------------------------------------------

_UNBOUNDED = 1e8  # what continuous joints have is above it
_NEAR = 0.01  # of the range
_TURNS = 4.0 * math.pi  # rad: joints that turn further are rare, limits in degrees are not
_SLIDES = 10.0  # m: the same for limits in millimetres
_FAST = 50.0  # rad/s: joints of arms that are faster are rare, limits in degrees a second are not
_STEERING = 0.5 * math.pi - 1e-3  # rad
_STEEP = 1e6  # times the entries of N at rest: a singularity


@check("limits", "limits are there, in radians and metres, and the rest posture is inside them")
def limits(subject: Subject) -> Findings:
    model = subject.model
    bounds = zip(model.lowerPositionLimit.tolist(), model.upperPositionLimit.tolist(), strict=True)
    ends = dict(zip(subject.robot.joint_names, bounds, strict=True))
    for part in (_rest, _missing, _units, _steering):
        yield from part(subject, ends)
    return "positions, velocities and efforts are limited, and rest is inside"


_Ends = dict[str, tuple[float, float]]  # position limits by joint (m, rad)


def _rest(subject: Subject, ends: _Ends) -> Iterator[Finding]:
    near, rests = [], subject.robot.q_rest.tolist()
    for (name, (lower, upper)), rest in zip(ends.items(), rests, strict=True):
        span, margin = upper - lower, min(rest - lower, upper - rest)
        if span <= 0.0:
            yield wrong(
                f"joint {name!r} cannot move: its limits are {lower:g} and {upper:g}",
                f"check <limit lower upper> of joint {name!r} in the URDF, or lock it in 'urdf.lock'",
            )
        elif not margin >= 0.0:
            yield wrong(
                f"joint {name!r} rests at {rest:.4g}, outside {lower:.4g} to {upper:.4g}",
                f"choose another field 'rest.{name}' of {subject.name}",
            )
        elif span < _UNBOUNDED and margin < _NEAR * span:
            near.append(f"joint {name!r} at {rest:.4g} of {lower:.4g} to {upper:.4g}")
    if near:
        yield warning(
            f"rests at a limit: {some(near)}",
            f"move it away from there in [rest] of {subject.name}: nothing stops a joint there",
        )


def _missing(subject: Subject, ends: _Ends) -> Iterator[Finding]:
    robot, model = subject.robot, subject.model
    driven = np.any(robot.actuation(robot.q_rest) != 0.0, axis=1)  # front wheels of cars are not
    without = (*BASE_JOINTS, *robot.platform.virtual_joints)
    for kind, values, needed in (
        ("velocity", model.velocityLimit, np.ones(robot.nq, dtype=bool)),
        ("effort", model.effortLimit, driven),
    ):
        if lacking := some(
            repr(name)
            for name, value, wanted in zip(ends, values, needed, strict=True)
            if name not in without and wanted and not 0.0 < value < math.inf
        ):
            yield warning(
                f"no {kind} limit: joints {lacking}",
                f"give {kind} in <limit> of these joints in the URDF, if it is to be compared with",
            )


def _units(subject: Subject, ends: _Ends) -> Iterator[Finding]:
    robot = subject.robot
    wheels = {wheel.joint for wheel in robot.platform.wheels}
    for i, (name, both) in enumerate(ends.items()):
        if name in BASE_JOINTS:
            continue
        largest = max((abs(end) for end in both if abs(end) < _UNBOUNDED), default=0.0)
        turns, limit = subject.turns(name), f"of joint {name!r} in the URDF"
        # wheels turn on and on: huge limits are how some exporters write that
        if name not in wheels and largest > (_TURNS if turns else _SLIDES):
            unit, other = ("rad", "degrees") if turns else ("m", "millimetres")
            yield warning(
                f"joint {name!r} has a limit of {largest:g} {unit}",
                f"check <limit> {limit}: {other} instead of {unit}?",
            )
        speed = float(subject.model.velocityLimit[i])
        if turns and i in robot.arm_index and _FAST < speed < _UNBOUNDED:
            yield warning(
                f"joint {name!r} may turn at {speed:g} rad/s",
                f"check <limit velocity> {limit}: degrees instead of rad?",
            )
        if turns and largest == 0.0 and abs(robot.q_rest[i]) > _TURNS:
            yield warning(
                f"joint {name!r} rests at {robot.q_rest[i]:g} rad",
                f"check field 'rest.{name}' of {subject.name}: degrees instead of rad?",
            )


def _steering(subject: Subject, ends: _Ends) -> Iterator[Finding]:
    platform, x = subject.robot.platform, subject.robot.q_rest[subject.robot.platform_index]
    across = np.where(np.isin(platform.coordinates, subject.steering), 0.5 * math.pi, x)
    sizes = [float(np.abs(platform.velocity_map(at)).max(initial=0.0)) for at in (x, across)]
    if not sizes[1] > _STEEP * sizes[0]:
        return  # nothing is singular there
    for name in subject.steering:
        largest = max(abs(ends[name][0]), ends[name][1])
        if largest >= _STEERING:
            limit = f"{largest:.4g} rad" if largest < _UNBOUNDED else "any angle"
            yield warning(
                f"steering joint {name!r} may turn to {limit}; at pi/2 the model is singular",
                f"limit joint {name!r} in the URDF to what the mechanism can do, below 1.57 rad",
            )
