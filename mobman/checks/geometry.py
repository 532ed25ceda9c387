"""Checks of the geometry: what stands on the ground, the wheels' radius, the mesh files; and of what the
URDFs state that the equations do not take."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from mobman.checks.checks import Finding, Findings, Subject, check, ok, some, warning, wrong
from mobman.model.platforms.platform import Wheel
from mobman.model.platforms.wheels import AXIS_TOLERANCE, LENGTH_TOLERANCE
from mobman.robots.infer.findings import MOST_RADIUS
from mobman.robots.spec import user_robots_folder
from mobman.robots.urdf.meshes import MeshReference
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, Use, extent_about, radius_about

_LEVEL = 1e-3  # m: how far an axle may be from its wheel's radius
_BELOW = 5e-3  # m: casters and covers are often drawn a little too low
_FAR_BELOW = 5e-2  # m
_NOISE = 1e-6  # m
_FLOATING = 2e-2  # m
_UNSEEN = 0.2  # m: the same where the platform's wheels are not known, and perhaps not drawn
_ROUNDED = 1e-3  # rad
_TILT = math.sin(math.radians(1.0))


@check("ground", "all wheels stand on one ground, right and left, and nothing is below it")
def ground(subject: Subject) -> Findings:
    wheels = subject.robot.platform.wheels
    if len(subject.robot.platform_index) == 0:
        return "does not apply: the base is fixed: the ground is wherever its user has it"
    heights: dict[float, list[str]] = {}  # wheels that do not stand on the ground, by their height
    for wheel in wheels:
        height = float(subject.centre(wheel.joint)[2]) - wheel.radius
        if abs(height) > _LEVEL:
            heights.setdefault(round(height, 4), []).append(wheel.joint)
    for height, joints in heights.items():
        links = some(repr(link.name) for joint in joints for link in subject.links_on(joint))
        each = "its" if len(joints) == 1 else "each one's"
        yield (wrong if abs(height) > LENGTH_TOLERANCE else warning)(
            f"{_wheels(joints)}: {each} lowest point is {1e3 * height:+.1f} mm from the ground",
            f"check <origin> of joint {', '.join(map(repr, joints))} (link {links}), and "
            f"field 'platform.wheel_radius' of {subject.name}",
        )
    for wheel in wheels:
        yield from _wheel(subject, wheel)
    lowest: dict[str, float] = {}  # height of each link's lowest point at home (m)
    for link in subject.links.values():
        if link.solid:
            rotation, position = subject.placement(link.name)
            below = max(shape.reach(-rotation[2]) for shape in link.solid)
            lowest[link.name] = float(position[2]) - below
    yield from _heights(subject, lowest)
    standing = (
        f"{len(wheels)} wheels on the ground" if wheels else "no wheels among the coordinates"
    )
    if lowest:
        name = min(lowest, key=lowest.__getitem__)
        said = f"lowest is link {name!r} at {round(1e3 * lowest[name], 1) + 0.0:g} mm"
    return f"{standing}; {said if lowest else 'there is no geometry to look at'}"


def _wheel(subject: Subject, wheel: Wheel) -> Iterator[Finding]:
    axis, y = subject.axis(wheel.joint), float(subject.centre(wheel.joint)[1])
    if abs(float(axis[2])) > _TILT:
        yield wrong(
            f"wheel {wheel.joint!r}: its axis is {axis.round(3).tolist()}, not horizontal",
            f"check <axis> and <origin> of joint {wheel.joint!r} in the URDF",
        )
    # of these types all wheels roll straight ahead at rest, and the equations have them so
    straight = subject.robot.spec.platform.type in ("differential", "skid-steer", "car-like")
    off = math.acos(min(abs(float(axis[1])), 1.0))
    if straight and _ROUNDED < off <= AXIS_TOLERANCE:
        yield warning(
            f"wheel {wheel.joint!r}: its axis is {1e3 * off:.3g} mrad off, as rounded angles are; the "
            "equations have it exact",
            f"give <origin> rpy and <axis> of joint {wheel.joint!r} more digits in the URDF",
        )
    words = wheel.joint.lower()
    for word, other, side in (("left", "right", 1.0), ("right", "left", -1.0)):
        if word in words and other not in words and side * y < -_LEVEL:
            yield warning(
                f"wheel {wheel.joint!r} is on the {other}, {abs(y):.3g} m from the middle",
                f"check field 'platform.heading' of {subject.name}: forward may be backward",
            )


def _heights(subject: Subject, lowest: dict[str, float]) -> Iterator[Finding]:
    height = f"set field 'platform.height' of {subject.name} to the root link's height"
    by_type = {
        "unicycle": height,
        "planar": height,
        "custom": f"check root_offset of the platform's definition of {subject.name}",
    }
    radius = f"check field 'platform.wheel_radius' of {subject.name}"
    other = f"{radius} and <origin> of these links' geometry"
    fix = by_type.get(subject.robot.spec.platform.type, other)
    platform = {link.name for link in subject.platform_links}
    low = {name: z for name, z in lowest.items() if z < -_BELOW}
    named = some(f"link {name!r} at {1e3 * z:+.0f} mm" for name, z in low.items())
    if any(z < -_FAR_BELOW - _NOISE for name, z in low.items() if name in platform):
        yield wrong(f"geometry below the ground: {named}", fix)
    elif low:
        if platform.isdisjoint(low):
            fix = f"choose another posture in [rest] of {subject.name}"
        yield warning(f"geometry below the ground at rest: {named}", fix)
    least = min((z for name, z in lowest.items() if name in platform), default=0.0)
    if least > (_FLOATING if subject.robot.platform.wheels else _UNSEEN):
        said = f"the platform's lowest geometry is {1e3 * least:.0f} mm above the ground"
        yield warning(said, fix)


def _wheels(joints: Sequence[str]) -> str:
    """The subject of a sentence about wheels, by their joints' names."""
    return f"wheel{'' if len(joints) == 1 else 's'} {', '.join(map(repr, joints))}"


# Radius of the wheels ----------------------------------------------------------------------------------

_NOTICED = 2e-3  # m
_WRONG = 0.1  # of the radius


@check("wheel-radius", "the wheels' radius is that of their geometry")
def wheel_radius(subject: Subject) -> Findings:
    alike: dict[tuple[float, str], tuple[list[str], dict[Use, float]]] = {}
    for wheel in subject.robot.platform.wheels:
        sizes = {use: size for use in USES if (size := _measured(subject, wheel, use)) is not None}
        listing = " and ".join(f"{size:.4g} m in the {use} geometry" for use, size in sizes.items())
        alike.setdefault((wheel.radius, listing), ([], sizes))[0].append(wheel.joint)
    where = f"field 'platform.wheel_radius' of {subject.name}"
    for (radius, listing), (joints, sizes) in alike.items():
        who = _wheels(joints)
        if radius > MOST_RADIUS:
            yield wrong(
                f"{who}: radius {radius:g} m, above {MOST_RADIUS:g} m: is it in millimetres?",
                f"set {where} in metres, and scale what else the URDF has in millimetres",
            )
            continue
        if not sizes:
            yield warning(
                f"{who}: no round geometry (that could be read) to compare the radius {radius:g} m with",
                f"compare {where} with the wheels' data sheet",
            )
            continue
        # what a simulator lets roll; a visual mesh may have hubs and covers
        use, size = next(iter(sizes.items()))
        found, gap = f"{who}: radius {radius:g} m, {listing}", abs(size - radius)
        links = ", ".join(repr(link.name) for name in joints for link in subject.links_on(name))
        fix = f"set {where} to {size:.4g}, or correct the <{use}> of link {links}"
        if gap > _NOTICED:
            yield (wrong if gap > _WRONG * radius else warning)(found, fix)
        else:
            yield ok(found)
    return "does not apply: no wheels among the platform's coordinates"


def _measured(subject: Subject, wheel: Wheel, use: Use) -> float | None:
    """The radius of a wheel's geometry (m); None if it is not known or not round."""
    links = subject.links_on(wheel.joint)
    places = [(shape, subject.placement(one.name)) for one in links for shape in one.shapes]
    shapes = [shape.placed(*place) for shape, place in places if shape.use == use]
    if not shapes or any(use in link.incomplete for link in links):
        return None  # what is left of an incomplete one may be the hub only
    centre, axis = subject.centre(wheel.joint), subject.axis(wheel.joint)
    # rollers are round together only, and a wheel with its bracket by itself only
    radii = [radius_about(shape, centre, axis) for shape in shapes]
    radii.append(extent_about(shapes, centre, axis))
    return max((radius for radius in radii if radius is not None), default=None)


# Mesh files, and what the URDFs state ------------------------------------------------------------------


@check("meshes", "every mesh that the URDFs name is there, can be read and travels with them")
def meshes(subject: Subject) -> Findings:
    if not subject.meshes:
        return "does not apply: the robot has no meshes"
    named, reader = [mesh for mesh, _ in subject.meshes], subject.mesh_reader
    # the equations need no mesh, so that none of this is worse than a warning
    if missing := [mesh for mesh in named if mesh.path is None]:
        yield warning(
            _listed(missing, "missing"),
            "put the files there, or name their packages' folder in field 'urdf.packages' of "
            f"{subject.name}; the equations need none, the viewer does",
        )
    paths = dict.fromkeys(mesh.path for mesh in named if mesh.path is not None)
    if reasons := [reader.unreadable[path] for path in paths if reader.vertices(path) is None]:
        yield warning(
            f"{_meshes(len(reasons))} unreadable: {some(reasons, '; ')}",
            "replace these files: they are damaged, or of a format that is not read (STL, DAE and "
            "OBJ are)",
        )
    if outside := [m for m, urdf in subject.meshes if m.path and _does_not_travel(m, urdf)]:
        yield warning(
            _listed(outside, "outside the URDF's package"),
            "name these meshes by package://NAME/..., or relative to the URDF",
        )
    return f"{len(paths)} files, all read"


def _does_not_travel(mesh: MeshReference, urdf: UrdfFile) -> bool:
    """True if a mesh is named by a place that is not in the package of its URDF."""
    scheme, separator, _ = mesh.filename.partition("://")
    if separator:
        return scheme == "file"
    if Path(mesh.filename).is_absolute():  # as mobman itself writes them in its copies
        return urdf.path.parent != user_robots_folder().resolve()
    # the package is, by convention, two folders up: NAME/urdf or NAME/robots
    folder = urdf.path.parent
    marked = (above for above in (folder, *folder.parents) if (above / "package.xml").is_file())
    return not (folder / mesh.filename).resolve().is_relative_to(next(marked, folder.parent))


def _listed(meshes: Sequence[MeshReference], fault: str) -> str:
    links: dict[str, str] = {}
    for mesh in meshes:
        links.setdefault(mesh.filename, f"{mesh.filename!r} of link {mesh.link!r} ({mesh.use})")
    return f"{_meshes(len(links))} {fault}: {some(links.values())}"


def _meshes(count: int) -> str:
    return f"{count} mesh{'es' if count > 1 else ''}"


@check("urdf", "everything that the URDFs state is taken, or said to be left out")
def urdf(subject: Subject) -> Findings:
    for file in subject.robot.urdf.files:
        for remark in file.remarks:
            yield warning(f"{file.path.name}, {remark}", "correct it there, if it is to be drawn")
        if stated := file.friction:
            yield ok(
                f"{file.path.name} gives damping or friction to {len(stated)} joints "
                f"({some(stated)}): the equations leave them out, the scenario 'urdf-friction' has them"
            )
    return "nothing is left out"
