"""The platform that the wheels of a URDF make: its type, and the wheels that drive."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.drive import OMNI, Drive, Forward, find_forward, heading_of
from mobman.robots.infer.findings import (
    CASTER,
    MECANUM,
    WHEEL,
    Inferred,
    Lock,
    Options,
    Undecided,
    lock_once,
    says,
)
from mobman.robots.infer.kinematics import Joint, Tree, names_of
from mobman.robots.infer.wheels import (
    SAME_PLACE,
    SAME_RADIUS,
    Rolling,
    as_wheel,
    pairs_of,
    rolling_wheels,
    what_to_name,
)

_BETWEEN = 0.25  # of the track: how far a turret's axis may be from the middle of its wheels
_MECANUM_EXACT = 1e-3  # m; and the least ratio of singular values


def find_drive(
    tree: Tree,
    wheels: list[Rolling],
    options: Options,
    arms: Array,
    hint: str,
) -> Drive:
    """The platform of a URDF.

    Args:
        tree: The robot.
        wheels: All that rolls on the ground.
        options: Facts that the user gives.
        arms: The ends of arms and heads with all joints at zero (m), shape (n, 3).
        hint: Evidence of mecanum wheels beyond their names; empty if there is none.

    Raises:
        Undecided: If it takes an option.
    """
    if options.right_wheels or options.left_wheels or options.wheels:
        drive = _named(tree, options)
    elif options.platform is not None and options.without_wheels(options.platform):
        drive = Drive(Inferred(options.platform, "as asked for"))
        for one, other in pairs_of(_driven_wheels(wheels)[0])[:1]:  # where forward and the axle are
            drive.right, drive.left = [one], [other]
    else:
        drive = _recognised(tree, wheels, options, hint)
    drive.coordinates = not options.without_wheels(drive.type.value)
    _orient(tree, drive, wheels, options, arms)
    _lock_passive(drive, wheels)
    return drive


def _named(tree: Tree, options: Options) -> Drive:
    """The platform of the wheels that the user names."""
    right, left, wheels = (
        [as_wheel(tree, j) for j in _joints(tree, names, option, " of the URDF; it")]
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
    if wheels and right:
        raise Undecided(
            "--wheel is for omnidirectional and swerve platforms; leave out --right-wheel or --wheel"
        )
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
        raise Undecided(
            f"--wheel is for --platform omnidirectional or swerve; {kind}: --right-wheel, --left-wheel"
        )
    if {"right_wheel", "rear_right_wheel"} & set(fields) and len(right) != 1:
        raise Undecided(f"{kind}: give one --right-wheel and one --left-wheel")
    drive = Drive(Inferred(kind, "as asked for"), right, left, steering=steering)
    if "turret" in fields:
        drive.turret = _turret(right[0], left[0])
        if drive.turret is None:
            raise Undecided(
                f"{kind}: no joint about the vertical carries both {right[0].name} and {left[0].name}"
            )
    if "steering" in fields:
        if not steering:
            raise Undecided(f"{kind}: name --steering; candidates: {names_of(tree.movable)}")
        drive.front = _steered_wheels(steering, rolling_wheels(tree)[0])
    return drive


def _joints(tree: Tree, names: Sequence[str], option: str, of: str = "; the URDF") -> list[Joint]:
    """The movable joints that an option names."""
    found = {name: tree.joint(name) for name in names}
    if unknown := [name for name, joint in found.items() if joint is None]:
        raise Undecided(
            f"{option} {unknown[0]!r} is no movable joint{of} has: {names_of(tree.movable)}"
        )
    return [joint for name in names if (joint := found[name])]


def _recognised(tree: Tree, wheels: list[Rolling], options: Options, hint: str) -> Drive:
    """The platform that the wheels make."""
    driven, turrets = _driven_wheels(wheels)
    asked = options.platform
    asked_for = options.fields(asked) if asked is not None else ()
    sliding = "wheels" in asked_for
    modules = [w for w in wheels if _is_module(w)]
    straight = [w for w in wheels if w.turning is None and not w.says(CASTER)]
    if (sliding and "steering" in asked_for) or (
        asked is None
        and len({w.turning for w in modules}) >= 2
        and not (straight or pairs_of(driven))
    ):
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
        return Drive(
            Inferred("planar", why),
            uncertain=[f"the base is taken as planar, without wheels: {why}"],
        )
    if asked is None and not pairs:
        raise Undecided(_no_platform(tree, wheels))
    if len(pairs) == 1 and ("turret" in asked_for or (asked is None and turrets)):
        turret = _turret(*pairs[0])
        if turret is not None and (asked or _ahead(turret, *pairs[0]) > SAME_PLACE):
            why = "a joint about the vertical carries both driven wheels"
            (one, other), kind = pairs[0], Inferred(asked or "turret", why)
            return Drive(kind, [one], [other], turret=turret)
        if asked:
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
    right, left = [a for a, _ in pairs], [b for _, b in pairs]
    steering = _steering_joints(tree, steered, options)
    sign = _mecanum_sign([w for pair in pairs for w in pair], hint)
    several = "omnidirectional" if sign else "skid-steer"
    kind = options.platform or (
        "car-like" if steering else "differential" if len(pairs) == 1 else several
    )
    fields = options.fields(kind)
    listing = ", ".join(f"{a.name} and {b.name}" for a, b in pairs) or "no pair of wheels"
    if "wheels" in fields:
        return Drive(Inferred(kind, sign), wheels=[*right, *left], kind=Inferred("mecanum"))
    if options.platform is None and len(pairs) == 1 and len(steering) > 2:
        why = f"{len(steering)} joints steer, and one axle does not"
        return Drive(
            Inferred("multi-axle", why), wheels=[*right, *left, *steered], steering=steering
        )
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
    if options.platform is None and _mecanum_fits(drive.driven):
        drive.uncertain.append(
            "nothing says whether the wheels are mecanum wheels; if they are: --platform omnidirectional"
        )
    return drive


def _no_platform(tree: Tree, wheels: list[Rolling]) -> str:
    """The question that is left where no wheels drive."""
    turned = [w for w in wheels if w.turning is not None]
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
    fixed = [joint.name for joint in tree.joints if not joint.movable and says(WHEEL, joint.name)]
    still = f" (the URDF has its wheels fixed: {', '.join(fixed[:6])})" if fixed else ""
    return (
        f"no driven wheels were found{still}; {what_to_name(tree)}, or choose --platform planar (it "
        "moves in every direction, without wheels), --platform unicycle (along its heading only) or "
        "--platform fixed (an arm that stands on the ground)"
    )


def _driven_wheels(wheels: list[Rolling]) -> tuple[list[Rolling], tuple[str, ...]]:
    """The wheels that drive, and the joint of the turret that they may all be on.

    They do not swivel freely, nor are they the smaller ones of casters.
    """
    fixed = [w for w in wheels if w.swivel is None and w.steering is None]
    turrets: tuple[str, ...] = ()
    carried = [w for w in wheels if w.swivel is not None]
    swivels = {w.swivel for w in carried if w.swivel is not None}
    if not pairs_of(fixed) and len(swivels) == 1:
        (swivel,), pairs = swivels, pairs_of(carried)
        alone = len(carried) == len(wheels)
        if len(pairs) == 1 and _around(swivel, *pairs[0], alone=alone):
            fixed, turrets = carried, (swivel.name,)
    named = [w for w in fixed if not w.says(CASTER)]
    groups: list[list[Rolling]] = []
    for wheel in named if len(named) >= 2 else fixed:
        alike = next((g for g in groups if _alike(g[0], wheel)), [])
        if not alike:
            groups.append(alike)
        alike.append(wheel)
    # casters are smaller than what drives
    best = max(
        (g for g in groups if pairs_of(g) or len(g) >= 3),
        key=lambda g: (g[0].radius or 0.0, float(g[0].joint.centre[2]), len(g)),
        default=[],
    )
    return best, turrets


def _one_each(wheels: list[Rolling]) -> list[Rolling]:
    """One wheel for each joint that turns it about the vertical."""
    found: dict[object, Rolling] = {}
    for wheel in wheels:
        found.setdefault(wheel.swivel or wheel.steering or wheel, wheel)
    return list(found.values())


def _alike(one: Rolling, other: Rolling) -> bool:
    if abs(float(one.joint.centre[2] - other.joint.centre[2])) > SAME_PLACE:
        return False
    radii = [w.radius for w in (one, other) if w.radius is not None]
    return len(radii) < 2 or abs(radii[0] - radii[1]) <= SAME_RADIUS


def _around(swivel: Joint, one: Rolling, other: Rolling, *, alone: bool) -> bool:
    """True if two wheels are on either side of a swivel's axis, not both at a caster's fork: they are
    farther apart than a wheel is long, or there are no others that could drive."""
    track = other.joint.centre[:2] - one.joint.centre[:2]
    middle = 0.5 * (other.joint.centre[:2] + one.joint.centre[:2])
    off = float(abs((swivel.centre[:2] - middle) @ track) / (track @ track))
    wide, radius = float(np.linalg.norm(track)), one.radius or 0.0
    # a radius above the track is in another unit
    return off < _BETWEEN and (alone or wide > 2.0 * radius or radius > wide)


def _turret(one: Rolling, other: Rolling) -> Joint | None:
    """The joint about the vertical that carries both wheels."""
    return one.turning if one.turning is not None and one.turning is other.turning else None


def _ahead(turret: Joint, one: Rolling, other: Rolling) -> float:
    """Distance of a turret's axis from the line of its wheels' axles (m)."""
    apart = turret.centre - 0.5 * (one.joint.centre + other.joint.centre)
    return abs(float(apart[:2] @ one.ahead))


def _all_parallel(wheels: Sequence[Rolling]) -> bool:
    return all(wheels[0].parallel(w) for w in wheels)


def _omnidirectional(name: str, driven: list[Rolling], hint: str) -> Drive:
    """A platform on wheels with rollers; the hint is evidence of these beyond their own names."""
    if len(driven) < 3:
        raise Undecided(
            f"an {name} platform has three wheels or more; found "
            f"{', '.join(w.name for w in driven) or 'none'}: name them by --wheel (once for each)"
        )
    if _all_parallel(driven):
        why, kind = _mecanum_sign(driven, hint) or "as asked for", Inferred("mecanum")
    else:
        why, kind = f"{len(driven)} wheels with axes in different directions", OMNI
    drive = Drive(Inferred(name, why), wheels=driven, kind=kind)
    if swivels := [w.swivel.name for w in driven if w.swivel is not None]:
        drive.uncertain.append(
            f"{', '.join(swivels)} swivel the wheels; they are locked and the wheels taken as "
            f"{kind.value} wheels"
        )
    return drive


def _is_module(wheel: Rolling) -> bool:
    """True if a wheel is steered about an axis beside it: what trails is a caster."""
    if wheel.turning is None:
        return False
    apart = (wheel.joint.centre - wheel.turning.centre)[:2]
    return abs(float(apart @ wheel.ahead)) < SAME_PLACE


def _swerve(tree: Tree, name: str, wheels: list[Rolling], options: Options) -> Drive:
    """A platform of modules that are steered and driven."""
    steering = _steering_joints(tree, [], options)
    steering = steering or list(dict.fromkeys(w.turning for w in wheels if w.turning is not None))
    if len(steering) < 2 or not wheels:
        raise Undecided(
            f"a {name} platform has two steered modules or more; found "
            f"{', '.join(w.name for w in wheels) or 'no wheels'} and {names_of(steering)}: name them by "
            "--wheel and --steering (once for each)"
        )
    why = f"{len(steering)} joints about the vertical carry wheels beside their axes"
    return Drive(Inferred(name, why), wheels=wheels, steering=steering)


def _mecanum_fits(wheels: list[Rolling]) -> bool:
    """True if wheels with rollers at 45 degrees would drive in every direction in these places."""
    if len(wheels) < 3:
        return False
    centres = np.array([w.joint.centre for w in wheels])
    axes = np.column_stack([wheels[0].ahead, wheels[0].across])
    places = (centres - centres.mean(axis=0))[:, :2] @ axes
    radii = [w.radius for w in wheels if w.radius is not None]
    if (
        not _all_parallel(wheels)
        or np.ptp(centres[:, 2]) > _MECANUM_EXACT
        or (radii and max(radii) - min(radii) > SAME_RADIUS)
        or np.any(np.abs(places) < _MECANUM_EXACT)
    ):
        return False
    rollers = np.column_stack([np.ones(len(places)), -np.sign(places[:, 0] * places[:, 1])])
    turning = places[:, 0] * rollers[:, 1] - places[:, 1] * rollers[:, 0]
    values = np.linalg.svd(np.column_stack([rollers, turning]), compute_uv=False)
    return bool(values[-1] > _MECANUM_EXACT * values[0])


def _mecanum_sign(wheels: Sequence[Rolling], hint: str) -> str:
    """The evidence that wheels have rollers; empty if there is none."""
    if any(w.rollers for w in wheels):
        return "there are rollers behind the wheels"
    for name in (name for w in wheels for name in (w.name, w.joint.child, *w.meshes)):
        if says(MECANUM, name.rpartition("/")[2]):
            return f"the name {name.rpartition('/')[2]} says so"
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


def _orient(tree: Tree, drive: Drive, wheels: list[Rolling], options: Options, arms: Array) -> None:
    """Forward, and with it right and left and the order of wheels."""
    driven = drive.driven
    if options.heading is not None:
        drive.forward = Forward(float(options.heading), "as asked for")
    elif drive.steering and drive.right:
        axle = np.mean([w.joint.centre[:2] for w in driven], axis=0)
        steered = np.mean([joint.centre[:2] for joint in drive.steering], axis=0)
        ahead = driven[0].ahead * np.sign((steered - axle) @ driven[0].ahead)
        drive.forward = Forward(heading_of(ahead), "the steered wheels are in front")
    elif driven and _all_parallel(driven):
        others = [w for w in wheels if w not in driven]
        drive.forward, clear = find_forward(tree, driven, others, arms)
        if not clear:
            drive.uncertain.append(
                f"which way is forward ({drive.forward.why}); the other way: --heading "
                f"{heading_of(-drive.forward.direction):.10g}"
            )

    def to_the_left(w: Rolling) -> float:
        return float(w.joint.centre[:2] @ drive.forward.left)

    def to_the_front(w: Rolling) -> float:
        return float(w.joint.centre[:2] @ drive.forward.direction)

    if not options.right_wheels:
        pairs = [
            sorted(pair, key=to_the_left) for pair in zip(drive.right, drive.left, strict=True)
        ]
        pairs.sort(key=lambda pair: -to_the_front(pair[0]))
        drive.right, drive.left = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    if not options.wheels:
        drive.wheels.sort(key=lambda w: (-round(to_the_front(w) / SAME_PLACE), -to_the_left(w)))
    if drive.wheels:  # of a swerve platform
        order = {w.turning: i for i, w in enumerate(drive.wheels)}
        drive.steering.sort(key=lambda joint: order.get(joint, len(order)))
    else:
        drive.steering.sort(key=lambda joint: float(joint.centre[:2] @ drive.forward.left))
    drive.front.sort(key=to_the_left)


def _lock_passive(drive: Drive, wheels: list[Rolling]) -> None:
    """Lock everything about wheels that is no coordinate of the platform."""
    own = drive.own
    turning = [w for w in wheels if w.name not in own]
    every = [*drive.rolling, *turning]
    casters = [w for w in turning if w.swivel is not None or w.says(CASTER)]
    none = "" if drive.coordinates else f"wheels: {drive.type.value} platforms have none"
    drive.locks += lock_once(
        {name for lock in drive.locks for name in lock.joints} | own,
        ([w.name for w in wheels if none], none),  # they stay where they are for the axle's place
        (_names((w.swivel, w.joint, *w.rollers) for w in casters), "casters"),
        (_names((w.steering, w.joint, *w.rollers) for w in turning), "wheels that do not drive"),
        (_names(w.suspension for w in every), "suspension"),
        (_names((w.swivel,) for w in every), "swivels of the wheels"),
        (_names(w.rollers for w in every), "rollers"),
    )


def _names(groups: Iterable[Iterable[Joint | None]]) -> list[str]:
    return [joint.name for joints in groups for joint in joints if joint is not None]
