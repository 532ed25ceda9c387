"""The platform that the wheels of a URDF make: its type, and the wheels that drive."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.drive import OMNI, Drive, Forward, find_forward, heading_of
from mobman.robots.infer.findings import Inferred, Lock, Options, Undecided, says
from mobman.robots.infer.kinematics import Joint, Tree, names_of
from mobman.robots.infer.wheels import (
    ALLOWED,
    SAME_PLACE,
    SAME_RADIUS,
    Rolling,
    around,
    pairs_of,
    rolling_wheels,
    what_to_name,
)

_MECANUM_EXACT = 1e-3  # m; and the least ratio of singular values
_AS_ASKED = "as asked for"


def find_drive(tree: Tree, wheels: list[Rolling], options: Options, arms: Array) -> Drive:
    """The platform of a URDF, from all that rolls on the ground, facts that the user gives, and the ends
    of arms and heads with all joints at zero (m), shape (n, 3); Undecided if it takes an option."""
    if options.right_wheels or options.left_wheels or options.wheels:
        drive = _named(tree, options)
    elif options.platform is not None and options.without_wheels(options.platform):
        drive = Drive(Inferred(options.platform, _AS_ASKED))
        for one, other in pairs_of(_driven_wheels(wheels)[0])[:1]:  # where forward and the axle are
            drive.right, drive.left = [one], [other]
    else:
        drive = _recognised(tree, wheels, options, _hint(tree.robot))
    drive.coordinates = not options.without_wheels(drive.type.value)
    sines = [np.linalg.norm(np.cross(w.joint.axis, drive.right[0].joint.axis)) for w in drive.front]
    if any(sine > ALLOWED[1] for sine in sines):
        drive.uncertain.append(
            f"{names_of(drive.front)} are not parallel to the rear wheels: held, they do not roll"
        )
        drive.front = []
    carrying = [j for j in tree.movable if not (j.vertical or j.endless) and any(tree.behind(j))]
    if odd := [joint for joint in carrying if says("steering", joint.name, joint.child)]:
        drive.uncertain.append(
            f"{names_of(odd)}: steering by name, but not about the vertical; correct <axis> or <origin>"
        )
    forward = _forward(tree, drive, wheels, options, arms)
    drive.orient(forward, bool(options.right_wheels), bool(options.wheels))
    drive.lock_passive(wheels)
    return drive


def _hint(robot: ET.Element) -> str:
    """The robot's name or the simulator's plug-in that speaks of wheels with rollers; else empty."""
    if says("mecanum", name := robot.get("name", "")):
        return f"robot {name!r}"
    texts = (plug.get(key, "") for plug in robot.iter("plugin") for key in ("filename", "name"))
    return next((f"plug-in {text!r}" for text in texts if says("planar_drive", text)), "")


def _named(tree: Tree, options: Options) -> Drive:
    """The platform of the wheels that the user names."""
    right, left, wheels = (
        [Rolling(tree, j) for j in _joints(tree, names, option, " of the URDF; it")]
        for names, option in (
            (options.right_wheels, "--right-wheel"),
            (options.left_wheels, "--left-wheel"),
            (options.wheels, "--wheel"),
        )
    )
    if len(right) != len(left):
        raise Undecided(
            f"--right-wheel names {len(right)} and --left-wheel {len(left)} wheels; give as many of each"
        )
    for wheel in (*right, *left, *wheels):
        if wheel.joint.prismatic or wheel.joint.vertical:
            raise Undecided(f"{wheel.name!r} turns about no horizontal axis, as a wheel does")
    if twice := set(options.right_wheels) & set(options.left_wheels):
        raise Undecided(f"--right-wheel and --left-wheel both name {twice.pop()!r}")
    types = " or ".join(name for name, fields in options.types.items() if "wheels" in fields)
    if wheels and right:
        raise Undecided(f"--wheel is for --platform {types}; leave out --right-wheel or --wheel")
    steering = _steering_joints(tree, [], options)
    count = "differential" if len(right) == 1 else "skid-steer"
    sliding = "swerve" if steering else "omnidirectional"
    kind = options.platform or (sliding if wheels else "car-like" if steering else count)
    fields = options.fields(kind)
    if {"wheels", "steering"} <= set(fields):
        return _swerve(tree, kind, wheels or [*right, *left], options)
    if "wheels" in fields:
        return _omnidirectional(kind, wheels or [*right, *left], "")
    if wheels:
        raise Undecided(f"--wheel is for --platform {types}; {kind}: --right-wheel, --left-wheel")
    if {"right_wheel", "rear_right_wheel"} & set(fields) and len(right) != 1:
        raise Undecided(f"{kind}: give one --right-wheel and one --left-wheel")
    drive = Drive(Inferred(kind, _AS_ASKED), right, left, steering=steering)
    if "turret" in fields:
        drive.turret, both = _turret(right[0], left[0]), f"{right[0].name} and {left[0].name}"
        if drive.turret is None:
            raise Undecided(f"{kind}: no joint about the vertical carries both {both}")
    if "steering" in fields:
        if not steering:
            raise Undecided(f"{kind}: name --steering; candidates: {names_of(tree.movable)}")
        drive.front = _steered_wheels(steering, rolling_wheels(tree)[0])
    return drive


def _joints(tree: Tree, names: Sequence[str], option: str, of: str = "; the URDF") -> list[Joint]:
    """The movable joints that an option names."""
    found = []
    for name in names:
        if (joint := tree.joint(name)) is None:
            has = names_of(tree.movable)
            raise Undecided(f"{option} {name!r} is no movable joint{of} has: {has}")
        if joint in found:
            raise Undecided(f"{option} names {name!r} twice")
        found.append(joint)
    return found


def _recognised(tree: Tree, wheels: list[Rolling], options: Options, hint: str) -> Drive:
    """The platform that the wheels make."""
    driven, turrets = _driven_wheels(wheels)
    asked, fields = options.platform, options.fields(options.platform)
    sliding = "wheels" in fields
    # a wheel that is steered about an axis beside it: what trails is a caster
    modules = [
        w
        for w in wheels
        if w.turning is not None and abs((w.centre - w.turning.centre)[:2] @ w.ahead) < SAME_PLACE
    ]
    straight = [w for w in wheels if w.turning is None and not w.says("caster")]
    several = len({w.turning for w in modules}) >= 2 and not (straight or pairs_of(driven))
    if (sliding and "steering" in fields) or (asked is None and several):
        own = modules if asked in (None, "swerve") else [*modules, *straight]
        return _swerve(tree, asked or "swerve", own, options)
    steered = [w for w in wheels if w.steering is not None and w not in driven]
    if sliding and len(driven) < 3:
        driven = _one_each(wheels)
    pairs = pairs_of(driven)
    crooked = len(driven) >= 3 and not _all_parallel(driven)
    if sliding or (asked is None and crooked):
        return _omnidirectional(asked or "omnidirectional", driven, hint)
    slides = [joint.name for joint in tree.virtual if joint.prismatic]
    if asked is None and not wheels and (hint or len(slides) == 2):
        says_so = hint or f"{' and '.join(slides)} in front of the base"
        why = f"the URDF says {says_so}, and has no wheel joints"
        doubt = f"the base is taken as planar, without wheels: {why}"
        return Drive(Inferred("planar", why), uncertain=[doubt])
    if asked is None and not pairs:
        raise Undecided(_no_platform(tree, wheels))
    if len(pairs) == 1 and ("turret" in fields or (asked is None and turrets)):
        (one, other), turret = pairs[0], _turret(*pairs[0])
        if turret is not None:
            # the axis is ahead of the line of the wheels' axles
            apart = turret.centre - 0.5 * (one.centre + other.centre)
            if asked or abs(float(apart[:2] @ one.ahead)) > SAME_PLACE:
                why = "a joint about the vertical carries both driven wheels"
                return Drive(Inferred(asked or "turret", why), [one], [other], turret=turret)
        elif asked:
            raise Undecided(f"{asked}: no joint about the vertical carries a pair of driven wheels")
    drive = _of_pairs(tree, pairs, steered, options, hint)
    if turrets:
        drive.locks.append(Lock(turrets, "turns the driven wheels; straight ahead here"))
        drive.uncertain.append(
            f"{', '.join(turrets)} turns the driven wheels about the vertical; with it locked the "
            "platform is a differential one, without its sideways motion"
        )
    return drive


def _of_pairs(
    tree: Tree,
    pairs: list[tuple[Rolling, Rolling]],
    steered: list[Rolling],
    options: Options,
    hint: str,
) -> Drive:
    """The platform of wheels in pairs with one direction."""
    right, left = [one for one, _ in pairs], [other for _, other in pairs]
    steering, asked = _steering_joints(tree, steered, options), options.platform
    sign = _mecanum_sign([wheel for pair in pairs for wheel in pair], hint)
    several = "differential" if len(pairs) == 1 else "omnidirectional" if sign else "skid-steer"
    kind = asked or ("car-like" if steering else several)
    fields = options.fields(kind)
    listing = ", ".join(f"{a.name} and {b.name}" for a, b in pairs) or "no pair of wheels"
    if "wheels" in fields:
        return Drive(Inferred(kind, sign), wheels=[*right, *left], kind=Inferred("mecanum"))
    if asked is None and len(pairs) == 1 and len(steering) > 2:
        why = f"{len(steering)} joints steer, and one axle does not"
        wheels = [*right, *left, *steered]
        return Drive(Inferred("multi-axle", why), wheels=wheels, steering=steering)
    if "steering" in fields:
        if len(pairs) != 1 or not 0 < len(steering) <= 2:
            raise Undecided(
                f"a {kind} platform has two rear wheels and one or two steering joints; found "
                f"{listing} and the steering joints {names_of(steering)}: name them by "
                "--right-wheel, --left-wheel and --steering, or choose another --platform"
            )
        why = "limited vertical joints carry the front wheels"
        front = _steered_wheels(steering, steered)
        return Drive(Inferred(kind, why), right, left, steering=steering, front=front)
    if "right_wheel" in fields:
        if len(pairs) != 1:
            raise Undecided(
                f"a {kind} platform has two driven wheels; found {listing}: name them by "
                "--right-wheel and --left-wheel"
            )
        return Drive(Inferred(kind, "two driven wheels on one axle"), right, left)
    if not pairs:
        raise Undecided(
            "no pair of driven wheels was found: name them by --right-wheel and --left-wheel"
        )
    drive = Drive(Inferred(kind, f"{len(pairs)} pairs of wheels that do not steer"), right, left)
    if asked is None and _mecanum_fits(drive.driven):
        drive.uncertain.append(
            "nothing says whether the wheels are mecanum wheels; if they are: --platform omnidirectional"
        )
    return drive


def _no_platform(tree: Tree, wheels: list[Rolling]) -> str:
    """The question that is left where no wheels drive."""
    turned = [w for w in wheels if w.turning is not None]
    _, high = rolling_wheels(tree)
    if wheels and (pairs := pairs_of([w for w in high if w.turning is None])):
        (one, other), lowest = pairs[0], min(wheels, key=lambda w: w.centre[2] - (w.radius or 0.0))
        gap = one.centre[2] - (one.radius or 0.0) - lowest.centre[2] + (lowest.radius or 0.0)
        return (
            f"the wheels {one.name} and {other.name} end {1e3 * gap:.3g} mm above the lowest point "
            f"of {lowest.name}, which was taken to stand on the ground: correct the <origin> of one "
            "of them, or, if they drive, name them by --right-wheel and --left-wheel"
        )
    if turned and len(turned) == len(wheels):
        joints = dict.fromkeys(j.name for w in turned for j in (w.swivel, w.steering) if j)
        sliding = naming = ""
        if _mecanum_fits(_one_each(wheels)):
            sliding = (
                "--platform omnidirectional (mecanum wheels in the same places move as freely), "
            )
        if pairs_of(turned):
            naming = ", or name --right-wheel and --left-wheel of a pair that drives straight ahead"
        return (
            f"all wheels ({', '.join(w.name for w in turned)}) swivel or steer ({', '.join(joints)}), "
            f"which no platform type models as such; choose {sliding}--platform planar (it moves in "
            f"every direction, without wheels), --platform unicycle (wheels straight ahead){naming}"
        )
    fixed = [joint.name for joint in tree.joints if not joint.movable and says("wheel", joint.name)]
    still = f" (the URDF has its wheels fixed: {', '.join(fixed[:6])})" if fixed else ""
    return (
        f"no driven wheels were found{still}; {what_to_name(tree)}, or choose --platform planar (it "
        "moves in every direction, without wheels), --platform unicycle (along its heading only) or "
        "--platform fixed (an arm that stands on the ground)"
    )


def _driven_wheels(wheels: list[Rolling]) -> tuple[list[Rolling], tuple[str, ...]]:
    """The wheels that drive, which neither swivel freely nor are the smaller ones of casters; and the
    joint of the turret that they may all be on."""
    fixed, carried = [w for w in wheels if w.turning is None], [w for w in wheels if w.swivel]
    turrets: tuple[str, ...] = ()
    swivels, pairs = {w.swivel.name: w.swivel for w in carried if w.swivel}, pairs_of(carried)
    one_pair, alone = len(swivels) == len(pairs) == 1, len(carried) == len(wheels)
    if not pairs_of(fixed) and one_pair and around(carried[0].swivel, *pairs[0], alone=alone):
        fixed, turrets = carried, tuple(swivels)
    named = [w for w in fixed if not w.says("caster")]
    groups: list[list[Rolling]] = []
    for wheel in named if len(named) >= 2 else fixed:
        alike = next((g for g in groups if _alike(g[0], wheel)), [])
        groups += [] if alike else [alike]
        alike.append(wheel)
    # casters are smaller than what drives, and of wheels alike the lower ones carry the robot
    best = max(
        (g for g in groups if pairs_of(g) or len(g) >= 3),
        key=lambda g: (g[0].radius or 0.0, _carries(g[0]), len(g)),
        default=[],
    )
    return best, turrets


def _carries(wheel: Rolling) -> float:
    """The lower a wheel of a known radius is, the larger; of another, its axle says how large it is."""
    height = float(wheel.centre[2])
    return height if wheel.radius is None else -height


def _one_each(wheels: list[Rolling]) -> list[Rolling]:
    """One wheel for each joint that turns it about the vertical."""
    found: dict[object, Rolling] = {}
    for wheel in wheels:
        found.setdefault(wheel.turning or wheel, wheel)
    return list(found.values())


def _alike(one: Rolling, other: Rolling) -> bool:
    radii = [w.radius for w in (one, other) if w.radius is not None]
    level = abs(float(one.centre[2] - other.centre[2])) <= SAME_PLACE
    return level and (len(radii) < 2 or abs(radii[0] - radii[1]) <= SAME_RADIUS)


def _turret(one: Rolling, other: Rolling) -> Joint | None:
    """The joint about the vertical that carries both wheels."""
    return one.turning if one.turning is other.turning else None


def _all_parallel(wheels: Sequence[Rolling]) -> bool:
    return all(wheels[0].parallel(w) for w in wheels)


def _omnidirectional(name: str, driven: list[Rolling], hint: str) -> Drive:
    """A platform on wheels with rollers; the hint is evidence of these beyond their own names."""
    if len(driven) < 3:
        raise Undecided(
            f"an {name} platform has three wheels or more; found "
            f"{names_of(driven)}: name them by --wheel (once for each)"
        )
    if _all_parallel(driven):
        why, kind = _mecanum_sign(driven, hint) or _AS_ASKED, Inferred("mecanum")
    else:
        why, kind = f"{len(driven)} wheels with axes in different directions", OMNI
    drive = Drive(Inferred(name, why), wheels=driven, kind=kind)
    if swivels := [w.swivel.name for w in driven if w.swivel is not None]:
        drive.uncertain.append(
            f"{', '.join(swivels)} swivel the wheels; they are locked and the wheels taken as "
            f"{kind.value} wheels"
        )
    return drive


def _swerve(tree: Tree, name: str, wheels: list[Rolling], options: Options) -> Drive:
    """A platform of modules that are steered and driven."""
    turning = dict.fromkeys(w.turning for w in wheels if w.turning is not None)
    steering = _steering_joints(tree, [], options) or list(turning)
    if len(steering) < 2 or not wheels:
        raise Undecided(
            f"a {name} platform has two steered modules or more; found wheels: {names_of(wheels)}; "
            f"steering joints: {names_of(steering)}: name them by --wheel and --steering (once for each)"
        )
    why = f"{len(steering)} joints about the vertical carry wheels beside their axes"
    return Drive(Inferred(name, why), wheels=wheels, steering=steering)


def _mecanum_fits(wheels: list[Rolling]) -> bool:
    """True if wheels with rollers at 45 degrees would drive in every direction in these places."""
    if len(wheels) < 3 or not _all_parallel(wheels):
        return False
    centres = np.array([w.centre for w in wheels])
    axes = np.column_stack([wheels[0].ahead, wheels[0].across])
    x, y = ((centres - centres.mean(axis=0))[:, :2] @ axes).T
    radii = [w.radius for w in wheels if w.radius is not None]
    level = np.ptp(centres[:, 2]) <= _MECANUM_EXACT
    alike = not radii or max(radii) - min(radii) <= SAME_RADIUS
    if not level or not alike or np.any(np.abs([x, y]) < _MECANUM_EXACT):
        return False
    rollers = -np.sign(x * y)
    motion = np.column_stack([np.ones(len(x)), rollers, x * rollers - y])
    values = np.linalg.svd(motion, compute_uv=False)
    return bool(values[-1] > _MECANUM_EXACT * values[0])


def _mecanum_sign(wheels: Sequence[Rolling], hint: str) -> str:
    """The evidence that wheels have rollers; empty if there is none."""
    if any(w.rollers for w in wheels):
        return "there are rollers behind the wheels"
    for w in wheels:
        files = (mesh.get("filename", "").strip() for mesh in w.meshes)
        for path in (w.name, w.joint.child, *files):
            if says("mecanum", name := path.rpartition("/")[2]):
                return f"the name {name} says so"
    return f"the URDF says {hint}" if hint else ""


def _steering_joints(tree: Tree, steered: Iterable[Rolling], options: Options) -> list[Joint]:
    """The joints that steer, without those that follow another one."""
    if options.steering:
        return _joints(tree, options.steering, "--steering")
    joints = dict.fromkeys(w.steering for w in steered if w.steering is not None)
    return [joint for joint in joints if joint.follows is None]


def _steered_wheels(steering: list[Joint], wheels: list[Rolling]) -> list[Rolling]:
    """The wheels behind the steering joints, if there is a right and a left one."""
    found = [w for w in wheels if w.steering in steering]
    return found if len(found) == 2 and len(pairs_of(found)) == 1 else []


def _forward(
    tree: Tree, drive: Drive, wheels: list[Rolling], options: Options, arms: Array
) -> Forward:
    driven = drive.driven
    if options.heading is not None:
        return Forward(float(options.heading), _AS_ASKED)
    if drive.steering and drive.right:
        axle = np.mean([w.centre[:2] for w in driven], axis=0)
        steered = np.mean([joint.centre[:2] for joint in drive.steering], axis=0)
        ahead = driven[0].ahead * np.sign((steered - axle) @ driven[0].ahead)
        return Forward(heading_of(ahead), "the steered wheels are in front")
    if not driven or not _all_parallel(driven):
        return drive.forward
    others = [w for w in wheels if w not in driven]
    forward, clear = find_forward(tree, driven, others, arms)
    if not clear:
        other = heading_of(-forward.direction)
        drive.uncertain.append(
            f"which way is forward ({forward.why}); the other way: --heading {other:.10g}"
        )
    return forward
