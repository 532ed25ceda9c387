"""A platform's type and its wheels, as they are found."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference.findings import Finding, Lock
from mobman.robots.inference.forward import Forward
from mobman.robots.inference.tree import Joint
from mobman.robots.inference.wheels import Rolling

WITHOUT_WHEELS = ("unicycle", "fixed")
"""Types whose wheels are no coordinates."""
_OMNI = Finding("omni", "rollers across the wheel's axis")
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

    type: Finding
    right: list[Rolling] = field(default_factory=list)
    left: list[Rolling] = field(default_factory=list)
    wheels: list[Rolling] = field(default_factory=list)
    kind: Finding = _OMNI
    steering: list[Joint] = field(default_factory=list)
    front: list[Rolling] = field(default_factory=list)
    forward: Forward = _AHEAD
    locks: list[Lock] = field(default_factory=list)
    uncertain: list[str] = field(default_factory=list)

    @property
    def rolling(self) -> list[Rolling]:
        """All wheels that are coordinates of the platform."""
        if self.type.value in WITHOUT_WHEELS:
            return []
        return [*self.right, *self.left, *self.wheels, *self.front]

    @property
    def own(self) -> set[str]:
        """Names of the joints that are coordinates of the platform."""
        return {w.name for w in self.rolling} | {joint.name for joint in self.steering}

    @property
    def half_track(self) -> float | None:
        """Half the distance of right and left wheels (m)."""
        if not self.right:
            return None
        across = [
            float(
                (left.joint.centre[:2] - right.joint.centre[:2]) @ self.forward.left,
            )
            for right, left in zip(self.right, self.left, strict=True)
        ]
        return 0.5 * float(np.mean(across))

    @property
    def centre(self) -> Array | None:
        """The middle of the driven wheels in the root's frame (m), shape (3,)."""
        driven = [*self.right, *self.left, *self.wheels]
        if not driven:
            return None
        result: Array = np.mean([w.joint.centre for w in driven], axis=0)
        return result
