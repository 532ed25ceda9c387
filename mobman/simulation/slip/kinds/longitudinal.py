"""Wheels that turn faster than the ground goes by."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call
from mobman.simulation.pieces import Piece
from mobman.simulation.slip.slip import slips


class Longitudinal(Piece):
    """All wheels slip by one ratio: the platform drives and turns at 1 - ``ratio`` of what they
    roll."""

    ratio: float = Field(gt=-1, lt=1)
    """(R omega - v)/(R omega); negative where the wheels slide, as in braking."""

    def start(
        self, random: np.random.Generator, pose: Array, rolling: Array, slipping: Array
    ) -> Call | None:
        """See :class:`Slip`."""
        return call(_slip, self.ratio, rolling, slipping) if self.ratio else None


@kernel
def _slip(ratio: float, rolling: Vector, slipping: Vector) -> None:
    for i in range(rolling.shape[0]):
        slipping[i] -= ratio * rolling[i]


slips.register("longitudinal", Longitudinal)
