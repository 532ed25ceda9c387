"""What stands on the ground, and what is below it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mobman.checks.check import (
    Remark,
    check,
    does_not_apply,
    named_wheels,
    ok,
    some,
    warning,
    wrong,
)
from mobman.checks.links import Link
from mobman.checks.subject import Subject
from mobman.model.platforms.platform import Wheel

_LEVEL = 1e-3  # m: how far an axle may be from its wheel's radius
_BELOW = 5e-3  # m: casters and covers are often drawn a little too low
_FAR_BELOW = 5e-2  # m
_FLOATING = 2e-2  # m
_UNSEEN = 0.2  # m: the same where the platform's wheels are not known, and perhaps not drawn
_TILT = math.sin(math.radians(1.0))


@check("ground", "all wheels stand on one ground, right and left, and nothing is below it")
def ground(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    if len(robot.platform_index) == 0:
        yield does_not_apply("the base is fixed: the ground is wherever its user has it")
        return
    remarks = list(_levels(subject))
    remarks += [remark for wheel in robot.platform.wheels for remark in _wheel(subject, wheel)]
    lowest = {link.name: _lowest(subject, link) for link in subject.links.values() if link.solid}
    remarks += _heights(subject, lowest)
    yield from remarks
    if not remarks:
        count = len(robot.platform.wheels)
        wheels = f"{count} wheels on the ground" if count else "no wheels among the coordinates"
        if not lowest:
            yield ok(f"{wheels}; there is no geometry to look at")
            return
        name = min(lowest, key=lowest.__getitem__)
        yield ok(f"{wheels}; lowest is link {name!r} at {round(1e3 * lowest[name], 1) + 0.0:g} mm")


def _levels(subject: Subject) -> Iterator[Remark]:
    """Wheels that do not stand on the ground, those of one height together."""
    heights: dict[str, list[Wheel]] = {}
    for wheel in subject.robot.platform.wheels:
        height = float(subject.centre(wheel.joint)[2]) - wheel.radius
        if abs(height) > _LEVEL:
            heights.setdefault(f"{1e3 * height:+.1f}", []).append(wheel)
    for millimetres, wheels in heights.items():
        joints = [wheel.joint for wheel in wheels]
        links = [repr(link.name) for joint in joints for link in subject.links_on(joint)]
        each = "its" if len(joints) == 1 else "each one's"
        yield wrong(
            f"{named_wheels(joints)}: {each} lowest point is {millimetres} mm from the ground",
            f"check <origin> of joint {', '.join(map(repr, joints))} (link {some(links)}), and "
            f"field 'platform.wheel_radius' of robot {subject.robot.name!r}",
        )


def _wheel(subject: Subject, wheel: Wheel) -> Iterator[Remark]:
    centre, axis = subject.centre(wheel.joint), subject.axis(wheel.joint)
    if abs(float(axis[2])) > _TILT:
        yield wrong(
            f"wheel {wheel.joint!r}: its axis is {axis.round(3).tolist()}, not horizontal",
            f"check <axis> and <origin> of joint {wheel.joint!r} in the URDF",
        )
    y, words = float(centre[1]), wheel.joint.lower()
    for word, side in (("left", 1.0), ("right", -1.0)):
        other = "right" if word == "left" else "left"
        if word in words and other not in words and side * y < -_LEVEL:
            yield warning(
                f"wheel {wheel.joint!r} is on the {other}, {abs(y):.3g} m from the middle",
                f"check field 'platform.heading' of robot {subject.robot.name!r}: forward may be "
                "backward",
            )


def _heights(subject: Subject, lowest: dict[str, float]) -> Iterator[Remark]:
    platform = {link.name for link in subject.platform_links}
    low = {name: z for name, z in lowest.items() if z < -_BELOW}
    named = some([f"link {name!r} at {1e3 * z:+.0f} mm" for name, z in low.items()])
    fix = _height_fix(subject)
    if any(z < -_FAR_BELOW for name, z in low.items() if name in platform):
        yield wrong(f"geometry below the ground: {named}", fix)
    elif low:
        if not set(low) & platform:
            fix = f"choose another posture in [rest] of robot {subject.robot.name!r}"
        yield warning(f"geometry below the ground at rest: {named}", fix)
    standing = [z for name, z in lowest.items() if name in platform]
    most = _FLOATING if subject.robot.platform.wheels else _UNSEEN
    if standing and (least := min(standing)) > most:
        yield warning(
            f"the platform's lowest geometry is {1e3 * least:.0f} mm above the ground", fix
        )


def _height_fix(subject: Subject) -> str:
    name, kind = subject.robot.name, subject.robot.spec.platform.type
    if kind == "unicycle":
        return f"set field 'platform.height' of robot {name!r} to the root link's height"
    if kind == "custom":
        return f"check root_offset of the platform's definition of robot {name!r}"
    return f"check field 'platform.wheel_radius' of robot {name!r} and <origin> of these links' geometry"


def _lowest(subject: Subject, link: Link) -> float:
    """Height of a link's lowest point at home (m)."""
    rotation, position = subject.placement(link.name)
    down = -rotation[2]
    return float(position[2]) - max(shape.reach(down) for shape in link.solid)
