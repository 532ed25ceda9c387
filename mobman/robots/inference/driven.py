"""Which of the wheels drive: not those that swivel freely, nor the smaller ones of casters."""

from __future__ import annotations

import numpy as np

from mobman.robots.inference import hints
from mobman.robots.inference.tree import Joint
from mobman.robots.inference.wheels import SAME_PLACE, SAME_RADIUS, Rolling, pairs_of

_BETWEEN = 0.25  # of the track: how far a turret's axis may be from the middle of its wheels


def driven_wheels(wheels: list[Rolling]) -> tuple[list[Rolling], tuple[str, ...]]:
    """The wheels that drive, and the joint of the turret that they may all be on."""
    fixed = [w for w in wheels if w.swivel is None and w.steering is None]
    turrets: tuple[str, ...] = ()
    swivels = {w.swivel for w in wheels if w.swivel is not None}
    if not pairs_of(fixed) and len(swivels) == 1:
        carried = [w for w in wheels if w.swivel is not None]
        swivel = next(iter(swivels))
        pairs = pairs_of(carried)
        if len(pairs) == 1 and swivel is not None and _around(swivel, *pairs[0]):
            fixed, turrets = carried, (swivel.name,)
    named = [w for w in fixed if not w.says(hints.CASTER)]
    fixed = named if len(named) >= 2 else fixed
    groups: list[list[Rolling]] = []
    for wheel in fixed:
        group = next((g for g in groups if _alike(g[0], wheel)), None)
        if group is None:
            groups.append([wheel])
        else:
            group.append(wheel)
    # casters are smaller than what drives
    groups = [g for g in groups if pairs_of(g) or len(g) >= 3]
    best = max(
        groups, key=lambda g: (g[0].radius or 0.0, float(g[0].joint.centre[2]), len(g)), default=[]
    )
    return best, turrets


def one_each(wheels: list[Rolling]) -> list[Rolling]:
    """One wheel for each joint that turns it about the vertical."""
    found: dict[object, Rolling] = {}
    for wheel in wheels:
        found.setdefault(wheel.swivel or wheel.steering or wheel, wheel)
    return list(found.values())


def _alike(one: Rolling, other: Rolling) -> bool:
    if abs(float(one.joint.centre[2] - other.joint.centre[2])) > SAME_PLACE:
        return False
    if one.radius is None or other.radius is None:
        return True
    return abs(one.radius - other.radius) <= SAME_RADIUS


def _around(swivel: Joint, one: Rolling, other: Rolling) -> bool:
    """Whether two wheels are on either side of a swivel's axis, not both at a caster's fork."""
    track = other.joint.centre[:2] - one.joint.centre[:2]
    middle = 0.5 * (other.joint.centre[:2] + one.joint.centre[:2])
    off = float(abs((swivel.centre[:2] - middle) @ track) / (track @ track))
    radius = one.radius or 0.0
    return off < _BETWEEN and float(np.linalg.norm(track)) > 2.0 * radius
