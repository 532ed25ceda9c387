r"""Platforms whose constraints are constant in the platform's own frame: all but steered ones.

With :math:`E(\theta) = \mathrm{blkdiag}(R_z(\theta), I)`, which turns the platform's axes into the
world's, :math:`A(x) = A_b E^T` and :math:`N(x) = E N_b` with constant :math:`A_b, N_b`, so that
:math:`A N = A_b N_b = 0`; and :math:`B'' = E B_b`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.model.platforms.platform import Equations, Platform, Wheel
from mobman.robots.urdf.compose import BASE_JOINTS


class BodyFramePlatform(Platform):
    """Base of the types with constant matrices in the platform's frame; see the module.

    Args:
        joints: Names of the coordinates beside the pose: wheels.
        velocity_names: Names of alpha.
        A_b: Shape (k, l).
        N_b: Shape (l, l-k).
        B_b: Shape (l, l-k).
        root_offset, heading, wheels: See :class:`Platform`.
    """

    def __init__(
        self,
        joints: Sequence[str],
        velocity_names: Sequence[str],
        A_b: Array,
        N_b: Array,
        B_b: Array,
        *,
        root_offset: Array | None = None,
        heading: float = 0.0,
        wheels: tuple[Wheel, ...] = (),
    ) -> None:
        self.coordinates = (*BASE_JOINTS, *joints)
        self.velocity_names = tuple(velocity_names)
        self.root_offset = np.zeros(3) if root_offset is None else root_offset
        self.heading, self.wheels = heading, wheels
        self.equations = Equations(
            np.concatenate([np.ravel(N_b), np.ravel(B_b), np.ravel(A_b)]),
            *(_velocity_map, _velocity_map_rate, _constraints),
            *(_constraint_derivative_rate, _actuation),
        )


def offset_of(x: float, y: float, height: float, heading: float) -> Array:
    """Root offset of a platform whose reference point is at (x, y) in the root link's frame (m)."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([-c * x - s * y, s * x - c * y, height])


# Parameters of the kernels: N_b, B_b, A_b, row by row; x = (x_1, x_2, theta, ...).


@kernel
def _turned(parameters: Vector, start: int, c: float, s: float, matrix: Matrix) -> None:
    """E times a constant matrix, for the cosine and sine of the heading."""
    l, p = matrix.shape
    for j in range(p):
        forward, left = parameters[start + j], parameters[start + p + j]
        matrix[0, j] = c * forward - s * left
        matrix[1, j] = s * forward + c * left
        for i in range(2, l):
            matrix[i, j] = parameters[start + i * p + j]


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """N = E N_b; by itself, so that loading a robot needs no machine code."""
    l, p = N.shape
    c, s = math.cos(x[2]), math.sin(x[2])
    for j in range(p):
        N[0, j] = c * parameters[j] - s * parameters[p + j]
        N[1, j] = s * parameters[j] + c * parameters[p + j]
        for i in range(2, l):
            N[i, j] = parameters[i * p + j]


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of E N_b; only the heading changes it."""
    l, p = N_rate.shape
    _turned(parameters, 0, -math.sin(x[2]) * x_dot[2], math.cos(x[2]) * x_dot[2], N_rate)
    for i in range(2, l):
        for j in range(p):
            N_rate[i, j] = 0.0


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """B'' = E B_b."""
    _turned(parameters, B.shape[0] * B.shape[1], math.cos(x[2]), math.sin(x[2]), B)


@kernel
def _constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """A = A_b E^T and its derivatives."""
    k, l = A.shape
    start = 2 * l * (l - k)
    c, s = math.cos(x[2]), math.sin(x[2])
    A_x[:, :, :] = 0.0
    for i in range(k):
        row = start + i * l
        forward, left = parameters[row], parameters[row + 1]
        A[i, 0] = c * forward - s * left
        A[i, 1] = s * forward + c * left
        for j in range(2, l):
            A[i, j] = parameters[row + j]
        A_x[i, 0, 2] = -s * forward - c * left
        A_x[i, 1, 2] = c * forward - s * left


@kernel
def _constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A_b E^T."""
    k, l, _ = A_x_rate.shape
    start = 2 * l * (l - k)
    c, s = math.cos(x[2]) * x_dot[2], math.sin(x[2]) * x_dot[2]
    A_x_rate[:, :, :] = 0.0
    for i in range(k):
        forward, left = parameters[start + i * l], parameters[start + i * l + 1]
        A_x_rate[i, 0, 2] = -c * forward + s * left
        A_x_rate[i, 1, 2] = -s * forward - c * left
