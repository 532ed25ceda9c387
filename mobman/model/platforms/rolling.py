r"""Constraints of wheels that are fixed to the platform or steered, as a table of the rows of A.

Each row is a velocity that is 0, along a wheel (no slip where it rolls) or across it (no lateral slip).
With complex numbers for vectors of the plane, the direction :math:`d` of the row turns with the platform
and with a steering angle, :math:`\gamma = s x_j`. At the point :math:`\rho` of the platform

.. math:: \langle d e^{\mathrm{i}(\theta + \gamma)}, \dot x_1 + \mathrm{i}\dot x_2
    + \mathrm{i}\dot\theta\rho e^{\mathrm{i}\theta}\rangle + \sum_m a_m\dot x_m = 0,

where :math:`\dot\theta` has the factor :math:`\Im(\bar\rho d e^{\mathrm{i}\gamma}) + a_2`. The last rows
are those of the last coordinates, the wheels: a row that has :math:`-R` for its wheel gives the wheel's
rate from those of the other coordinates.

The kernels' parameters begin with the table, k rows of 6 + l numbers (:func:`row`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from mobman.arrays import Matrix, Tensor, Vector
from mobman.compiled import kernel


def row(
    l: int,
    direction: complex = 0.0,
    at: complex = 0.0,
    steered: tuple[int, float] = (2, 0.0),
    others: Mapping[int, float] | None = None,
) -> list[float]:
    """A row of the table.

    Args:
        l: Number of coordinates.
        direction: d, ahead and to the left of the platform or of the wheel that is steered.
        at: rho, from the reference point in the platform's axes (m).
        steered: The place j of the steering joint in x, and s, +1 where a positive angle turns to the
            left, else -1; by default nothing is steered.
        others: Coefficients a_m of the coordinates' rates, by their places in x.
    """
    lever, entries = complex(at).conjugate() * direction, [0.0] * l
    for place, entry in (others or {}).items():
        entries[place] = entry
    d = complex(direction)
    return [*steered, d.real, d.imag, lever.real, lever.imag, *entries]


@kernel
def constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """A and its derivatives."""
    k, l = A.shape
    A_x[:, :, :] = 0.0
    for i in range(k):
        at = i * (6 + l)
        j, sign = int(parameters[at]), parameters[at + 1]
        ahead, left = parameters[at + 2], parameters[at + 3]
        gamma = sign * x[j]
        c, s = math.cos(x[2] + gamma), math.sin(x[2] + gamma)
        cg, sg = math.cos(gamma), math.sin(gamma)
        for m in range(l):
            A[i, m] = parameters[at + 6 + m]
        A[i, 0] += c * ahead - s * left
        A[i, 1] += s * ahead + c * left
        A[i, 2] += parameters[at + 4] * sg + parameters[at + 5] * cg
        A_x[i, 0, 2], A_x[i, 1, 2] = -s * ahead - c * left, c * ahead - s * left
        A_x[i, 0, j] += sign * A_x[i, 0, 2]
        A_x[i, 1, j] += sign * A_x[i, 1, 2]
        A_x[i, 2, j] += sign * (parameters[at + 4] * cg - parameters[at + 5] * sg)


@kernel
def constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A."""
    k, l, _ = A_x_rate.shape
    A_x_rate[:, :, :] = 0.0
    for i in range(k):
        at = i * (6 + l)
        j, sign = int(parameters[at]), parameters[at + 1]
        ahead, left = parameters[at + 2], parameters[at + 3]
        gamma, turning = sign * x[j], sign * x_dot[j]
        both = x_dot[2] + turning
        c, s = math.cos(x[2] + gamma) * both, math.sin(x[2] + gamma) * both
        cg, sg = math.cos(gamma) * turning, math.sin(gamma) * turning
        A_x_rate[i, 0, 2], A_x_rate[i, 1, 2] = -c * ahead + s * left, -s * ahead - c * left
        A_x_rate[i, 0, j] += sign * A_x_rate[i, 0, 2]
        A_x_rate[i, 1, j] += sign * A_x_rate[i, 1, 2]
        A_x_rate[i, 2, j] -= sign * (parameters[at + 4] * sg + parameters[at + 5] * cg)


@kernel
def wheel_rates(parameters: Vector, x: Vector, first: int, N: Matrix) -> None:
    """Fill the wheels' rows of N from its other ones; ``first`` is the number of their first in A."""
    l, p = N.shape
    for i in range(first, l - p):
        at = i * (6 + l)
        ahead, left = parameters[at + 2], parameters[at + 3]
        gamma = parameters[at + 1] * x[int(parameters[at])]
        c, s = math.cos(x[2] + gamma), math.sin(x[2] + gamma)
        lever = parameters[at + 4] * math.sin(gamma) + parameters[at + 5] * math.cos(gamma)
        for j in range(p):
            speed = (c * ahead - s * left) * N[0, j] + (s * ahead + c * left) * N[1, j]
            speed += lever * N[2, j]
            for m in range(2, p + first):
                speed += parameters[at + 6 + m] * N[m, j]
            N[p + i, j] = -speed / parameters[at + 6 + p + i]


@kernel
def wheel_rates_rate(
    parameters: Vector,
    x: Vector,
    x_dot: Vector,
    first: int,
    pose: tuple[float, float, float],
    N_rate: Matrix,
) -> None:
    """Fill the wheels' rows of dN/dt from its other ones, where only the first velocity moves the pose;
    ``pose`` are its entries of N."""
    l, p = N_rate.shape
    for i in range(first, l - p):
        at = i * (6 + l)
        ahead, left = parameters[at + 2], parameters[at + 3]
        gamma = parameters[at + 1] * x[int(parameters[at])]
        turning = parameters[at + 1] * x_dot[int(parameters[at])]
        both = x_dot[2] + turning
        c, s = math.cos(x[2] + gamma), math.sin(x[2] + gamma)
        cg, sg = math.cos(gamma), math.sin(gamma)
        along, across = c * ahead - s * left, s * ahead + c * left
        lever = parameters[at + 4] * sg + parameters[at + 5] * cg
        for j in range(p):
            change = along * N_rate[0, j] + across * N_rate[1, j] + lever * N_rate[2, j]
            if j == 0:
                change += both * (along * pose[1] - across * pose[0])
                change += turning * (parameters[at + 4] * cg - parameters[at + 5] * sg) * pose[2]
            for m in range(2, p + first):
                change += parameters[at + 6 + m] * N_rate[m, j]
            N_rate[p + i, j] = -change / parameters[at + 6 + p + i]
