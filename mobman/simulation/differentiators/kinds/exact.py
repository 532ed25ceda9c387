"""z' as it is."""

from __future__ import annotations

from mobman.arrays import Array
from mobman.simulation.differentiators.differentiator import Estimate, differentiators
from mobman.simulation.pieces import Piece


class Exact(Piece):
    """The true z' under the torque held until now: what an ideal sensor shows."""

    def start(self, names: list[str], dt: float) -> Estimate:
        """See :class:`Differentiator`."""
        return _true


def _true(z: Array, true: Array) -> Array:
    return true.copy()


differentiators.register("exact", Exact)
