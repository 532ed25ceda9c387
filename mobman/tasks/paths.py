"""Families of smooth paths, and their placement: near a robot's tip, along its heading, in its size."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from numbers import Real
from typing import Annotated, Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel, plain
from mobman.display import Displayed, Shown
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import parameter

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


class KernelPath(Displayed):
    """Base of paths that a kernel evaluates: dataclasses."""

    def _shown(self) -> Shown:
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        name = str(values.pop("name", ""))
        return Shown(f"{type(self).__name__}({name!r})", values)

    width = 3
    """Components of p_d: 3, 6 (with a unit axis) or 7 (with a quaternion), see
    :class:`mobman.tasks.task.Task`."""

    def _kernel(self) -> tuple[Any, ...]:
        """The kernel, and its arguments between t, shape (1,), and p_d, shape (4, width)."""
        raise NotImplementedError

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p_d and its first three derivatives at time t (s), see :class:`mobman.tasks.task.Task`.

        Raises:
            UsageError: If t is no finite number.
        """
        if not (isinstance(t, Real) and math.isfinite(t)):
            raise UsageError(f"t = {t!r}: expected a finite number (s)")
        p_d, (kernel, *arguments) = np.zeros((4, self.width)), self._kernel()
        plain(kernel)(np.array([t]), *arguments, p_d)
        rates = p_d[1:, : min(self.width, 6)]
        return (p_d[0], rates[0], rates[1], rates[2])

    def entry(self, t: Array, p_d: Array) -> Callable[[], None]:
        """See :func:`mobman.tasks.task.task_entry`."""
        kernel, *arguments = self._kernel()
        return bind(kernel, t, *arguments, p_d)


@dataclass(frozen=True)
class Harmonics(KernelPath):
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
        pairs = zip(self.cosines, self.sines, strict=True)
        moving = [k for k, pair in enumerate(pairs, start=1) if np.any(pair)]
        return 2.0 * math.pi / (abs(self.rate) * max(1, math.gcd(*moving)))

    def _kernel(self) -> tuple[Any, ...]:
        given = (self.centre, self.cosines, self.sines)
        centre, cosines, sines = (np.array(part, dtype=float) for part in given)
        return _harmonics, centre, float(self.rate), cosines, sines


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


@dataclass(frozen=True)
class PointToPoint(KernelPath):
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

    def _kernel(self) -> tuple[Any, ...]:
        points, times = np.array(self.points, dtype=float), np.array(self.times, dtype=float)
        return _point_to_point, points, times, int(self.repeats)


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
    share, rate, second, third = rest_to_rest((now - times[i]) / T, T)
    for j in range(3):
        way = points[i + 1, j] - points[i, j]
        p_d[0, j] = points[i, j] + share * way
        p_d[1, j] = rate * way
        p_d[2, j] = second * way
        p_d[3, j] = third * way


@kernel
def rest_to_rest(x: float, T: float) -> tuple[float, float, float, float]:
    """The share of a way of T seconds that is done at x, from 0 to 1, of it, and its derivatives by
    time."""
    share = x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    rate = 140.0 * (x * (1.0 - x)) ** 3 / T
    second = 420.0 * (x * (1.0 - x)) ** 2 * (1.0 - 2.0 * x) / T**2
    third = 840.0 * x * (1.0 - x) * (1.0 - 5.0 * x * (1.0 - x)) / T**3
    return (share, rate, second, third)


Travel = Annotated[float, parameter("s", "time for each way", gt=0)]
Pause = Annotated[float, parameter("s", "rest at both ends", ge=0)]
TRAVEL = 5.0
PAUSE = 0.0


def excursion(
    points: Sequence[Array], travel: float, pause: float, *, returns: bool = True
) -> tuple[tuple[Triple, ...], tuple[float, ...]]:
    """Points and times of a path through points, and back if it returns; at rest at each.

    All parts have the same largest acceleration.

    Args:
        points: World coordinates (m), two or more of shape (3,), no two in sequence alike.
        travel: Time for each way (s).
        pause: Rest at each end (s).
        returns: Whether it does.
    """
    # of one acceleration: times as the square roots of the lengths
    shares = [math.sqrt(float(np.linalg.norm(b - a))) for a, b in pairwise(points)]
    there = travel * np.cumsum([0.0, *shares]) / sum(shares)
    stops = list(zip(map(triple, points), there.tolist(), strict=True))
    if returns:
        end = travel + pause
        # no pause, no stop of its own
        back = [(point, end + travel - time) for point, time in reversed(stops)]
        stops += back if pause > 0.0 else back[1:]
        stops += [(stops[0][0], 2.0 * (travel + pause))] if pause > 0.0 else []
    where, times = zip(*stops, strict=True)
    return where, times


# Placement at a robot's start -------------------------------------------------------------------------

SIZE = 0.5
"""Half the length of a path for a platform that drives (m)."""
GAP = 0.1
"""From the tip to where such a path begins (m)."""
SHARE_OF_REACH = 0.15
"""Half the length of a path for an arm alone, over the tip's distance from its base."""
SHARE_OF_RADIUS = 0.2
"""From the tip to such a path, over half its length."""

_POINTS = 256  # of a path, to find how far it goes


class StartPlace(NamedTuple):
    """The tip and the arm at a task's start, which its path is placed by."""

    tip: Array
    """World coordinates (m), shape (3,)."""
    arm: Array
    """From the arm's first joint to the tip (m), shape (3,)."""
    heading: float
    """Of the platform (rad); on a fixed base, that of the arm."""
    drives: bool
    """Whether there is a platform that moves."""
    axes: Array
    """Unit vectors along the heading, to its left and up, shape (3, 3)."""
    reach: float
    """The tip's distance from the arm's first joint (m)."""
    size: float
    """Half the length of a path that suits the robot (m)."""
    rise: float
    """Half the height of a path that suits the arm (m)."""


def place_of(robot: MobileManipulator, q0: Array) -> StartPlace:
    """The placement at a robot's configuration q0."""
    tip = np.array(robot.tip_pose(q0).translation)
    arm, drives = tip - robot.arm_origin(q0), "base_x" in robot.joint_names
    heading = q0[robot.joint_names.index("base_theta")] if drives else math.atan2(arm[1], arm[0])
    reach = float(np.linalg.norm(arm))
    rise = SHARE_OF_REACH * reach
    size = SIZE if drives else rise
    return StartPlace(tip, arm, float(heading), drives, _axes(heading), reach, size, rise)


def _axes(angle: float) -> Array:
    """The axes of a frame turned about the vertical, as rows."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


Vectors = Sequence[Sequence[float]]


def placed(
    name: str, place: StartPlace, rate: float, cosines: Vectors, sines: Vectors
) -> Harmonics:
    """A closed path near the tip.

    A platform that drives has it begin ``GAP`` ahead of the tip and run along the heading first. An arm
    alone has it between the tip and the base, ``SHARE_OF_RADIUS`` of its half length away from the tip.

    Args:
        name: The task's.
        place: Where the tip is.
        rate: rad/s.
        cosines: As those of :class:`Harmonics`, by ``place.axes``.
        sines: As many.
    """
    local = np.array([cosines, sines], dtype=float)
    axes, ahead, harmonics = place.axes, place.axes[0], np.arange(1, 1 + len(cosines))
    if place.drives:
        start = local[0].sum(axis=0)
        first = rate * harmonics @ local[1]
        axes = _axes(-math.atan2(first[1], first[0])) @ axes
        centre = place.tip + GAP * ahead - start @ axes
    else:
        angles = np.outer(np.linspace(0.0, 2.0 * math.pi, _POINTS, endpoint=False), harmonics)
        points = np.cos(angles) @ local[0] + np.sin(angles) @ local[1]
        radius = float(np.linalg.norm(points, axis=1).max())
        centre = place.tip - (1.0 + SHARE_OF_RADIUS) * radius * ahead
    rows = [tuple(map(triple, part)) for part in local @ axes]
    return Harmonics(triple(centre), rate, rows[0], rows[1], name)


def triple(vector: Array) -> Triple:
    """Three numbers as they are kept in records."""
    x, y, z = (float(coordinate) for coordinate in vector)
    return (x, y, z)


def quadruple(rotation: Array) -> Quadruple:
    """The unit quaternion (w, x, y, z) of a rotation matrix, of the two that with w >= 0."""
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    sign = math.copysign(1.0, w)
    return (sign * float(w), sign * float(x), sign * float(y), sign * float(z))
