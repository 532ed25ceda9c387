"""A platform as it is found: its wheels, which way is forward, and what about them does not move."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.findings import (
    CASTER,
    WITHOUT_WHEELS,
    Inferred,
    Lock,
    Options,
    lengthwise,
    sideways,
)
from mobman.robots.infer.kinematics import Joint, Tree
from mobman.robots.infer.wheels import SAME_PLACE, Rolling

_NAMES, _ROOT, _ARM = 1.5, 1.0, 0.5  # how much each kind of evidence for forward counts
_CLEAR = 0.75  # less evidence than this is uncertain
_NEAR = 0.02  # m; a place that near the middle is neither in front nor behind
_EXACT = 1e-6  # rad
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


_AHEAD = Forward(0.0, "the root link's x axis")


@dataclass
class Drive:
    """A platform.

    Attributes:
        type: Its type. Of those in :data:`WITHOUT_WHEELS` the wheels only say where the axle is.
        right, left: Driven wheels, in pairs, the front ones first; of a car, the rear ones.
        wheels: Of an omnidirectional platform.
        kind: Of its wheels: ``"mecanum"`` or ``"omni"``.
        steering: Joints that steer, right first.
        front: Wheels that they steer, right first.
        forward: Where forward is.
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
    forward: Forward = _AHEAD
    locks: list[Lock] = field(default_factory=list)
    uncertain: list[str] = field(default_factory=list)

    @property
    def driven(self) -> list[Rolling]:
        """The wheels that drive."""
        return [*self.right, *self.left, *self.wheels]

    @property
    def rolling(self) -> list[Rolling]:
        """All wheels that are coordinates of the platform."""
        return [] if self.type.value in WITHOUT_WHEELS else [*self.driven, *self.front]

    @property
    def own(self) -> set[str]:
        """Names of the joints that are coordinates of the platform."""
        return {w.name for w in self.rolling} | {joint.name for joint in self.steering}

    @property
    def half_track(self) -> float | None:
        """Half the distance of right and left wheels (m)."""
        if not self.right:
            return None
        sides = [[w.joint.centre[:2] for w in side] for side in (self.right, self.left)]
        return 0.5 * float(np.mean((np.array(sides[1]) - sides[0]) @ self.forward.left))

    @property
    def centre(self) -> Array | None:
        """The middle of the driven wheels in the root's frame (m), shape (3,)."""
        centres = [w.joint.centre for w in self.driven]
        return np.array(np.mean(centres, axis=0)) if centres else None


def orient(tree: Tree, drive: Drive, wheels: list[Rolling], options: Options, arms: Array) -> None:
    """Forward, and with it right and left and the order of wheels."""
    driven = drive.driven
    if options.heading is not None:
        drive.forward = Forward(float(options.heading), "as asked for")
    elif drive.steering and driven:
        axle = np.mean([w.joint.centre[:2] for w in driven], axis=0)
        steered = np.mean([joint.centre[:2] for joint in drive.steering], axis=0)
        ahead = driven[0].ahead * np.sign((steered - axle) @ driven[0].ahead)
        drive.forward = Forward(_heading_of(ahead), "the steered wheels are in front")
    elif driven and all(driven[0].parallel(w) for w in driven):
        others = [w for w in wheels if w not in driven]
        drive.forward, clear = _find_forward(tree, driven, others, arms)
        if not clear:
            drive.uncertain.append(
                f"which way is forward ({drive.forward.why}); the other way: --heading "
                f"{_heading_of(-drive.forward.direction):.10g}"
            )
    left, ahead = drive.forward.left, drive.forward.direction

    def along(direction: Array) -> Callable[[Rolling], float]:
        return lambda w: float(w.joint.centre[:2] @ direction)

    to_the_left, to_the_front = along(left), along(ahead)
    if not options.right_wheels:
        pairs = [
            sorted(pair, key=to_the_left) for pair in zip(drive.right, drive.left, strict=True)
        ]
        pairs.sort(key=lambda pair: -to_the_front(pair[0]))
        drive.right, drive.left = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    if not options.wheels:
        drive.wheels.sort(key=lambda w: (-round(to_the_front(w) / SAME_PLACE), -to_the_left(w)))
    drive.steering.sort(key=lambda joint: float(joint.centre[:2] @ left))
    drive.front.sort(key=to_the_left)


def _find_forward(
    tree: Tree, wheels: Sequence[Rolling], others: Sequence[Rolling], arms: Array
) -> tuple[Forward, bool]:
    """Forward of a platform with parallel wheels, across their axes; and whether that is clear.

    Args:
        tree: The robot.
        wheels: Its driven wheels, in pairs.
        others: Casters and other wheels, whose names may tell.
        arms: Where the ends of arms and heads are with all joints at zero (m), shape (n, 3).
    """
    axes = np.array([w.across for w in wheels])
    axes[axes @ axes[0] < 0.0] *= -1.0
    # the nearest axis of the root: what is off by rounded numbers in the URDF is meant to be along it
    across = axes.mean(axis=0) / np.linalg.norm(axes.mean(axis=0))
    if np.linalg.norm(across - np.round(across)) < 5e-4:
        across = np.round(across)
    ahead = np.array([across[1], -across[0]])
    centre = np.mean([w.joint.centre[:2] for w in wheels], axis=0)
    reasons: list[tuple[float, str]] = []
    sides = [
        sideways(w.name, w.joint.child) * np.sign((w.joint.centre[:2] - centre) @ across)
        for w in wheels
    ]
    if total := sum(sides):
        reasons.append((_NAMES * total / len(sides), "the wheels' names (right, left)"))
    places = [(lengthwise(w.name, w.joint.child), w.joint.centre[:2]) for w in (*wheels, *others)]
    places += [(lengthwise(name), tree.position[name][:2]) for name in tree.rigid(tree.root)]
    # +1 where a name that says front or rear agrees, -1 where not
    ends = [
        end * float(np.sign((place - centre) @ ahead))
        for end, place in places
        if end and abs((place - centre) @ ahead) > _NEAR
    ]
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
    if against := ", ".join(text for weight, text in reasons if weight * sign < 0.0):
        why += f"; against it: {against}"
    return Forward(_heading_of(sign * ahead), why), abs(vote) >= _CLEAR


def _heading_of(direction: Array) -> float:
    """The angle of a direction (rad), exact where it is along an axis."""
    angle = math.atan2(float(direction[1]), float(direction[0]))
    quarter = round(angle / (0.5 * math.pi)) * 0.5 * math.pi
    angle = quarter if abs(angle - quarter) < _EXACT else round(angle, 9)
    return math.pi if angle <= -math.pi else angle + 0.0


def lock_passive(drive: Drive, wheels: list[Rolling]) -> None:
    """Lock everything about wheels that is no coordinate of the platform."""
    own = drive.own
    done = {name for lock in drive.locks for name in lock.joints} | own

    def lock(joints: Iterable[Joint | None], why: str) -> None:
        names = dict.fromkeys(j.name for j in joints if j is not None and j.name not in done)
        done.update(names)
        if names:
            drive.locks.append(Lock(tuple(names), why))

    if drive.type.value in WITHOUT_WHEELS:
        # they stay where they are for the axle's place, but are no coordinates
        names = tuple(w.name for w in wheels)
        drive.locks.append(Lock(names, f"wheels: {drive.type.value} platforms have none"))
        done.update(names)
    turning = [w for w in wheels if w.name not in own]
    every = [*drive.rolling, *turning]
    casters = [w for w in turning if w.swivel is not None or w.says(CASTER)]
    lock((j for w in casters for j in (w.swivel, w.joint, *w.rollers)), "casters")
    lock(
        (j for w in turning for j in (w.steering, w.joint, *w.rollers)), "wheels that do not drive"
    )
    lock((j for w in every for j in w.suspension), "suspension")
    lock((w.swivel for w in every), "swivels of the wheels")
    lock((j for w in every for j in w.rollers), "rollers")
