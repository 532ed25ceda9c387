"""How the stages choose n, the sampled counterpart of the paper's unit vectors."""

from __future__ import annotations

from typing import Literal

from mobman.arrays import Array
from mobman.controllers.sliding.unit_vector import implicit_unit_vector, unit_vector

Discretization = Literal["implicit", "explicit"]
DISCRETIZATIONS: tuple[Discretization, ...] = ("implicit", "explicit")


def sampled_unit_vector(
    discretization: Discretization,
    boundary_layer: float,
    s: Array,
    drift: Array,
    metric: Array,
    gram: Array,
) -> Array:
    """n for a tick that starts at s.

    Args:
        discretization: ``"implicit"``, the unit vector of s at the tick's end, or ``"explicit"``, as
            printed, at its start.
        boundary_layer: Width of the boundary layer, 0 for none.
        s: The sliding variable now, shape (p,).
        drift: What is known of its change over the tick without control, shape (p,).
        metric: See :func:`implicit_unit_vector`.
        gram: See :func:`implicit_unit_vector`.
    """
    if discretization == "explicit":
        return unit_vector(s, boundary_layer)
    return implicit_unit_vector(metric, gram, s + drift, boundary_layer)
