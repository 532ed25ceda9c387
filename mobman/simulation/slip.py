"""Slip of the platform: a velocity of its pose in addition to that of rolling."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Self

from pydantic import Field, model_validator

from mobman.arrays import Array, Vector
from mobman.compiled import bind, kernel
from mobman.simulation.pieces import PACKAGE, Piece, Setting, Types, some_given

Slip = Callable[[Array, Array, Array], Callable[[], None]]
"""Gives a function that adds to the third: the pose (x1, x2, theta) (m, m, rad), its rate if the wheels
roll (the pose's part of C z), and its rate by slip; shapes (3,), read in place."""

slips = Types("slip type", PACKAGE, "mobman.slip")
"""Types of slip; each starts as a :data:`Slip`, or None."""


class Longitudinal(Piece):
    """All wheels slip by one ratio: the platform drives and turns at 1 - ``ratio`` of what they
    roll."""

    ratio: float = Field(gt=-1, lt=1)
    """(R omega - v)/(R omega); negative where the wheels slide, as in braking."""

    def start(self, setting: Setting) -> Slip | None:
        """See :class:`Piece`."""
        ratio = self.ratio
        if not ratio:
            return None
        return lambda pose, rolling, slipping: bind(_longitudinal, ratio, rolling, slipping)


class Lateral(Piece):
    """A velocity across the heading, to the left."""

    angle: float | None = Field(None, gt=-1.5, lt=1.5)
    """Slip angle (rad): tan(angle) of the velocity along the heading."""
    velocity: float | None = None
    """m/s, also at rest: as on a slope."""

    @model_validator(mode="after")
    def _given(self) -> Self:
        some_given({"angle": self.angle, "velocity": self.velocity})
        return self

    def start(self, setting: Setting) -> Slip | None:
        """See :class:`Piece`."""
        tangent, velocity = math.tan(self.angle or 0.0), self.velocity or 0.0
        if tangent == velocity == 0.0:
            return None
        return lambda *arrays: bind(_lateral, tangent, velocity, *arrays)


@kernel
def _longitudinal(ratio: float, rolling: Vector, slipping: Vector) -> None:
    for i in range(rolling.shape[0]):
        slipping[i] -= ratio * rolling[i]


@kernel
def _lateral(
    tangent: float, velocity: float, pose: Vector, rolling: Vector, slipping: Vector
) -> None:
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    across = tangent * (cosine * rolling[0] + sine * rolling[1]) + velocity
    slipping[0] -= sine * across
    slipping[1] += cosine * across


slips.register("longitudinal", Longitudinal)
slips.register("lateral", Lateral)
