"""Closed paths as sums of sines and cosines: smooth to all orders."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.kernels.kernel import kernel, plain
from mobman.kernels.program import Call, call

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Harmonics:
    r"""p_d = centre + sum over k = 1, 2, ... of cosines[k-1] cos(k rate t) + sines[k-1] sin(k rate t).

    Args:
        centre: World coordinates (m).
        rate: rad/s; not 0.
        cosines: A vector (m) for each k.
        sines: As many.
        name: For records.
    """

    centre: Triple
    rate: float
    cosines: tuple[Triple, ...]
    sines: tuple[Triple, ...]
    name: str = "harmonics"

    @property
    def period(self) -> float:
        """Duration of a lap (s)."""
        moving = [
            k
            for k, pair in enumerate(zip(self.cosines, self.sines, strict=True), start=1)
            if np.any(pair)
        ]
        return 2.0 * math.pi / (abs(self.rate) * max(1, math.gcd(*moving)))

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p_d and its first three derivatives at time t (s), each of shape (3,)."""
        p_d = np.empty((4, 3))
        plain(_harmonics)(np.array([t]), *self._arrays(), p_d)
        return (p_d[0], p_d[1], p_d[2], p_d[3])

    def steps(self, t: Array, p_d: Array) -> list[Call]:
        """See :func:`mobman.tasks.task.task_steps`."""
        return [call(_harmonics, t, *self._arrays(), p_d)]

    def _arrays(self) -> tuple[Array, float, Array, Array]:
        centre, cosines, sines = map(np.array, (self.centre, self.cosines, self.sines))
        return centre.astype(float), float(self.rate), cosines.astype(float), sines.astype(float)


@kernel
def _harmonics(
    t: Vector, centre: Vector, rate: float, cosines: Matrix, sines: Matrix, p_d: Matrix
) -> None:
    for i in range(3):
        p_d[0, i] = centre[i]
        p_d[1, i] = p_d[2, i] = p_d[3, i] = 0.0
    for k in range(cosines.shape[0]):
        w = (k + 1) * rate
        c, s = math.cos(w * t[0]), math.sin(w * t[0])
        for i in range(3):
            value = cosines[k, i] * c + sines[k, i] * s
            rise = w * (sines[k, i] * c - cosines[k, i] * s)
            p_d[0, i] += value
            p_d[1, i] += rise
            p_d[2, i] -= w**2 * value
            p_d[3, i] -= w**2 * rise
