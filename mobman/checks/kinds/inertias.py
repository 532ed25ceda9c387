"""Masses and inertias, link by link."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobman.arrays import Array
from mobman.checks.check import Remark, check, ok, some, warning, wrong
from mobman.checks.links import Link
from mobman.checks.subject import Subject
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.shapes import bounds

_ZERO = 1e-12  # kg m^2
_TRIANGLE = 0.01  # of the largest moment: rounded numbers break the inequality by that much
_LIGHT, _DENSE = 20.0, 20_000.0  # kg/m^3: foam, and gold
_HEAVY = 1e-3  # of the robot's mass: what is lighter may have any density
_OUTSIDE = 0.05  # m, and half the geometry's diagonal
_FEW, _MANY = 0.1, 10_000.0  # kg: masses of robots
_CONDITION, _SINGULAR = 1e8, 1e12  # of M scaled to a diagonal of ones: digits that are lost
_SPREAD = 1e10  # of what the motors feel: torsos of 100 kg and fingers of grams are within it


@check("inertias", "masses and inertias are those of bodies that can be")
def inertias(subject: Subject) -> Iterator[Remark]:
    remarks = [
        *_masses(subject),
        *_moments(subject),
        *_densities(subject),
        *_centres(subject),
        *_proportions(subject),
        *_condition(subject),
    ]
    yield from remarks
    robot = subject.robot
    yield ok(
        f"{_total(subject):.4g} kg in {len(_weighing(subject))} links; condition of M at rest "
        f"{np.linalg.cond(robot.reduced_inertia(robot.q_rest)):.2g}"
    )


def _total(subject: Subject) -> float:
    return float(sum(link.mass or 0.0 for link in subject.links.values()))


def _weighing(subject: Subject) -> list[Link]:
    return [link for link in subject.links.values() if link.mass]


def _where(subject: Subject, links: list[Link]) -> str:
    return some(sorted({subject.file_of(link.name) for link in links}))


def _named(links: list[Link]) -> str:
    return some([repr(link.name) for link in links])


def _masses(subject: Subject) -> Iterator[Remark]:
    """Bodies that move and weigh nothing."""
    robot, model = subject.robot, subject.robot.model
    without = []
    for name in robot.joint_names:
        index = model.getJointId(name)
        body = subject.links_on(name)
        if name in BASE_JOINTS or model.inertias[index].mass > 0.0 or not body:
            continue
        behind = sum(model.inertias[i].mass for i in list(model.subtrees[index]))
        # a massless link between two joints that cross is common and harmless, if it has no shape
        if behind == 0.0 or any(link.shapes for link in body):
            without.append((name, body[0]))
    if not without:
        return
    listing = some([f"link {link.name!r} (joint {name!r})" for name, link in without])
    links = [link for _, link in without]
    fix = f"give an <inertial> with <mass> and <inertia> to these links in {_where(subject, links)}"
    diagonal = np.diag(robot.reduced_inertia(robot.q_rest))
    found = f"moves without mass: {listing}"
    suffers = [
        name
        for name, _ in without
        if name in robot.velocity_names
        and diagonal[robot.velocity_names.index(name)] < _ZERO * float(diagonal.max())
    ]
    if suffers:
        yield wrong(f"{found}; the motors of {some(suffers)} feel no inertia", fix)
    else:
        yield warning(found, fix)


def _moments(subject: Subject) -> Iterator[Remark]:
    weighing = _weighing(subject)
    negative = [link for link in weighing if link.moments[0] < -_ZERO]
    impossible = [
        link
        for link in weighing
        if link.moments[0] >= -_ZERO
        and link.moments[0] + link.moments[1] < (1.0 - _TRIANGLE) * link.moments[2] - _ZERO
    ]
    empty = [
        link for link in subject.links.values() if link.mass == 0.0 and np.any(link.moments > _ZERO)
    ]
    # links that are fixed to others make up one body with them: that is what moves
    spoilt = {
        link.name
        for joint, moments in _bodies(subject).items()
        if moments[0] < -_ZERO
        for link in subject.links_on(joint)
    }
    for links, grade, consequence in (
        (
            [link for link in negative if link.name in spoilt],
            wrong,
            "which spoils the body that moves",
        ),
        (
            [link for link in negative if link.name not in spoilt],
            warning,
            "though not of the bodies that move",
        ),
    ):
        if links:
            yield grade(
                f"negative principal moment of inertia, {consequence}: {_values(links)}",
                f"check the signs and the unit (kg m^2) of <inertia> in {_where(subject, links)}",
            )
    for joint, moments in _bodies(subject).items():
        if abs(moments[0]) > _ZERO:
            continue
        links = [link for link in subject.links_on(joint) if link.mass]
        text = ", ".join(f"{moment:.3g}" for moment in moments)
        yield warning(
            f"mass without all moments of inertia ({text}): what joint {joint!r} moves",
            f"give <inertia> to {_named(links)} in {_where(subject, links)}",
        )
    if impossible:
        yield warning(
            f"two principal moments do not add up to the third: {_values(impossible)}",
            f"check <inertia> of these links in {_where(subject, impossible)}: no body has such moments",
        )
    if empty:
        yield warning(
            f"moments of inertia without mass: links {_named(empty)}",
            f"give <mass> to these links in {_where(subject, empty)}",
        )


def _bodies(subject: Subject) -> dict[str, Array]:
    """Principal moments of what each joint moves and has mass, ascending (kg m^2), shape (3,)."""
    model = subject.robot.model
    bodies = {}
    for name in subject.robot.joint_names:
        body = model.inertias[model.getJointId(name)]
        if name not in BASE_JOINTS[:2] and body.mass > 0.0:
            bodies[name] = np.linalg.eigvalsh(np.array(body.inertia))
    return bodies


def _values(links: list[Link]) -> str:
    return some(
        [f"link {link.name!r} ({', '.join(f'{m:.3g}' for m in link.moments)})" for link in links],
        "; ",
    )


def _densities(subject: Subject) -> Iterator[Remark]:
    heavy, light, floor = [], [], _HEAVY * _total(subject)
    for link in _weighing(subject):
        if not link.solid or not link.mass:
            continue
        lower, upper = bounds(link.solid)
        volume = float(np.prod(upper - lower))
        if volume <= 0.0:
            continue  # flat
        text = f"link {link.name!r} weighs {link.mass:.4g} kg for {_litres(volume)}"
        if link.mass > _DENSE * volume and link.mass > floor:
            heavy.append((link, text))
        elif link.mass < _LIGHT * volume and volume > floor / _LIGHT:
            light.append((link, text))
    for found, hint in (
        (heavy, "grams instead of kilograms, or geometry in millimetres or of a small part only?"),
        (light, "tonnes instead of kilograms, or a part that was left out?"),
    ):
        if found:
            links = [link for link, _ in found]
            yield warning(
                some([text for _, text in found], "; "),
                f"check <mass> of {_named(links)} in {_where(subject, links)} ({hint})",
            )


def _litres(volume: float) -> str:
    return f"{1e3 * volume:.3g} litres" if volume >= 1e-6 else f"{1e9 * volume:.3g} mm^3"


def _centres(subject: Subject) -> Iterator[Remark]:
    """Centres of mass that are not in their link."""
    outside = []
    for link in _weighing(subject):
        if not link.solid or (link.mass or 0.0) < _HEAVY * _total(subject):
            continue
        lower, upper = bounds(link.solid)
        away = float(
            np.linalg.norm(np.maximum(0.0, np.maximum(lower - link.com, link.com - upper)))
        )
        if away > max(_OUTSIDE, 0.5 * float(np.linalg.norm(upper - lower))):
            outside.append((link, f"link {link.name!r} by {away:.3g} m"))
    if outside:
        links = [link for link, _ in outside]
        yield warning(
            f"centre of mass outside the geometry: {some([text for _, text in outside])}",
            f"check <inertial><origin> of these links in {_where(subject, links)} (millimetres?)",
        )


def _proportions(subject: Subject) -> Iterator[Remark]:
    robot, model, total = subject.robot, subject.robot.model, _total(subject)
    if not _FEW <= total <= _MANY:
        yield warning(
            f"the robot weighs {total:.4g} kg in all", f"check every <mass> in {subject.files} (kg)"
        )
    if not robot.platform.wheels or len(robot.platform_index) == 0:
        return
    chassis = float(model.inertias[model.getJointId("base_theta")].mass)
    heavy = [
        wheel.joint
        for wheel in robot.platform.wheels
        if model.inertias[model.getJointId(wheel.joint)].mass > chassis
    ]
    if heavy:
        links = [link for joint in heavy for link in subject.links_on(joint)]
        masses = some(
            [f"{joint!r} {model.inertias[model.getJointId(joint)].mass:.4g} kg" for joint in heavy]
        )
        yield warning(
            f"wheels that are heavier than the chassis of {chassis:.4g} kg: {masses}",
            f"check <mass> of {_named(links)} in {_where(subject, links)}",
        )


def _condition(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    m = robot.reduced_inertia(robot.q_rest)
    scale = np.sqrt(np.diag(m))
    condition = float(np.linalg.cond(m / np.outer(scale, scale)))
    if condition > _CONDITION:
        text = f"the reduced inertia M at rest has a condition of {condition:.2g}, units aside"
        fix = f"check the <inertial> elements of {subject.files}: a body has hardly any inertia"
        yield (wrong if condition > _SINGULAR else warning)(text, fix)
    diagonal = np.diag(m)
    if float(diagonal.max()) > _SPREAD * float(diagonal.min()):
        name = robot.velocity_names[int(np.argmin(diagonal))]
        yield warning(
            f"{name!r} feels an inertia of {diagonal.min():.2g} (kg m^2 or kg), others of "
            f"{diagonal.max():.2g}",
            f"check the <inertial> elements of what {name!r} moves in {subject.files}",
        )
