"""A platform as it is found in a URDF, and its forward direction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.findings import Inferred, Lock, lock_once, says, says_which
from mobman.robots.infer.kinematics import Joint, Tree
from mobman.robots.infer.wheels import (
    SAME_PLACE,
    Rolling,
    around,
    footprint,
    lowest_point,
    pairs_of,
)

# How much each kind of evidence for forward counts: names come before the root link and the arm together
_NAMES, _ROOT, _ARM = 1.6, 1.0, 0.5
_CLEAR = 0.75  # less evidence than this is uncertain
_NEAR = 0.02  # m; a place that near the middle is neither in front nor behind
_EXACT = 1e-6  # rad
_ALONG = 1e-2  # rad; rounded angles, such as 1.57 for a quarter of a turn
_ROUNDED = (1e-3, 1e-3)  # rad, m; what is farther off is worth a word
OMNI = Inferred("omni", "rollers across the wheel's axis")


@dataclass(frozen=True)
class Forward:
    """A direction in the root link's frame."""

    heading: float  # its angle about z from the root's x axis (rad)
    why: str  # the evidence

    @property
    def direction(self) -> Array:
        """Unit vector, shape (2,)."""
        return np.array([math.cos(self.heading), math.sin(self.heading)])

    @property
    def left(self) -> Array:
        """Unit vector to the left, shape (2,)."""
        return np.array([-math.sin(self.heading), math.cos(self.heading)])


@dataclass
class Drive:
    """A platform."""

    type: Inferred
    right: list[Rolling] = field(default_factory=list)
    left: list[Rolling] = field(default_factory=list)
    """Driven wheels, in pairs, the front ones first; of a car, the rear ones."""
    wheels: list[Rolling] = field(default_factory=list)  # of an omnidirectional platform
    kind: Inferred = OMNI  # of its wheels: "mecanum" or "omni"
    steering: list[Joint] = field(default_factory=list)  # joints that steer, right first
    front: list[Rolling] = field(default_factory=list)  # wheels that they steer, right first
    turret: Joint | None = None  # between the body and the carriage that the wheels are on
    forward: Forward = Forward(0.0, "the root link's x axis")
    coordinates: bool = True
    """Whether wheels are coordinates of the type; else they only say where the axle is."""
    locks: list[Lock] = field(default_factory=list)  # casters, suspensions, ... that do not move
    uncertain: list[str] = field(default_factory=list)  # what the URDF does not tell for sure

    @property
    def driven(self) -> list[Rolling]:
        """All wheels that motors turn."""
        return [*self.right, *self.left, *self.wheels]

    @property
    def rolling(self) -> list[Rolling]:
        """All wheels that are coordinates of the platform."""
        return [*self.driven, *self.front] if self.coordinates else []

    @property
    def own(self) -> set[str]:
        """Names of the joints that are coordinates of the platform."""
        turning = [*self.steering, *([self.turret] if self.turret is not None else [])]
        return {w.name for w in self.rolling} | {joint.name for joint in turning}

    @property
    def half_track(self) -> float | None:
        """Half the distance of right and left wheels (m)."""
        if not self.right:
            return None
        sides = [[w.middle[:2] for w in side] for side in (self.right, self.left)]
        return 0.5 * float(np.mean((np.array(sides[1]) - sides[0]) @ self.forward.left))

    @property
    def beside(self) -> float:
        """Largest distance of a tyre that drives from the frame of its joint, along the axis (m)."""
        return max((float(np.linalg.norm(w.middle - w.centre)) for w in self.driven), default=0.0)

    @property
    def wheelbase(self) -> float | None:
        """Distance of the first steering joint ahead of the middle of the driven wheels (m)."""
        if self.centre is None or not self.steering:
            return None
        return float((self.steering[0].centre - self.centre)[:2] @ self.forward.direction)

    @property
    def centre(self) -> Array | None:
        """The middle of the driven wheels in the root's frame (m), shape (3,)."""
        return np.mean([w.centre for w in self.driven], axis=0) if self.driven else None

    def rounded(self) -> list[str]:
        """Sentences about axes and axles that are not quite where the platform's equations have them."""
        exact = [] if self.wheels and self.kind.value == "omni" else self.rolling
        axes = [(wheel.joint, np.append(self.forward.left, 0.0)) for wheel in exact]
        axes += [(joint, np.array([0.0, 0.0, 1.0])) for joint in self.steering]
        tilts = [(one.name, math.acos(min(abs(float(one.axis @ axis)), 1.0))) for one, axis in axes]
        said = [
            f"the axis of {name} is {1e3 * off:.3g} mrad off; taken as exact"
            for name, off in tilts
            if off > _ROUNDED[0]
        ]
        for one, other in zip(self.right, self.left, strict=True):
            apart = other.centre - one.centre
            off = max(abs(float(apart[:2] @ self.forward.direction)), abs(float(apart[2])))
            if off > _ROUNDED[1]:
                axle = f"{1e3 * off:.3g} mm from one axle; taken as on one"
                said.append(f"{one.name} and {other.name} are {axle}")
        if self.wheels and self.rolling and self.beside > _ROUNDED[1]:
            said.append(
                f"the tyres are {1e3 * self.beside:.3g} mm beside the frames of their joints, which are "
                "taken as their places"
            )
        return said

    def orient(self, forward: Forward, keep_sides: bool, keep_wheels: bool) -> None:
        """Set forward, and with it right and left and the order of wheels, where these are not kept."""
        self.forward = forward

        def to_the_left(thing: Rolling | Joint) -> float:
            return float(thing.centre[:2] @ forward.left)

        def to_the_front(thing: Rolling | Joint) -> float:
            return float(thing.centre[:2] @ forward.direction)

        if not keep_sides:
            both = zip(self.right, self.left, strict=True)
            pairs = [sorted(pair, key=to_the_left) for pair in both]
            pairs.sort(key=lambda pair: -to_the_front(pair[0]))
            self.right, self.left = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
        if not keep_wheels:
            self.wheels.sort(key=lambda w: (-round(to_the_front(w) / SAME_PLACE), -to_the_left(w)))
        order = {w.turning: i for i, w in enumerate(self.wheels)}  # of a swerve platform
        last = len(order)
        self.steering.sort(key=lambda j: order.get(j, last) if order else to_the_left(j))
        self.front.sort(key=to_the_left)

    def lock_passive(self, wheels: list[Rolling]) -> None:
        """Lock everything about wheels that is no coordinate of the platform."""
        own = self.own
        turning = [w for w in wheels if w.name not in own]
        every = [*self.rolling, *turning]
        casters = [w for w in turning if w.swivel is not None or w.says("caster")]
        trailed = [  # on an axle that a joint about the vertical draws: wider than a caster's fork
            wheel
            for pair in pairs_of(casters)
            if (hitch := pair[0].swivel) is pair[1].swivel
            and hitch
            and around(hitch, *pair, alone=False)
            for wheel in pair
        ]
        none = "" if self.coordinates else f"wheels: {self.type.value} platforms have none"
        still = [w.name for w in wheels if none]  # where they are, for the axle's place
        idle = _names((w.steering, w.joint, *w.rollers) for w in turning)
        self.locks += lock_once(
            {name for lock in self.locks for name in lock.joints} | own,
            (still, none),
            (_names((w.swivel, w.joint) for w in trailed), "a trailer's hitch and wheels"),
            (_names((w.swivel, w.joint, *w.rollers) for w in casters), "casters"),
            (idle, "wheels that do not drive"),
            (_names(w.suspension for w in every), "suspension"),
            (_names((w.swivel,) for w in every), "swivels of the wheels"),
            (_names(w.rollers for w in every), "rollers"),
        )

    def ground(self, tree: Tree, radius: Inferred | None) -> tuple[Inferred, list[str]]:
        """The height of the ground in the root link's frame (m), and what is not certain about it."""
        if radius is not None and self.centre is not None:
            z = float(self.centre[2]) - float(radius.value)
            return Inferred(z, "where the wheels stand"), []
        lowest = lowest_point(tree, [*tree.rigid(tree.root), *(w.joint.child for w in self.driven)])
        named = footprint(tree, math.inf if lowest is None else lowest.value + 0.5)
        ground = named or lowest or Inferred(0.0, f"the origin of {tree.root}")
        if self.driven or self.type.value == "fixed" or says("footprint", ground.why):
            return ground, []
        doubt = f"nothing rolls on the ground, so that it is taken as {ground.why} says: platform.height"
        return ground, [doubt]


def _names(groups: Iterable[Iterable[Joint | None]]) -> list[str]:
    return [joint.name for joints in groups for joint in joints if joint is not None]


def find_forward(
    tree: Tree, wheels: Sequence[Rolling], others: Sequence[Rolling], arms: Array
) -> tuple[Forward, bool]:
    """Forward of a platform with parallel driven wheels, across their axes, and if that is clear."""
    axes = np.array([w.across for w in wheels])
    axes[axes @ axes[0] < 0.0] *= -1.0
    # the nearest axis of the root: what is off by rounded numbers in the URDF is meant to be along it
    across = axes.mean(axis=0) / np.linalg.norm(axes.mean(axis=0))
    if np.linalg.norm(across - np.round(across)) < _ALONG:
        across = np.round(across)
    ahead = np.array([across[1], -across[0]])
    centre = np.mean([w.centre[:2] for w in wheels], axis=0)
    sides = [
        w.says_which("left", "right") * np.sign((w.centre[:2] - centre) @ across) for w in wheels
    ]
    places = [(w.says_which("front", "rear"), w.centre[:2]) for w in (*wheels, *others)]
    fixed = tree.rigid(tree.root)
    places += [(says_which("front", "rear", name), tree.position[name][:2]) for name in fixed]
    # +1 where a name that says front or rear agrees, -1 where not
    ends = [
        end * float(np.sign((place - centre) @ ahead))
        for end, place in places
        if end and abs((place - centre) @ ahead) > _NEAR
    ]
    votes = [
        (_NAMES * float(np.mean(sides)), "the wheels' names (right, left)"),
        (_NAMES * float(np.mean(ends or [0.0])), "names with front and rear"),
    ]
    if abs(ahead[0]) > abs(ahead[1]):
        votes.append((_ROOT * float(np.sign(ahead[0])), "the root link's x axis"))
    else:  # no convention puts y ahead, but those who draw it so mean +y
        votes.append((0.5 * _ARM * float(np.sign(ahead[1])), "the root link's y axis"))
    if len(arms):
        reach = (arms[:, :2] - centre) @ ahead
        far = float(reach[np.argmax(np.abs(reach))])
        votes.append((_ARM * np.sign(far) * (abs(far) > _NEAR), "where the arm and the head reach"))
    vote = sum(weight for weight, _ in votes)
    sign = 1.0 if vote >= 0.0 else -1.0
    why = ", ".join(text for weight, text in votes if weight * sign > 0.0)
    if against := ", ".join(text for weight, text in votes if weight * sign < 0.0):
        why += f"; against it: {against}"
    return Forward(heading_of(sign * ahead), why), abs(vote) >= _CLEAR


def heading_of(direction: Array) -> float:
    """The angle of a direction (rad), exact where it is along an axis."""
    angle = math.atan2(float(direction[1]), float(direction[0]))
    quarter = round(angle / (0.5 * math.pi)) * 0.5 * math.pi
    angle = quarter if abs(angle - quarter) < _EXACT else round(angle, 9)
    return math.pi if angle <= -math.pi else angle + 0.0
