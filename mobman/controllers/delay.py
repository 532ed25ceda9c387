r"""Torques that act late: the metric that bears a delay which is not told, and the prediction of z'
where it is.

Inside the unit ball the dynamic stage gives :math:`\dot v = -\mu B^{-1} M b/dt`, so that on a plant of
inertia M_t whose torques act d ticks late :math:`S_{k+1} = S_k - \mu M_t^{-1} M S_{k-d}`. Each
eigenvalue gamma of :math:`\mu M_t^{-1} M` has the characteristic polynomial
:math:`x^{d+1} - x^d + \gamma`, stable for :math:`0 < \gamma < 2\sin(\pi/(4d + 2))`: 2, 1, 0.618, ...
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mobman.arrays import Matrix, Vector
from mobman.compiled import kernel
from mobman.linalg import apply, cholesky, cholesky_solve

_SHARE = 0.8  # of the border of stability: what the fractional powers and the outer loop leave
_BORNE = 1  # ticks that are borne where the delay is not told


def largest_eigenvalue(delay: int) -> float:
    """Border of stability of gamma with torques that act so many ticks late."""
    return 2.0 * math.sin(math.pi / (4.0 * delay + 2.0))


def automatic_metric_scale(delay_ticks: int | None, lightest: float) -> float:
    """``metric_scale = "auto"``: as large as the delay allows, and 1 at most.

    The larger the metric, the smaller the error on plants heavier than supposed, whose gamma is small.
    What bounds it is the lightest plant: no eigenvalue of M_t^-1 M exceeds 1/lightest, on any robot.

    Args:
        delay_ticks: The delay as told, which is predicted; None if it is not, and one tick is borne.
        lightest: Least inertia of the plant over the nominal one.
    """
    borne = _BORNE if delay_ticks is None else 0
    return min(1.0, _SHARE * largest_eigenvalue(borne) * lightest)


class UnderWay(NamedTuple):
    """Torques of the last ticks, and work space."""

    v: Matrix
    """v_{k-1}, v_{k-2}, ..., v_{k-1-d}, shape (d + 1, nz)."""
    change: Vector
    force: Vector
    lower: Matrix

    @classmethod
    def of(cls, delay: int, nz: int) -> UnderWay:
        """None yet."""
        return cls(np.zeros((delay + 1, nz)), np.zeros(nz), np.zeros(nz), np.zeros((nz, nz)))


@kernel
def predict_acceleration(
    under_way: UnderWay, v: Vector, M: Matrix, B: Matrix, z_dot: Vector, not_definite: int
) -> int:
    """z' + M^-1 B (v_{k-1} - v_{k-1-d}) in the place of z': once all torques under way have arrived.

    Args:
        under_way: The torques before; v joins them.
        v: v_{k-1}, shape (nz,).
        M: Nominal inertia, shape (nz, nz).
        B: Shape (nz, nz).
        z_dot: The measured z', shape (nz,).
        not_definite: What to return where M has no Cholesky factor.
    """
    torques, change, lower = under_way.v, under_way.change, under_way.lower
    last = torques.shape[0] - 1
    for i in range(v.shape[0]):
        for late in range(last, 0, -1):
            torques[late, i] = torques[late - 1, i]
        torques[0, i] = v[i]
        change[i] = v[i] - torques[last, i]
    apply(B, change, under_way.force)
    if cholesky(M, lower) != 0:
        return not_definite
    cholesky_solve(lower, under_way.force, change)
    for i in range(v.shape[0]):
        z_dot[i] += change[i]
    return 0
