"""The wheels' radius in the description against their geometry."""

from __future__ import annotations

from collections.abc import Iterator

from mobman.checks.check import Remark, check, does_not_apply, named_wheels, ok, warning, wrong
from mobman.checks.subject import Subject
from mobman.model.platforms.platform import Wheel
from mobman.robots.urdf.shapes import USES, Use, extent_about, radius_about

_WARNING = 2e-3  # m
_WRONG = 0.1  # of the radius


@check("wheel-radius", "the wheels' radius is that of their geometry")
def wheel_radius(subject: Subject) -> Iterator[Remark]:
    if not subject.robot.platform.wheels:
        yield does_not_apply("no wheels among the platform's coordinates")
    alike: dict[tuple[float, str], list[Wheel]] = {}
    sizes: dict[tuple[float, str], dict[Use, float]] = {}
    for wheel in subject.robot.platform.wheels:
        found = measured(subject, wheel)
        key = (wheel.radius, _listing(found))
        alike.setdefault(key, []).append(wheel)
        sizes[key] = found
    for key, wheels in alike.items():
        yield _compared(subject, wheels, sizes[key])


def _listing(sizes: dict[Use, float]) -> str:
    return " and ".join(f"{value:.4g} m in the {use} geometry" for use, value in sizes.items())


def _compared(subject: Subject, wheels: list[Wheel], sizes: dict[Use, float]) -> Remark:
    where = f"field 'platform.wheel_radius' of robot {subject.robot.name!r}"
    who, radius = named_wheels([wheel.joint for wheel in wheels]), wheels[0].radius
    if not sizes:
        return warning(
            f"{who}: no round geometry (that could be read) to compare the radius {radius:g} m with",
            f"compare {where} with the wheels' data sheet",
        )
    # what a simulator lets roll; a visual mesh may have hubs and covers
    use, size = next(iter(sizes.items()))
    found = f"{who}: radius {radius:g} m, {_listing(sizes)}"
    gap = abs(size - radius)
    links = [repr(link.name) for wheel in wheels for link in subject.links_on(wheel.joint)]
    fix = f"set {where} to {size:.4g}, or mend the <{use}> of link {', '.join(links)}"
    if gap > _WRONG * radius:
        return wrong(found, fix)
    if gap > _WARNING:
        return warning(found, fix)
    return ok(found)


def measured(subject: Subject, wheel: Wheel) -> dict[Use, float]:
    """The radius of a wheel's collision and visual geometry, as far as it is known and round (m)."""
    sizes: dict[Use, float] = {}
    for use in USES:
        size = _measured(subject, wheel, use)
        if size is not None:
            sizes[use] = size
    return sizes


def _measured(subject: Subject, wheel: Wheel, use: Use) -> float | None:
    links = subject.links_on(wheel.joint)
    if any(use in link.incomplete for link in links):
        return None  # what is left may be the hub only
    shapes = [
        shape.placed(*subject.placement(link.name))
        for link in links
        for shape in link.shapes
        if shape.use == use
    ]
    if not shapes:
        return None
    centre, axis = subject.centre(wheel.joint), subject.axis(wheel.joint)
    # rollers are round together only, and a wheel beside its bracket by itself only
    radii = [radius_about(shape, centre, axis) for shape in shapes]
    radii.append(extent_about(shapes, centre, axis))
    return max((radius for radius in radii if radius is not None), default=None)
