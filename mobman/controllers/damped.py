r"""Damped kinematic stage of the sliding laws: passes places where J loses its rank.

Near such a place the equivalent control :math:`-J^T (J J^T)^{-1} b/dt` has no bound. With a diagonal R
in :math:`(J J^T + R)^{-1}` it has, and the rows that R damps are followed as far as they can be:

- the rows of f_a are damped where J is close to losing its rank, so that the tip's rows keep what they
  need: an algorithmic singularity is passed with the tip on its task;
- the tip's rows are damped as well where J_e of (43) is close to losing its own.

What R keeps s from, R n, leaves the integral in s: nothing winds up. In the directions that are damped
v_ref has nothing to hold it, so there it decays: :math:`y = -\kappa (v_{ref} + k_v z)`. Where R = 0 and
J has its rank, all of this is the undamped law, to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mobman.arrays import Matrix, Vector
from mobman.compiled import kernel
from mobman.linalg import apply, cholesky, cholesky_solve, copy, norm

_KAPPA, _K_V = 50.0, 4.0  # 1/s: decay of v_ref and of z in what is damped
_ITERATIONS = 3  # of the inverse iteration, which goes on from tick to tick
_SHIFT = 1e-9  # of the threshold, so that there is a factor


class Damping(NamedTuple):
    """Thresholds, the state of the inverse iterations, and work space."""

    threshold: Vector
    """Eigenvalues of J J^T and of J_e J_e^T below which there is damping, shape (2,)."""
    least: Vector
    """Those eigenvalues, shape (2,)."""
    directions: Matrix
    """Their eigenvectors, shape (2, p)."""
    R: Vector
    """Shape (p,)."""
    y: Vector
    seen: Vector
    lower: Matrix

    @classmethod
    def of(cls, damping: float, bounds: tuple[float, float], p: int, nz: int) -> Damping:
        """Damping below ``damping`` times the bound of J J^T, and below that of J_e J_e^T."""
        return cls(
            np.array([damping * bounds[0], bounds[1]]),
            *(np.ones(2), np.ones((2, p)), np.zeros(p), np.zeros(nz), np.zeros(p)),
            np.zeros((p, p)),
        )


@kernel
def damp(
    dt: float, JJ: Matrix, drift: Vector, own: Damping, v_ref: Vector, J: Matrix, z: Vector, m: int
) -> None:
    """Fill R and y; add R to J J^T, and J y to the drift of s."""
    p, nz, size = J.shape[0], J.shape[1], 1.0
    for part in range(2):
        rows = p if part == 0 else m
        threshold, direction = own.threshold[part], own.directions[part, :rows]
        lower = own.lower[:rows, :rows]
        copy(JJ[:rows, :rows], lower)
        for i in range(rows):
            lower[i, i] += _SHIFT * threshold
        if cholesky(lower, lower) != 0:
            own.least[part] = 0.0
            continue
        for _ in range(_ITERATIONS):
            cholesky_solve(lower, direction, own.seen[:rows])
            size = norm(own.seen[:rows])
            for i in range(rows):
                direction[i] = own.seen[i] / size
        own.least[part] = 1.0 / size
    for i in range(p):
        part = 1 if i < m else 0
        own.R[i] = max(0.0, own.threshold[part] - own.least[part])
    rate = _KAPPA / (1.0 + _KAPPA * dt)
    for j in range(nz):
        own.y[j] = -rate * (v_ref[j] + _K_V * z[j])
    apply(J, own.y, own.seen)
    for i in range(p):
        drift[i] += own.seen[i]
        JJ[i, i] += own.R[i]
