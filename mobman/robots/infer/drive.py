"""A platform as it is found in a URDF, and its forward direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.findings import Inferred, Lock, lengthwise, sideways
from mobman.robots.infer.kinematics import Joint, Tree
from mobman.robots.infer.wheels import Rolling

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
    """A direction in the root link's frame.

    Attributes:
        heading: Its angle about z from the root's x axis (rad).
        why: The evidence.
    """

    heading: float
    why: str

    @property
    def direction(self) -> Array:
        """Unit vector, shape (2,)."""
        return np.array([math.cos(self.heading), math.sin(self.heading)])

    @property
    def left(self) -> Array:
        """Unit vector to the left, shape (2,)."""
        return np.array([-math.sin(self.heading), math.cos(self.heading)])


_UP = np.array([0.0, 0.0, 1.0])
_AHEAD = Forward(0.0, "the root link's x axis")


@dataclass
class Drive:
    """A platform.

    Attributes:
        type: Its type.
        right, left: Driven wheels, in pairs, the front ones first; of a car, the rear ones.
        wheels: Of an omnidirectional platform.
        kind: Of its wheels: ``"mecanum"`` or ``"omni"``.
        steering: Joints that steer, right first.
        front: Wheels that they steer, right first.
        turret: The joint between the body and the carriage that the wheels are on.
        forward: Where forward is.
        coordinates: Whether wheels are coordinates of the type; else they only say where the axle is.
        locks: Casters, suspensions, ... and why they do not move.
        uncertain: What the URDF does not tell for sure.
    """

    type: Inferred
    right: list[Rolling] = field(default_factory=list)
    left: list[Rolling] = field(default_factory=list)
    wheels: list[Rolling] = field(default_factory=list)
    kind: Inferred = OMNI
    steering: list[Joint] = field(default_factory=list)
    front: list[Rolling] = field(default_factory=list)
    turret: Joint | None = None
    forward: Forward = _AHEAD
    coordinates: bool = True
    locks: list[Lock] = field(default_factory=list)
    uncertain: list[str] = field(default_factory=list)

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
        return max(
            (float(np.linalg.norm(w.middle - w.joint.centre)) for w in self.driven), default=0.0
        )

    @property
    def centre(self) -> Array | None:
        """The middle of the driven wheels in the root's frame (m), shape (3,)."""
        centres = [w.joint.centre for w in self.driven]
        return np.array(np.mean(centres, axis=0)) if centres else None

    def rounded(self) -> list[str]:
        """Sentences about axes and axles that are not quite where the platform's equations have them."""
        said, left = [], np.append(self.forward.left, 0.0)
        exact = [] if self.wheels and self.kind.value == "omni" else self.rolling
        for axis, of in ((left, [w.joint for w in exact]), (_UP, self.steering)):
            for joint in of:
                off = math.acos(min(abs(float(joint.axis @ axis)), 1.0))
                if off > _ROUNDED[0]:
                    said.append(
                        f"the axis of {joint.name} is {1e3 * off:.3g} mrad off; taken as exact"
                    )
        ahead = np.append(self.forward.direction, 0.0)
        for one, other in zip(self.right, self.left, strict=True):
            apart = other.joint.centre - one.joint.centre
            off = max(abs(float(apart @ ahead)), abs(float(apart[2])))
            if off > _ROUNDED[1]:
                said.append(
                    f"{one.name} and {other.name} are {1e3 * off:.3g} mm from one axle; taken as on one"
                )
        if self.wheels and self.rolling and self.beside > _ROUNDED[1]:
            said.append(
                f"the tyres are {1e3 * self.beside:.3g} mm beside the frames of their joints, which are "
                "taken as their places"
            )
        return said


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
    centre = np.mean([w.joint.centre[:2] for w in wheels], axis=0)
    sides = [
        sideways(w.name, w.joint.child) * np.sign((w.joint.centre[:2] - centre) @ across)
        for w in wheels
    ]
    places = [(lengthwise(w.name, w.joint.child), w.joint.centre[:2]) for w in (*wheels, *others)]
    places += [(lengthwise(name), tree.position[name][:2]) for name in tree.rigid(tree.root)]
    # +1 where a name that says front or rear agrees, -1 where not
    ends = [
        end * float(np.sign((place - centre) @ ahead))
        for end, place in places
        if end and abs((place - centre) @ ahead) > _NEAR
    ]
    along_x = abs(ahead[0]) > abs(ahead[1])
    votes = [
        (_NAMES * float(np.mean(sides)), "the wheels' names (right, left)"),
        (_NAMES * float(np.mean(ends or [0.0])), "names with front and rear"),
        # no convention puts y ahead, but those who draw it so mean +y
        (_ROOT * float(np.sign(ahead[0])), "the root link's x axis")
        if along_x
        else (0.5 * _ARM * float(np.sign(ahead[1])), "the root link's y axis"),
    ]
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
