r"""Platforms whose constraints are constant in axes of the platform: all but those that are steered.

With :math:`E(\beta) = \mathrm{blkdiag}(R_z(\beta), I)`, which turns these axes into the world's,
:math:`A(x) = A_b E^T` and :math:`N(x) = E N_b` with constant :math:`A_b, N_b`, so that
:math:`A N = A_b N_b = 0`; and :math:`B'' = E B_b`. The axes are the platform's,
:math:`\beta = \theta`, or those of a carriage that a joint turns against it,
:math:`\beta = \theta + s x_j`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.model.platforms.platform import Equations, Platform
from mobman.model.platforms.rolling import constraint_derivative_rate, constraints, row


class BodyFramePlatform(Platform):
    """Base of the types with constant matrices in axes of the platform; see the module.

    Args:
        joints: Names of the coordinates beside the pose: wheels.
        velocity_names: Names of alpha.
        A_b: Shape (k, l).
        N_b: Shape (l, l-k).
        B_b: Shape (l, l-k).
        turned: The place j of the carriage's joint in x, and s; by default the axes are the platform's.
        **place: ``root_offset``, ``heading`` and ``wheels``, see :class:`Platform`.
    """

    def __init__(
        self,
        joints: Sequence[str],
        velocity_names: Sequence[str],
        A_b: Array,
        N_b: Array,
        B_b: Array,
        turned: tuple[int, float] = (2, 0.0),
        **place: Any,
    ) -> None:
        rows = [
            row(len(own), complex(*own[:2]), steered=turned, others=dict(enumerate(own[2:], 2)))
            for own in A_b
        ]
        numbers = np.concatenate([np.ravel(part) for part in (rows, N_b, B_b, turned)])
        kernels = _velocity_map, _velocity_map_rate, constraints, constraint_derivative_rate
        super().__init__(joints, velocity_names, Equations(numbers, *kernels, _actuation), **place)


def offset_of(x: float, y: float, height: float, heading: float) -> Array:
    """Root offset of a platform whose reference point is at (x, y) in the root link's frame (m)."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([-c * x - s * y, s * x - c * y, height])


# Parameters of the kernels: the table of constraints; N_b, B_b, row by row; j, s.


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """N = E N_b; by itself, so that loading a robot needs no machine code."""
    l, p = N.shape
    N_b = parameters[(l - p) * (6 + l) :]
    beta = x[2] + parameters[-1] * x[int(parameters[-2])]
    c, s = math.cos(beta), math.sin(beta)
    for j in range(p):
        N[0, j] = c * N_b[j] - s * N_b[p + j]
        N[1, j] = s * N_b[j] + c * N_b[p + j]
        for i in range(2, l):
            N[i, j] = N_b[i * p + j]


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of E N_b; only the direction of the axes changes it."""
    l, p = N_rate.shape
    N_b = parameters[(l - p) * (6 + l) :]
    joint, sign = int(parameters[-2]), parameters[-1]
    beta, turning = x[2] + sign * x[joint], x_dot[2] + sign * x_dot[joint]
    c, s = -math.sin(beta) * turning, math.cos(beta) * turning
    N_rate[:, :] = 0.0
    for j in range(p):
        N_rate[0, j] = c * N_b[j] - s * N_b[p + j]
        N_rate[1, j] = s * N_b[j] + c * N_b[p + j]


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """B'' = E B_b."""
    _velocity_map(parameters[B.size :], x, B)
