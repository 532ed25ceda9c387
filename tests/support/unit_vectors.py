"""The kernels of the unit vectors as functions with a result."""

from __future__ import annotations

import numpy as np

from mobman.controllers import unit_vector as kernels
from mobman.controllers.unit_vector import unit_vector_steps
from mobman.kernels.program import program


def unit_vector(s, boundary_layer=0.0) -> np.ndarray:
    """s/|s|, as printed."""
    n = np.full_like(s, np.nan)
    kernels.explicit_unit_vector(s, boundary_layer, n)
    return n


def implicit_unit_vector(metric, gram, b, boundary_layer=0.0) -> np.ndarray:
    """n at the tick's end, for P = M^-1 K."""
    n, right, column = np.full((3, len(b)), np.nan)
    lower = np.full_like(gram, np.nan)
    status = kernels.implicit_unit_vector(metric, gram, b, boundary_layer, n, right, lower, column)
    assert status == 0
    return n


def sampled_unit_vector(discretization, boundary_layer, s, drift, metric, gram) -> np.ndarray:
    """n as the stages choose it for a tick that starts at s and would end at s + drift."""
    n = np.full_like(s, np.nan)
    steps = unit_vector_steps(discretization, boundary_layer, s, s + drift, metric, gram, n)
    assert program(steps)() == 0
    return n
