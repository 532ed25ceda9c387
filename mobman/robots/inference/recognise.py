"""The platform that a URDF's wheels make."""

from __future__ import annotations

from mobman.arrays import Array
from mobman.robots.inference import hints
from mobman.robots.inference.drive import WITHOUT_WHEELS, Drive
from mobman.robots.inference.driven import driven_wheels, one_each
from mobman.robots.inference.findings import Finding, Lock, Options, Undecided
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.named import named_drive
from mobman.robots.inference.nearly import WHEEL, candidates, nearest_pair
from mobman.robots.inference.omni import mecanum_fits, mecanum_sign, omnidirectional
from mobman.robots.inference.orient import orient
from mobman.robots.inference.passive import lock_passive
from mobman.robots.inference.steering import steered_wheels, steering_joints
from mobman.robots.inference.tree import Joint, Tree, names_of
from mobman.robots.inference.wheels import Rolling, pairs_of


def find_drive(
    tree: Tree,
    wheels: list[Rolling],
    geometry: Geometry,
    options: Options,
    ignored: set[str],
    arms: Array,
    hint: str,
) -> Drive:
    """The platform of a URDF.

    Args:
        tree: The robot.
        wheels: All that rolls on the ground.
        geometry: Its shapes.
        options: What the user says.
        ignored: Virtual joints in front of the base.
        arms: Where the ends of arms and heads are with all joints at zero (m), shape (n, 3).
        hint: Name of the robot and of plug-ins, which may speak of mecanum wheels.

    Raises:
        Undecided: If it takes an option.
    """
    if options.right_wheels or options.left_wheels or options.wheels:
        drive = named_drive(tree, geometry, options, ignored)
    elif options.platform in WITHOUT_WHEELS:
        drive = Drive(Finding(options.platform, "as asked for"))
        fixed, _ = driven_wheels(wheels)
        pair = pairs_of(fixed)[:1]
        if pair:  # not coordinates, but they say where forward and the axle are
            drive.right, drive.left = [pair[0][0]], [pair[0][1]]
    else:
        drive = _recognised(tree, wheels, geometry, options, hint)
    orient(tree, drive, wheels, options, arms)
    lock_passive(drive, wheels)
    return drive


def _recognised(
    tree: Tree, wheels: list[Rolling], geometry: Geometry, options: Options, hint: str
) -> Drive:
    """The platform that the wheels make."""
    driven, turrets = driven_wheels(wheels)
    steered = [w for w in wheels if w.steering is not None and w not in driven]
    asked = options.platform
    if asked == "omnidirectional" and len(driven) < 3:
        driven = one_each(wheels)
    pairs = pairs_of(driven)
    crooked = any(not driven[0].parallel(w) for w in driven)
    if asked is None and not (crooked and len(driven) >= 3) and not pairs:
        raise Undecided(_no_platform(tree, wheels, geometry))
    if (crooked and len(driven) >= 3 and asked is None) or asked == "omnidirectional":
        return omnidirectional(driven, crooked, hint)
    drive = _parallel(tree, pairs, steered, options, asked, hint)
    if turrets:
        drive.locks.append(Lock(turrets, "turns the driven wheels; straight ahead here"))
        drive.uncertain.append(
            f"{', '.join(turrets)} turns the driven wheels about the vertical; with it locked the "
            "platform is a differential one, without its sideways motion"
        )
    return drive


def _parallel(
    tree: Tree,
    pairs: list[tuple[Rolling, Rolling]],
    steered: list[Rolling],
    options: Options,
    asked: str | None,
    hint: str,
) -> Drive:
    """Wheels in pairs with one direction."""
    right, left = [a for a, _ in pairs], [b for _, b in pairs]
    steering = steering_joints(tree, steered, options)
    kind = asked or _type(pairs, steering, hint)
    if kind == "omnidirectional":
        found = [*right, *left]
        return Drive(
            Finding(kind, mecanum_sign(found, hint)), wheels=found, kind=Finding("mecanum")
        )
    if kind == "car-like":
        if len(pairs) != 1 or not 0 < len(steering) <= 2:
            raise Undecided(
                f"a car-like platform has two rear wheels and one or two steering joints; found "
                f"{_listing(pairs)} and the steering joints {names_of(steering)}: name them by "
                "--right-wheel, --left-wheel and --steering, or choose another --platform"
            )
        drive = Drive(Finding(kind, "limited vertical joints carry the front wheels"), right, left)
        drive.steering = steering
        drive.front = steered_wheels(steering, steered)
        return drive
    if kind == "differential":
        if len(pairs) != 1:
            raise Undecided(
                f"a differential platform has two driven wheels; found {_listing(pairs)}: name them by "
                "--right-wheel and --left-wheel"
            )
        return Drive(Finding(kind, "two driven wheels on one axle"), right, left)
    if not pairs:
        raise Undecided(
            "no pair of driven wheels was found: name them by --right-wheel and --left-wheel"
        )
    drive = Drive(Finding(kind, f"{len(pairs)} pairs of wheels that do not steer"), right, left)
    if asked is None and mecanum_fits([*right, *left]):
        drive.uncertain.append(
            "nothing says whether the wheels are mecanum wheels; if they are: --platform omnidirectional"
        )
    return drive


def _type(pairs: list[tuple[Rolling, Rolling]], steering: list[Joint], hint: str) -> str:
    if steering:
        return "car-like"
    if len(pairs) == 1:
        return "differential"
    return "omnidirectional" if mecanum_sign([w for p in pairs for w in p], hint) else "skid-steer"


def _no_platform(tree: Tree, wheels: list[Rolling], geometry: Geometry) -> str:
    turned = [w for w in wheels if w.swivel is not None or w.steering is not None]
    if turned:
        joints = dict.fromkeys(j.name for w in turned for j in (w.swivel, w.steering) if j)
        sliding = (
            "--platform omnidirectional (mecanum wheels in the same places move as freely), "
            if mecanum_fits(one_each(wheels))
            else ""
        )
        naming = (
            ", or name --right-wheel and --left-wheel of a pair that drives straight ahead"
            if pairs_of(turned)
            else ""
        )
        return (
            f"all wheels ({', '.join(w.name for w in turned)}) swivel or steer ({', '.join(joints)}), "
            f"which no platform type models as such; choose {sliding}--platform unicycle (wheels "
            f"straight ahead){naming}"
        )
    fixed = [
        joint.name for joint in tree.joints if not joint.movable and hints.says(WHEEL, joint.name)
    ]
    still = f" (the URDF has its wheels fixed: {', '.join(fixed[:6])})" if fixed else ""
    without = (
        "--platform unicycle (it moves along its heading and turns, without wheels) or --platform fixed "
        "(an arm that stands on the ground)"
    )
    return (
        f"no driven wheels were found{still}; {_what_to_name(tree, geometry)}, or choose {without}"
    )


def _what_to_name(tree: Tree, geometry: Geometry) -> str:
    """Why the pair that is nearest to driven wheels is none, and what may be named."""
    found = candidates(tree)
    if len(found) < 2:
        upright = [j for j in tree.movable if j.endless and j.vertical and not any(tree.behind(j))]
        turning = f" ({names_of(upright)}: about the vertical)" if upright else ""
        only = f" but {found[0].name}" if found else ""
        return (
            f"the URDF has no joint{only} that could be named by --right-wheel and --left-wheel"
            f"{turning}; correct it"
        )
    near = nearest_pair(tree, geometry)
    if near is None:
        may = names_of(found)
        return f"name them by --right-wheel and --left-wheel (joints that may be wheels: {may})"
    why = f"the nearest pair, {' and '.join(near.names)}, was not taken: {'; '.join(near.faults)}"
    if not near.nameable:
        return f"{why}; wheels of a pair are on one horizontal axle: correct the URDF"
    return f"{why}; name them by --right-wheel and --left-wheel if they drive"


def _listing(pairs: list[tuple[Rolling, Rolling]]) -> str:
    return ", ".join(f"{a.name} and {b.name}" for a, b in pairs) or "no pair of wheels"
