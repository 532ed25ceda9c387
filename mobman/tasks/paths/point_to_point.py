"""From point to point along straight lines, at rest at each of them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.errors import UsageError
from mobman.kernels.kernel import kernel, plain
from mobman.kernels.program import Call, call

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class PointToPoint:
    r"""At ``points[i]`` at ``times[i]``, in between by the polynomial
    :math:`35\tau^4 - 84\tau^5 + 70\tau^6 - 20\tau^7`, whose first three derivatives are 0 at both ends.

    The path holds its first point before and its last point after; or it begins again.

    Args:
        points: World coordinates (m).
        times: s, rising.
        repeats: Whether the path, which must end where it begins, is run again and again.
        name: For records.

    Raises:
        UsageError: If the points and times make no path.
    """

    points: tuple[Triple, ...]
    times: tuple[float, ...]
    repeats: bool = False
    name: str = "point-to-point"

    def __post_init__(self) -> None:
        if len(self.points) < 2 or len(self.points) != len(self.times):
            raise UsageError(
                f"a path from point to point needs two points or more and a time for each, not "
                f"{len(self.points)} points and {len(self.times)} times"
            )
        if not all(earlier < later for earlier, later in pairwise(self.times)):
            raise UsageError(f"times {self.times}: each must be later than the one before")
        if self.repeats and tuple(self.points[0]) != tuple(self.points[-1]):
            raise UsageError(
                f"a path that repeats ends where it begins, not at {self.points[-1]} after "
                f"{self.points[0]}"
            )

    @property
    def period(self) -> float | None:
        """Duration of a lap (s); None if there is one way only."""
        return self.times[-1] - self.times[0] if self.repeats else None

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p_d and its first three derivatives at time t (s), each of shape (3,)."""
        p_d = np.empty((4, 3))
        plain(_point_to_point)(np.array([t]), *self._arrays(), p_d)
        return (p_d[0], p_d[1], p_d[2], p_d[3])

    def steps(self, t: Array, p_d: Array) -> list[Call]:
        """See :func:`mobman.tasks.task.task_steps`."""
        return [call(_point_to_point, t, *self._arrays(), p_d)]

    def _arrays(self) -> tuple[Array, Array, int]:
        points, times = np.array(self.points, dtype=float), np.array(self.times, dtype=float)
        return points, times, int(self.repeats)


@kernel
def _point_to_point(t: Vector, points: Matrix, times: Vector, repeats: int, p_d: Matrix) -> None:
    last = times.shape[0] - 1
    now = t[0]
    if repeats != 0 and now > times[0]:
        now = times[0] + (now - times[0]) % (times[last] - times[0])
    now = min(max(now, times[0]), times[last])
    i = 0
    while i < last - 1 and now >= times[i + 1]:
        i += 1
    T = times[i + 1] - times[i]
    x = (now - times[i]) / T
    share = x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    rate = 140.0 * (x * (1.0 - x)) ** 3 / T
    second = 420.0 * (x * (1.0 - x)) ** 2 * (1.0 - 2.0 * x) / T**2
    third = 840.0 * x * (1.0 - x) * (1.0 - 5.0 * x * (1.0 - x)) / T**3
    for j in range(3):
        way = points[i + 1, j] - points[i, j]
        p_d[0, j] = points[i, j] + share * way
        p_d[1, j] = rate * way
        p_d[2, j] = second * way
        p_d[3, j] = third * way
