"""Joints that steer, and the wheels on them."""

from __future__ import annotations

from mobman.robots.inference.findings import Options, Undecided
from mobman.robots.inference.tree import Joint, Tree, names_of
from mobman.robots.inference.wheels import Rolling, pairs_of


def steering_joints(tree: Tree, steered: list[Rolling], options: Options) -> list[Joint]:
    """The joints that steer, without those that follow another one."""
    if options.steering:
        found = [tree.joint(name) for name in options.steering]
        for name, joint in zip(options.steering, found, strict=True):
            if joint is None:
                raise Undecided(
                    f"--steering {name!r} is no movable joint; the URDF has: {names_of(tree.movable)}"
                )
        return [joint for joint in found if joint is not None]
    joints = dict.fromkeys(w.steering for w in steered if w.steering is not None)
    return [joint for joint in joints if not joint.mimic]


def steered_wheels(steering: list[Joint], wheels: list[Rolling]) -> list[Rolling]:
    """The wheels behind the steering joints, if there is a right and a left one."""
    found = [w for w in wheels if w.steering in steering]
    return found if len(found) == 2 and len(pairs_of(found)) == 1 else []
