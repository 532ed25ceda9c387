"""When a state counts as diverged."""

from __future__ import annotations

import math

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call

FASTEST = 1e4
"""1/s or m/s: a reduced velocity beyond it has diverged."""
FARTHEST = 1e3
"""m: a task error beyond it has diverged."""

_STATE, _DESIRED, _FAST, _FAR = 11, 12, 13, 14


def divergence_step(q: Array, z: Array, tip: Array, p_d: Array) -> Call:
    """A step that reports a status if the state has diverged; see :func:`divergence_reason`.

    Args:
        q: Configuration, shape (nq,).
        z: Reduced velocity, shape (nz,).
        tip: Position of the tip (m), shape (3,).
        p_d: The desired position in its first row, shape (4, m).
    """
    return call(_diverged, q, z, tip, p_d)


def divergence_reason(status: int, z: Array, error: Array) -> str | None:
    """What a status of :func:`divergence_step` means; None if it is not one of its own.

    Args:
        status: The status.
        z: Reduced velocity, shape (nz,).
        error: Task error (m), shape (m,).
    """
    return {
        _STATE: "the state is not finite",
        _DESIRED: "the desired trajectory is not finite",
        _FAST: f"|z| is {np.abs(z).max():.3g}, above {FASTEST:g}",
        _FAR: f"|e^e| is {np.abs(error).max():.3g} m, above {FARTHEST:g} m",
    }.get(status)


@kernel
def _diverged(q: Vector, z: Vector, tip: Vector, p_d: Matrix) -> int:
    for i in range(q.shape[0]):
        if not math.isfinite(q[i]):
            return _STATE
    for i in range(z.shape[0]):
        if not math.isfinite(z[i]):
            return _STATE
    for i in range(p_d.shape[1]):
        if not math.isfinite(tip[i] - p_d[0, i]):
            return _DESIRED
    for i in range(z.shape[0]):
        if abs(z[i]) > FASTEST:
            return _FAST
    for i in range(p_d.shape[1]):
        if abs(tip[i] - p_d[0, i]) > FARTHEST:
            return _FAR
    return 0
