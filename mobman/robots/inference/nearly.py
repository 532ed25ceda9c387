"""Why a pair of joints that might be the driven wheels was not taken for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from mobman.robots.inference import hints
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.radius import wheel_radius
from mobman.robots.inference.tree import Joint, Tree
from mobman.robots.inference.wheels import FEW_JOINTS, SAME_PLACE, SAME_RADIUS, carries_nothing

WHEEL = r"wheel(?!_?base)"
_LEANS = 0.5  # rad; what is more tilted turns about no wheel's axis
_ALIKE = 0.1  # rad; between the axes of one pair, and between an axis and the way across
_LEVEL = 0.001  # m, rad; what platforms with wheels allow between axles and axes


@dataclass(frozen=True)
class NearPair:
    """Two joints and what is wrong with them.

    Attributes:
        names: Of the joints.
        faults: What kept them from being taken.
        nameable: Whether they can be named as wheels: the platform takes them as they are.
    """

    names: tuple[str, str]
    faults: tuple[str, ...]
    nameable: bool


def candidates(tree: Tree) -> list[Joint]:
    """Joints that may be wheels: they turn without limits, not about the vertical, and carry nothing."""
    return [
        joint
        for joint in tree.movable
        if not joint.prismatic
        and not joint.mimic
        and (joint.endless or hints.says(WHEEL, joint.name, joint.child))
        and abs(float(joint.axis[2])) < math.sin(_LEANS)
        and carries_nothing(tree, joint)
        and len(tree.chain(joint.parent)) <= FEW_JOINTS
    ]


def nearest_pair(tree: Tree, geometry: Geometry) -> NearPair | None:
    """The pair of candidates with the fewest faults, the most telling names and the widest track."""
    pairs = [
        (pair, one, other)
        for one, other in combinations(candidates(tree), 2)
        if (pair := _compared(tree, geometry, one, other)) is not None
    ]
    if not pairs:
        return None

    def rank(entry: tuple[NearPair, Joint, Joint]) -> tuple[int, int, float]:
        pair, one, other = entry
        named = sum(hints.says(WHEEL, joint.name, joint.child) for joint in (one, other))
        return len(pair.faults), -named, -float(np.linalg.norm(one.centre - other.centre))

    return min(pairs, key=rank)[0]


def _compared(tree: Tree, geometry: Geometry, one: Joint, other: Joint) -> NearPair | None:
    """None if they are not side by side at all."""
    apart = other.centre - one.centre
    across = one.axis[:2] / np.linalg.norm(one.axis[:2])
    track = float(apart[:2] @ across)
    if abs(track) < SAME_PLACE or abs(one.axis @ other.axis) < math.cos(2.0 * _LEANS):
        return None
    ahead = abs(float(apart[:2] @ np.array([across[1], -across[0]])))
    if ahead > abs(track):
        return None
    faults = []
    nameable = True
    tilts = [math.asin(min(abs(float(joint.axis[2])), 1.0)) for joint in (one, other)]
    if not (one.horizontal and other.horizontal):
        lean = " and ".join(f"{tilt:.3g}" for tilt in tilts)
        faults.append(f"their axes are {lean} rad from horizontal (camber)")
    level = abs(float(apart[2]))
    if level > SAME_PLACE:
        faults.append(f"their heights differ by {level:.3g} m")
    if ahead > SAME_PLACE:
        faults.append(f"one is {ahead:.3g} m ahead of the other")
    angle = math.acos(min(abs(float(one.axis @ other.axis)), 1.0))
    if angle > _ALIKE:
        faults.append(f"their axes are {angle:.3g} rad apart")
    nameable = max(*tilts, level, ahead, angle) <= _LEVEL
    radii = [_radius(tree, geometry, joint) for joint in (one, other)]
    if radii[0] is not None and radii[1] is not None and abs(radii[0] - radii[1]) > SAME_RADIUS:
        faults.append(f"their radii differ ({radii[0]:.4g} and {radii[1]:.4g} m)")
    if caster := [joint.name for joint in (one, other) if _is_caster(tree, joint)]:
        faults.append(f"{' and '.join(caster)} swivels or is a caster's by its name")
    if not faults:
        faults.append("they are not on the ground, or smaller than other wheels")
    return NearPair((one.name, other.name), tuple(faults), nameable)


def _radius(tree: Tree, geometry: Geometry, joint: Joint) -> float | None:
    for use in ("collision", "visual"):
        if (found := wheel_radius(tree, joint, use, geometry)) is not None:
            return found.value
    return None


def _is_caster(tree: Tree, joint: Joint) -> bool:
    return hints.says(hints.CASTER, joint.name, joint.child) or any(
        above.swivels for above in tree.chain(joint.parent)
    )
