"""A platform of the wheels that the user names."""

from __future__ import annotations

from collections.abc import Sequence

from mobman.robots.inference.drive import Drive
from mobman.robots.inference.findings import Finding, Options, Undecided
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.omni import omnidirectional
from mobman.robots.inference.steering import steered_wheels, steering_joints
from mobman.robots.inference.tree import Tree, names_of
from mobman.robots.inference.wheels import Rolling, as_wheel, rolling_wheels


def named_drive(tree: Tree, geometry: Geometry, options: Options, ignored: set[str]) -> Drive:
    """The wheels that the user names."""

    def find(names: Sequence[str], option: str) -> list[Rolling]:
        found = []
        for name in names:
            joint = tree.joint(name)
            if joint is None:
                raise Undecided(
                    f"{option} {name!r} is no movable joint of the URDF; it has: "
                    f"{names_of(tree.movable)}"
                )
            found.append(as_wheel(tree, joint, geometry, ignored))
        return found

    right, left = (
        find(options.right_wheels, "--right-wheel"),
        find(options.left_wheels, "--left-wheel"),
    )
    wheels = find(options.wheels, "--wheel")
    if len(right) != len(left):
        raise Undecided(
            f"--right-wheel names {len(right)} and --left-wheel {len(left)} wheels; give as many of each"
        )
    if wheels and right:
        raise Undecided(
            "--wheel is for omnidirectional platforms; leave out --right-wheel or --wheel"
        )
    steering = steering_joints(tree, [], options)
    count = "differential" if len(right) == 1 else "skid-steer"
    kind = options.platform or ("omnidirectional" if wheels else "car-like" if steering else count)
    if kind == "omnidirectional":
        wheels = wheels or [*right, *left]
        crooked = any(not wheels[0].parallel(w) for w in wheels)
        return omnidirectional(wheels, crooked, "")
    if wheels:
        raise Undecided(
            f"--wheel is for --platform omnidirectional; {kind}: --right-wheel, --left-wheel"
        )
    if kind in ("differential", "car-like") and len(right) != 1:
        raise Undecided(f"{kind}: give one --right-wheel and one --left-wheel")
    drive = Drive(Finding(kind, "as asked for"), right, left, steering=steering)
    if kind == "car-like":
        if not steering:
            raise Undecided(f"car-like: name --steering; candidates: {names_of(tree.movable)}")
        drive.front = steered_wheels(steering, rolling_wheels(tree, geometry, ignored))
    return drive
