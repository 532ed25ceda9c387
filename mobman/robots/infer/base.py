"""The platform that the wheels of a URDF make: its type, and the wheels that drive."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.drive import OMNI, Drive, lock_passive, orient
from mobman.robots.infer.findings import (
    CASTER,
    MECANUM,
    WHEEL,
    WITHOUT_WHEELS,
    Inferred,
    Lock,
    Options,
    Undecided,
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
    ignored: set[str],
    arms: Array,
    hint: str,
) -> Drive:
    """The platform of a URDF.

    Args:
        tree: The robot.
        wheels: All that rolls on the ground.
        options: What the user says.
        ignored: Virtual joints in front of the base.
        arms: Where the ends of arms and heads are with all joints at zero (m), shape (n, 3).
        hint: Name of the robot and of plug-ins, which may speak of mecanum wheels.

    Raises:
        Undecided: If it takes an option.
    """
    if options.right_wheels or options.left_wheels or options.wheels:
        drive = _named(tree, options, ignored)
    elif options.platform in WITHOUT_WHEELS:
        drive = Drive(Inferred(options.platform, "as asked for"))
        fixed, _ = _driven_wheels(wheels)
        for one, other in pairs_of(fixed)[:1]:  # they say where forward and the axle are
            drive.right, drive.left = [one], [other]
    else:
        drive = _recognised(tree, wheels, options, hint)
    orient(tree, drive, wheels, options, arms)
    lock_passive(drive, wheels)
    return drive


def _named(tree: Tree, options: Options, ignored: set[str]) -> Drive:
    """The platform of the wheels that the user names."""

    def find(names: Sequence[str], option: str) -> list[Rolling]:
        return [
            as_wheel(tree, j, ignored) for j in _joints(tree, names, option, " of the URDF; it")
        ]

    right = find(options.right_wheels, "--right-wheel")
    left = find(options.left_wheels, "--left-wheel")
    wheels = find(options.wheels, "--wheel")
    if len(right) != len(left):
        raise Undecided(
            f"--right-wheel names {len(right)} and --left-wheel {len(left)} wheels; give as many of each"
        )
    if wheels and right:
        raise Undecided(
            "--wheel is for omnidirectional platforms; leave out --right-wheel or --wheel"
        )
    steering = _steering_joints(tree, [], options)
    count = "differential" if len(right) == 1 else "skid-steer"
    kind = options.platform or ("omnidirectional" if wheels else "car-like" if steering else count)
    if kind == "omnidirectional":
        return _omnidirectional(wheels or [*right, *left], "")
    if wheels:
        raise Undecided(
            f"--wheel is for --platform omnidirectional; {kind}: --right-wheel, --left-wheel"
        )
    if kind in ("differential", "car-like") and len(right) != 1:
        raise Undecided(f"{kind}: give one --right-wheel and one --left-wheel")
    drive = Drive(Inferred(kind, "as asked for"), right, left, steering=steering)
    if kind == "car-like":
        if not steering:
            raise Undecided(f"car-like: name --steering; candidates: {names_of(tree.movable)}")
        drive.front = _steered_wheels(steering, rolling_wheels(tree, ignored))
    return drive


def _joints(tree: Tree, names: Sequence[str], option: str, of: str = "; the URDF") -> list[Joint]:
    """The movable joints that an option names."""
    found = []
    for name in names:
        joint = tree.joint(name)
        if joint is None:
            raise Undecided(
                f"{option} {name!r} is no movable joint{of} has: {names_of(tree.movable)}"
            )
        found.append(joint)
    return found


def _recognised(tree: Tree, wheels: list[Rolling], options: Options, hint: str) -> Drive:
    """The platform that the wheels make."""
    driven, turrets = _driven_wheels(wheels)
    asked = options.platform
    steered = [w for w in wheels if w.steering is not None and w not in driven]
    if asked == "omnidirectional" and len(driven) < 3:
        driven = _one_each(wheels)
    pairs = pairs_of(driven)
    crooked = len(driven) >= 3 and not _all_parallel(driven)
    if asked == "omnidirectional" or (asked is None and crooked):
        return _omnidirectional(driven, hint)
    if asked is None and not pairs:
        raise Undecided(_no_platform(tree, wheels))
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
    listing = ", ".join(f"{a.name} and {b.name}" for a, b in pairs) or "no pair of wheels"
    if kind == "omnidirectional":
        return Drive(Inferred(kind, sign), wheels=[*right, *left], kind=Inferred("mecanum"))
    if kind == "car-like":
        if len(pairs) != 1 or not 0 < len(steering) <= 2:
            raise Undecided(
                f"a car-like platform has two rear wheels and one or two steering joints; found "
                f"{listing} and the steering joints {names_of(steering)}: name them by "
                "--right-wheel, --left-wheel and --steering, or choose another --platform"
            )
        why = "limited vertical joints carry the front wheels"
        front = _steered_wheels(steering, steered)
        return Drive(Inferred(kind, why), right, left, steering=steering, front=front)
    if kind == "differential":
        if len(pairs) != 1:
            raise Undecided(
                f"a differential platform has two driven wheels; found {listing}: name them by "
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
    turned = [w for w in wheels if w.swivel is not None or w.steering is not None]
    if turned:
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
            f"which no platform type models as such; choose {sliding}--platform unicycle (wheels "
            f"straight ahead){naming}"
        )
    fixed = [joint.name for joint in tree.joints if not joint.movable and says(WHEEL, joint.name)]
    still = f" (the URDF has its wheels fixed: {', '.join(fixed[:6])})" if fixed else ""
    return (
        f"no driven wheels were found{still}; {what_to_name(tree)}, or choose --platform unicycle (it "
        "moves along its heading and turns, without wheels) or --platform fixed (an arm that stands on "
        "the ground)"
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
        if len(pairs) == 1 and _around(swivel, *pairs[0]):
            fixed, turrets = carried, (swivel.name,)
    named = [w for w in fixed if not w.says(CASTER)]
    groups: list[list[Rolling]] = []
    for wheel in named if len(named) >= 2 else fixed:
        group = next((g for g in groups if _alike(g[0], wheel)), None)
        if group is None:
            groups.append([wheel])
        else:
            group.append(wheel)
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


def _around(swivel: Joint, one: Rolling, other: Rolling) -> bool:
    """True if two wheels are on either side of a swivel's axis, not both at a caster's fork."""
    track = other.joint.centre[:2] - one.joint.centre[:2]
    middle = 0.5 * (other.joint.centre[:2] + one.joint.centre[:2])
    off = float(abs((swivel.centre[:2] - middle) @ track) / (track @ track))
    return off < _BETWEEN and float(np.linalg.norm(track)) > 2.0 * (one.radius or 0.0)


def _all_parallel(wheels: Sequence[Rolling]) -> bool:
    return all(wheels[0].parallel(w) for w in wheels)


def _omnidirectional(driven: list[Rolling], hint: str) -> Drive:
    """A platform on wheels with rollers; the hint is what beside their own names speaks of these."""
    if len(driven) < 3:
        raise Undecided(
            f"an omnidirectional platform has three wheels or more; found "
            f"{', '.join(w.name for w in driven) or 'none'}: name them by --wheel (once for each)"
        )
    if _all_parallel(driven):
        why, kind = _mecanum_sign(driven, hint) or "as asked for", Inferred("mecanum")
    else:
        why, kind = f"{len(driven)} wheels with axes in different directions", OMNI
    drive = Drive(Inferred("omnidirectional", why), wheels=driven, kind=kind)
    if swivels := tuple(w.swivel.name for w in driven if w.swivel is not None):
        drive.uncertain.append(
            f"{', '.join(swivels)} swivel the wheels; they are locked and the wheels taken as "
            f"{kind.value} wheels"
        )
    return drive


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
