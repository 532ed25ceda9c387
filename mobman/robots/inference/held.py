"""Where joints that do not move are held, and what that takes from the arm."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference.chain import rotation
from mobman.robots.inference.findings import Finding
from mobman.robots.inference.tree import Joint, Tree, names_of


def held(tree: Tree, names: Iterable[str], rest: Mapping[str, float]) -> dict[str, Finding]:
    """Where joints are held that are not at zero (m, rad), by name.

    Args:
        tree: The robot.
        names: The joints that do not move.
        rest: Where the others rest; zero if they are not in it.
    """
    wanted = set(names)
    found = {}
    for joint in tree.movable:
        if joint.name not in wanted or joint.name in rest:
            continue
        value, why = _held_at(tree, joint, rest, frozenset())
        if value != 0.0:
            found[joint.name] = Finding(value, why)
    return found


def _held_at(
    tree: Tree, joint: Joint, rest: Mapping[str, float], seen: frozenset[str]
) -> tuple[float, str]:
    """Where a joint is: with its master, else at zero; within its limits."""
    if joint.name in rest:
        return rest[joint.name], ""
    wanted, why = 0.0, "0 is outside its limits"
    follows = joint.follows
    if follows is not None and joint.name not in seen:
        master = tree.joint(follows.joint)
        at = 0.0 if master is None else _held_at(tree, master, rest, seen | {joint.name})[0]
        wanted = round(follows.multiplier * at + follows.offset, 9) + 0.0
        why = f"where {follows.joint} at {at:.4g} takes it (mimic)"
    value = float(min(max(wanted, joint.lower), joint.upper))
    if value != wanted and follows is not None:
        why += ", within its limits"
    return value, why


def posed(
    tree: Tree, joints: Sequence[Joint], tip: str, values: Mapping[str, Finding]
) -> tuple[list[Joint], Array]:
    """An arm's joints and tip as they are with other joints held away from zero.

    Args:
        tree: The robot.
        joints: Of the arm.
        tip: A link.
        values: Where joints are held (m, rad).

    Returns:
        The joints with their places in the root's frame, and the tip's position (m), shape (3,).
    """
    own = {joint.name for joint in joints}
    turn, shift = np.eye(3), np.zeros(3)
    found = []
    for joint in tree.chain(tip):
        centre, axis = turn @ joint.centre + shift, turn @ joint.axis
        if joint.name in own:
            found.append(replace(joint, centre=centre, axis=axis, rotation=turn @ joint.rotation))
        elif joint.name in values:
            value = float(values[joint.name].value)
            if joint.prismatic:
                shift = shift + value * axis
            else:
                turn = rotation(axis, np.array([value]))[0] @ turn
                shift = centre - turn @ joint.centre
    return found, turn @ tree.position[tip] + shift


def lost_to_mimics(tree: Tree, tip: str, ignored: set[str]) -> list[str]:
    """What mimic joints on the way to a tip would add, were they not held.

    Args:
        tree: The robot.
        tip: A link.
        ignored: Joints that are the platform's.
    """
    groups: dict[str, list[Joint]] = {}
    for joint in tree.chain(tip):
        if joint.follows is not None and joint.name not in ignored:
            groups.setdefault(joint.follows.joint, []).append(joint)
    said = []
    for master, joints in groups.items():
        one = len(joints) == 1
        lost = _lost(tree, joints)
        said.append(
            f"{names_of(joints)} {'follows' if one else 'follow'} {master} by <mimic>, which is not "
            f"modelled: {'it is' if one else 'they are'} held, which takes {lost}"
        )
    return said


def _lost(tree: Tree, joints: Sequence[Joint]) -> str:
    slides = sum(_way(tree, joint) for joint in joints if joint.prismatic)
    turns = sum(_way(tree, joint) for joint in joints if not joint.prismatic)
    parts = []
    if slides:
        parts.append("much of reach" if math.isinf(slides) else f"{slides:.3g} m of reach")
    if turns:
        parts.append("turns without limits" if math.isinf(turns) else f"{turns:.3g} rad of turning")
    return " and ".join(parts) or "nothing, as their limits leave no way"


def _way(tree: Tree, joint: Joint) -> float:
    """How far a mimic joint goes with its master (m, rad)."""
    if joint.follows is None:
        return 0.0
    master = tree.joint(joint.follows.joint)
    gain = abs(joint.follows.multiplier)
    if master is None or gain == 0.0:
        return 0.0
    return min(joint.width, gain * master.width)
