"""How the stages choose n, the sampled counterpart of the paper's unit vectors."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mobman.arrays import Array
from mobman.controllers.sliding.unit_vector import explicit_unit_vector, implicit_unit_vector
from mobman.kernels.program import Call, call

Discretization = Literal["implicit", "explicit"]
DISCRETIZATIONS: tuple[Discretization, ...] = ("implicit", "explicit")


def unit_vector_steps(
    discretization: Discretization,
    boundary_layer: float,
    s: Array,
    b: Array,
    metric: Array,
    gram: Array,
    n: Array,
) -> list[Call]:
    """Steps that choose n for a tick that starts at s.

    Args:
        discretization: ``"implicit"``, the unit vector of s at the tick's end, or ``"explicit"``, as
            printed, at its start.
        boundary_layer: Width of the boundary layer, 0 for none.
        s: The sliding variable now, shape (p,).
        b: What it would be at the tick's end without control, shape (p,).
        metric: See :func:`implicit_unit_vector`.
        gram: See :func:`implicit_unit_vector`.
        n: For the result, shape (p,).
    """
    layer = float(boundary_layer)
    if discretization == "explicit":
        return [call(explicit_unit_vector, s, layer, n)]
    work = (np.zeros_like(s), np.zeros_like(gram), np.zeros_like(s))
    return [call(implicit_unit_vector, metric, gram, b, layer, n, *work)]
