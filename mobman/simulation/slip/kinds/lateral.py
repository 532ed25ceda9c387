"""A platform that goes sideways."""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from mobman.arrays import Array, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call
from mobman.simulation.pieces import Piece, some_given
from mobman.simulation.slip.slip import slips


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

    def start(
        self, random: np.random.Generator, pose: Array, rolling: Array, slipping: Array
    ) -> Call | None:
        """See :class:`Slip`."""
        tangent, velocity = math.tan(self.angle or 0.0), self.velocity or 0.0
        if tangent == velocity == 0.0:
            return None
        return call(_slip, tangent, velocity, pose, rolling, slipping)


@kernel
def _slip(tangent: float, velocity: float, pose: Vector, rolling: Vector, slipping: Vector) -> None:
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    across = tangent * (cosine * rolling[0] + sine * rolling[1]) + velocity
    slipping[0] -= sine * across
    slipping[1] += cosine * across


slips.register("lateral", Lateral)
