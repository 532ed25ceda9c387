"""Which way is forward."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference import hints
from mobman.robots.inference.tree import Tree
from mobman.robots.inference.wheels import Rolling

_NAMES, _ROOT, _ARM = 1.5, 1.0, 0.5  # how much each kind of evidence counts
_CLEAR = 0.75  # less evidence than this is uncertain
_NEAR = 0.02  # m; a place that near the middle is neither in front nor behind
_EXACT = 1e-6  # rad


@dataclass(frozen=True)
class Forward:
    """A direction in the root link's frame.

    Attributes:
        heading: Its angle about z from the root's x axis (rad).
        why: What says so.
        clear: Whether that is enough.
    """

    heading: float
    why: str
    clear: bool = True

    @property
    def direction(self) -> Array:
        """Unit vector, shape (2,)."""
        return np.array([math.cos(self.heading), math.sin(self.heading)])

    @property
    def left(self) -> Array:
        """Unit vector to the left, shape (2,)."""
        return np.array([-math.sin(self.heading), math.cos(self.heading)])


def find_forward(
    tree: Tree, wheels: Sequence[Rolling], others: Sequence[Rolling], arms: Array
) -> Forward:
    """Forward of a platform with parallel wheels: across their axes, one way or the other.

    Args:
        tree: The robot.
        wheels: Its driven wheels, in pairs.
        others: Casters and other wheels, whose names may tell.
        arms: Where the ends of arms and heads are with all joints at zero (m), shape (n, 3).
    """
    across = _common_axis(wheels)
    ahead = np.array([across[1], -across[0]])
    centre = np.mean([w.joint.centre[:2] for w in wheels], axis=0)
    reasons: list[tuple[float, str]] = []

    sides = [
        hints.sideways(w.name, w.joint.child) * np.sign((w.joint.centre[:2] - centre) @ across)
        for w in wheels
    ]
    if total := sum(sides):
        reasons.append((_NAMES * total / len(sides), "the wheels' names (right, left)"))
    ends = _named_ends(tree, [*wheels, *others], centre, ahead)
    if ends:
        reasons.append((_NAMES * float(np.mean(ends)), "names with front and rear"))
    if abs(ahead[0]) > abs(ahead[1]):
        reasons.append((_ROOT * float(np.sign(ahead[0])), "the root link's x axis"))
    else:
        # no convention puts y ahead, but those who draw it so mean +y
        reasons.append((0.5 * _ARM * float(np.sign(ahead[1])), "the root link's y axis"))
    if len(arms):
        reach = (arms[:, :2] - centre) @ ahead
        far = float(reach[np.argmax(np.abs(reach))])
        if abs(far) > _NEAR:
            reasons.append((_ARM * float(np.sign(far)), "where the arm and the head reach"))
    vote = sum(weight for weight, _ in reasons)
    sign = 1.0 if vote >= 0.0 else -1.0
    why = ", ".join(text for weight, text in reasons if weight * sign > 0.0)
    against = ", ".join(text for weight, text in reasons if weight * sign < 0.0)
    if against:
        why += f"; against it: {against}"
    return Forward(heading_of(sign * ahead), why, abs(vote) >= _CLEAR)


def heading_of(direction: Array) -> float:
    """The angle of a direction (rad), exact where it is along an axis."""
    angle = math.atan2(float(direction[1]), float(direction[0]))
    quarter = round(angle / (0.5 * math.pi)) * 0.5 * math.pi
    angle = quarter if abs(angle - quarter) < _EXACT else round(angle, 9)
    return math.pi if angle <= -math.pi else angle + 0.0


def _common_axis(wheels: Sequence[Rolling]) -> Array:
    axes = np.array([w.across for w in wheels])
    axes[axes @ axes[0] < 0.0] *= -1.0
    # the nearest axis of the root: what is off by rounded numbers in the URDF is meant to be along it
    mean: Array = axes.mean(axis=0) / np.linalg.norm(axes.mean(axis=0))
    straight = np.round(mean)
    return straight if np.linalg.norm(mean - straight) < 5e-4 else mean


def _named_ends(tree: Tree, wheels: Sequence[Rolling], centre: Array, ahead: Array) -> list[float]:
    """For every name that says front or rear: +1 where ``ahead`` agrees, -1 where not."""
    places = [(hints.lengthwise(w.name, w.joint.child), w.joint.centre[:2]) for w in wheels]
    places += [(hints.lengthwise(name), tree.position[name][:2]) for name in tree.rigid(tree.root)]
    return [
        end * float(np.sign((place - centre) @ ahead))
        for end, place in places
        if end and abs((place - centre) @ ahead) > _NEAR
    ]
