"""The unit vectors as functions with a result."""

from __future__ import annotations

import numpy as np

from mobman.controllers import tsm
from mobman.controllers import unit_vector as kernels


def unit_vector(s, boundary_layer=0.0) -> np.ndarray:
    """s/|s|, as printed."""
    n = np.full_like(s, np.nan)
    kernels.explicit_unit_vector(s, boundary_layer, n)
    return n


def implicit_unit_vector(metric, gram, b, boundary_layer=0.0) -> np.ndarray:
    """n at the tick's end, for P = M^-1 K."""
    n, work = np.full_like(b, np.nan), np.full((len(b) + 2, len(b)), np.nan)
    assert kernels.implicit_unit_vector(metric, gram, b, boundary_layer, n, work)
    return n


def sampled_unit_vector(discretization, boundary_layer, s, drift, metric, gram) -> np.ndarray:
    """n as the stages choose it for a tick that starts at s and would end at s + drift."""
    gains = tsm.SlidingGains(discretization=discretization, boundary_layer=boundary_layer)
    stage = tsm.SlidingStage.of(gains, len(s))
    given = ((stage.s, s), (stage.drift, drift), (stage.metric, metric), (stage.gram, gram))
    for array, value in given:
        array[:] = value
    in_force = tsm.in_force(gains, 1.0, 1.0, 1.0, inverse=False)
    assert tsm.unit_vector(in_force[0], stage, 1.0)
    return stage.n
