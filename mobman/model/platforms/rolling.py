r"""Constraints of wheels that are fixed to the platform or steered, as a table of the rows of A.

Each row is a velocity that is 0, along a wheel (no slip where it rolls) or across it (no lateral slip).
With complex numbers for vectors of the plane, the direction :math:`d` of the row turns with the platform
and with a steering angle, :math:`\gamma = s x_j`. At the point :math:`\rho` of the platform

.. math:: \langle d e^{\mathrm{i}(\theta + \gamma)}, \dot x_1 + \mathrm{i}\dot x_2
    + \mathrm{i}\dot\theta\rho e^{\mathrm{i}\theta}\rangle + \sum_m a_m\dot x_m = 0,

where :math:`\dot\theta` has the factor :math:`\Im(\bar\rho d e^{\mathrm{i}\gamma}) + a_2`. The last rows
are those of the last coordinates, the wheels: a row that has :math:`-R` for its wheel gives the wheel's
rate from those of the other coordinates.

The kernels' parameters begin with the table, k rows of 6 + l numbers: j, s, the parts of :math:`d` and
of :math:`\bar\rho d`, and the :math:`a_m`.
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
    d, lever = complex(direction), complex(at).conjugate() * direction
    entries = [(others or {}).get(m, 0.0) for m in range(l)]
    return [*steered, d.real, d.imag, lever.real, lever.imag, *entries]


@kernel
def _row(
    parameters: Vector, at: int, x: Vector, c: float, s: float, scale: float
) -> tuple[float, float, float, float]:
    """A row's direction times a scale, and its lever and the derivative of that by gamma; ``c`` and
    ``s`` are cosine and sine of theta, which are most rows'."""
    gamma, cg, sg = parameters[at + 1] * x[int(parameters[at])], 1.0, 0.0
    if gamma != 0.0:
        c, s = math.cos(x[2] + gamma), math.sin(x[2] + gamma)
        cg, sg = math.cos(gamma), math.sin(gamma)
    c, s, ahead, left = scale * c, scale * s, parameters[at + 2], parameters[at + 3]
    real, imaginary = parameters[at + 4], parameters[at + 5]
    lever, slope = real * sg + imaginary * cg, real * cg - imaginary * sg
    return c * ahead - s * left, s * ahead + c * left, lever, slope


@kernel
def constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """A and its derivatives."""
    k, l = A.shape
    c, s = math.cos(x[2]), math.sin(x[2])
    A_x[:, :, :] = 0.0
    for i in range(k):
        at = i * (6 + l)
        j, sign = int(parameters[at]), parameters[at + 1]
        along, across, lever, slope = _row(parameters, at, x, c, s, 1.0)
        for m in range(l):
            A[i, m] = parameters[at + 6 + m]
        A[i, 0] += along
        A[i, 1] += across
        A[i, 2] += lever
        A_x[i, 0, 2], A_x[i, 1, 2] = -across, along
        A_x[i, 0, j] -= sign * across
        A_x[i, 1, j] += sign * along
        A_x[i, 2, j] += sign * slope


@kernel
def constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A."""
    k, l, _ = A_x_rate.shape
    c, s = math.cos(x[2]), math.sin(x[2])
    A_x_rate[:, :, :] = 0.0
    for i in range(k):
        at = i * (6 + l)
        j, sign = int(parameters[at]), parameters[at + 1]
        turning = sign * x_dot[j]
        along, across, lever, _ = _row(parameters, at, x, c, s, x_dot[2] + turning)
        A_x_rate[i, 0, 2], A_x_rate[i, 1, 2] = -along, -across
        A_x_rate[i, 0, j] -= sign * along
        A_x_rate[i, 1, j] -= sign * across
        A_x_rate[i, 2, j] -= sign * turning * lever


@kernel
def wheel_rates(parameters: Vector, x: Vector, first: int, N: Matrix) -> None:
    """Fill the wheels' rows of N from its other ones; ``first`` is the number of their first in A."""
    l, p = N.shape
    c, s = math.cos(x[2]), math.sin(x[2])
    for i in range(first, l - p):
        at = i * (6 + l)
        along, across, lever, _ = _row(parameters, at, x, c, s, 1.0)
        for j in range(p):
            N[p + i, j] = along * N[0, j] + across * N[1, j] + lever * N[2, j]
        _roll(parameters[at + 6 : at + 6 + l], first, i, N)


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
    c, s = math.cos(x[2]), math.sin(x[2])
    for i in range(first, l - p):
        at = i * (6 + l)
        turning = parameters[at + 1] * x_dot[int(parameters[at])]
        along, across, lever, slope = _row(parameters, at, x, c, s, 1.0)
        for j in range(p):
            N_rate[p + i, j] = along * N_rate[0, j] + across * N_rate[1, j] + lever * N_rate[2, j]
        change = (x_dot[2] + turning) * (along * pose[1] - across * pose[0])
        N_rate[p + i, 0] += change + turning * slope * pose[2]
        _roll(parameters[at + 6 : at + 6 + l], first, i, N_rate)


@kernel
def _roll(others: Vector, first: int, i: int, N: Matrix) -> None:
    """Add the other coordinates' part to a wheel's row, and divide by what turns the wheel."""
    p = N.shape[1]
    for m in range(2, p + first):
        if others[m] != 0.0:
            for j in range(p):
                N[p + i, j] += others[m] * N[m, j]
    for j in range(p):
        N[p + i, j] /= -others[p + i]
