"""Paths through the points of a file, with or without times, by splines; from rest to rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import BeforeValidator
from scipy.interpolate import make_interp_spline

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.display import Shown
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.paths import TRAVEL, KernelPath, place_of, quadruple, rest_to_rest
from mobman.tasks.point_files import MOST_POINTS, ORIENTATION, POSITION, points_of
from mobman.tasks.task import parameter, tasks

MOST_SPEED, MOST_TURNING = 10.0, 20.0
"""Bounds for robots without velocity limits, beyond those of any mobile manipulator (m/s, rad/s)."""
LARGEST_TURN = math.radians(170.0)
"""From one orientation to the next (rad): at 180 degrees there are two ways."""

_CRUISE = (0.5, 1.0)  # highest speeds by default where a file has no times (m/s, rad/s)
_PEAK = 35.0 / 16.0  # of the rate of the share of a way, times its duration
_TIGHT = 1e-9  # error that a spline may have at its points, relative to their size
_SHORTEST = 0.5  # least length of an interpolated quaternion
_SAMPLES = 8  # from one point to the next, to find the highest speed
_STOP = 4.0  # s, from one point of the example to the next

File = Annotated[
    Any,
    BeforeValidator(points_of),
    parameter(
        "1",
        "path of the file of points, CSV or HDF5, or its columns by name; an example near the tip",
    ),
]
Frame = Annotated[
    Literal["world", "start"],
    parameter(
        "1", "axes of the file: the world's, or ahead, left and up from the tip at its start"
    ),
]


@dataclass(frozen=True, repr=False)
class Spline(KernelPath):
    r"""Through points, at rest at both ends: a spline of degree 7 in time, or one of degree 5 in the
    length of the way, of which the share :math:`35\tau^4 - 84\tau^5 + 70\tau^6 - 20\tau^7` is done.

    The spline in time has its first three derivatives 0 at both ends and is C^6 in between. The other
    one is natural (its third and fourth derivatives are 0 at its ends) and C^4.

    Args:
        points: World coordinates (m).
        knots: Of each point its time (s), or how long the way is to it (m); rising.
        travel: Time for the way (s); 0 if ``knots`` are times.
        name: For records.

    Raises:
        UsageError: If the points and knots make no path.
    """

    points: tuple[tuple[float, ...], ...]
    knots: tuple[float, ...]
    travel: float = 0.0
    name: str = "waypoints"

    def __post_init__(self) -> None:
        count = len(self.points)
        if not 2 <= count <= MOST_POINTS or len(self.knots) != count:
            raise UsageError(
                f"a path needs 2 to {MOST_POINTS} points and a knot for each, not {count} points and "
                f"{len(self.knots)} knots"
            )
        if any(len(point) != self.width for point in self.points):
            raise UsageError(f"a point of {type(self).__name__} has {self.width} numbers")
        numbers = [*self.knots, self.travel, *(x for point in self.points for x in point)]
        rising = all(earlier < later for earlier, later in pairwise(self.knots))
        if not (np.isfinite(numbers).all() and rising and self.travel >= 0.0):
            raise UsageError(
                "knots of a path must rise, and its numbers be finite, travel not negative"
            )
        self._check_spline()

    def _shown(self) -> Shown:
        line, facts = super()._shown()
        return Shown(line, {**facts, "points": len(self.points), "knots": len(self.knots)})

    @property
    def span(self) -> tuple[float, float]:
        """Times at which the path begins and ends (s)."""
        return (0.0, self.travel) if self.travel > 0.0 else (self.knots[0], self.knots[-1])

    @cached_property
    def _pieces(self) -> tuple[Array, Array]:
        """Knots from 0 to n - 1, shape (n,), and coefficients of the polynomials from each to the next,
        highest power first, shape (n - 1, degree + 1, width)."""
        knots, points = np.array(self.knots, dtype=float), np.array(self.points, dtype=float)
        knots = (knots - knots[0]) / (knots[-1] - knots[0]) * (len(knots) - 1)  # of order 1
        degree = 7 if self.travel == 0.0 else 5 if len(knots) > 2 else 1
        orders: dict[int, tuple[int, ...]] = {7: (1, 2, 3), 5: (3, 4), 1: ()}  # 0 at the ends
        edge = [(order, np.zeros(points.shape[1])) for order in orders[degree]]
        ends: Any = (edge, edge) if edge else None
        spline = make_interp_spline(knots, points, k=degree, bc_type=ends)
        rates = [spline(knots[:-1], nu) / math.factorial(nu) for nu in range(degree, -1, -1)]
        return knots, np.stack(rates, axis=1)

    def _between(self, share: float) -> Array:
        """Points at a share of the way from each knot to the next, shape (n - 1, width)."""
        knots, pieces = self._pieces
        powers = np.arange(pieces.shape[1])[::-1]
        steps = (share * np.diff(knots)[:, None]) ** powers
        return np.asarray(np.einsum("npj,np->nj", pieces, steps))

    def _check_spline(self) -> None:
        points, gaps = np.array(self.points), np.diff(self.knots)
        try:
            with np.errstate(all="ignore"):
                found = np.concatenate([self._pieces[1][:, -1], self._between(1.0)])
                error = np.abs(found - np.concatenate([points[:-1], points[1:]])).max()
            if error <= _TIGHT * (1.0 + np.abs(points).max()):
                return
            fault = f", by {error:.3g}"
        except (ValueError, np.linalg.LinAlgError) as problem:
            fault = f": {problem}"
        raise UsageError(
            f"task {self.name!r}: the spline does not pass its points{fault}; the distances from one to "
            f"the next are {gaps.min():.3g} to {gaps.max():.3g} {'m' if self.travel else 's'}; needed: "
            "more even ones"
        )

    def _kernel(self) -> tuple[Any, ...]:
        span, along = np.array(self.span, dtype=float), int(self.travel > 0.0)
        return _spline, span, along, *self._pieces, np.zeros((4, self.width))


@dataclass(frozen=True, repr=False)
class PoseSpline(Spline):
    """The same with orientations: the last four of a point's seven numbers are a unit quaternion, (w, x,
    y, z). The spline of the quaternions is scaled to length 1."""

    width = 7

    def __post_init__(self) -> None:
        super().__post_init__()
        for i, (before, after) in enumerate(pairwise(np.array(self.points)[:, 3:])):
            lengths = np.array([before @ before, after @ after])
            if np.abs(lengths - 1.0).max() > 1e-9:
                raise UsageError(f"orientations of points {i} and {i + 1} must have length 1")
            turn = 2.0 * math.acos(max(-1.0, min(1.0, float(before @ after))))
            if turn > LARGEST_TURN:
                raise UsageError(
                    f"task {self.name!r}: from point {i} to point {i + 1} the orientation turns by "
                    f"{math.degrees(turn):.4g} degrees; allowed: {math.degrees(LARGEST_TURN):g} degrees "
                    "(put a point in between)"
                )
        for share in np.arange(_SAMPLES) / _SAMPLES:
            short = np.linalg.norm(self._between(share)[:, 3:], axis=1)
            if short.min() < _SHORTEST:
                i = int(short.argmin())
                raise UsageError(
                    f"task {self.name!r}: the spline of the orientations is not defined between points "
                    f"{i} and {i + 1} (length {short[i]:.3g} of the quaternion; needed: {_SHORTEST:g}): "
                    "put points in between"
                )


@kernel
def _spline(
    t: Vector, times: Vector, along: int, knots: Vector, pieces: Tensor, work: Matrix, p_d: Matrix
) -> None:
    start, span = times[0], times[1] - times[0]
    last = knots.shape[0] - 1
    x = min(max((t[0] - start) / span, 0.0), 1.0)
    u, u_1, u_2, u_3 = x, 1.0 / span, 0.0, 0.0
    if along != 0:
        u, u_1, u_2, u_3 = rest_to_rest(x, span)
    if t[0] <= start or t[0] >= start + span:
        u_1 = u_2 = u_3 = 0.0
    scale = knots[last]
    u, u_1, u_2, u_3 = scale * u, scale * u_1, scale * u_2, scale * u_3
    i, above = 0, last  # knots[i] <= u < knots[above]
    while above - i > 1:
        middle = (i + above) // 2
        if u < knots[middle]:
            above = middle
        else:
            i = middle
    h, width = u - knots[i], p_d.shape[1]
    for j in range(width):
        value = first = second = third = 0.0
        for power in range(pieces.shape[1]):  # Horner's scheme: the derivatives over 1, 1, 2, 6
            third = third * h + second
            second = second * h + first
            first = first * h + value
            value = value * h + pieces[i, power, j]
        second, third = 2.0 * second, 6.0 * third
        work[0, j] = value
        work[1, j] = first * u_1
        work[2, j] = second * u_1**2 + first * u_2
        work[3, j] = third * u_1**3 + 3.0 * second * u_1 * u_2 + first * u_3
    for order in range(4):
        for j in range(3):
            p_d[order, j] = work[order, j]
    if width == 7:
        _orientation(work, p_d)


@kernel
def _orientation(work: Matrix, p_d: Matrix) -> None:
    """Write the quaternion s/|s|, Omega_d and its derivatives, with s and its own in ``work``.

    Omega_d = 2 vec(s' s*)/rho, rho = <s, s>: what the scaling adds to s' s* has no vector part.
    """
    rho = rho_1 = rho_2 = 0.0
    for j in range(3, 7):
        rho += work[0, j] ** 2
        rho_1 += 2.0 * work[0, j] * work[1, j]
        rho_2 += 2.0 * (work[1, j] ** 2 + work[0, j] * work[2, j])
    length = math.sqrt(rho)
    for j in range(3, 7):
        p_d[0, j] = work[0, j] / length
    for k in range(3):  # vec(a b*)_k = b_w a_k - a_w b_k - (a x b)_k
        a, b, c = 4 + k, 4 + (k + 1) % 3, 4 + (k + 2) % 3
        v = work[1, a] * work[0, 3] - work[1, 3] * work[0, a]
        v -= work[1, b] * work[0, c] - work[1, c] * work[0, b]
        v_1 = work[2, a] * work[0, 3] - work[2, 3] * work[0, a]
        v_1 -= work[2, b] * work[0, c] - work[2, c] * work[0, b]
        v_2 = work[3, a] * work[0, 3] - work[3, 3] * work[0, a]
        v_2 -= work[3, b] * work[0, c] - work[3, c] * work[0, b]
        v_2 += work[2, a] * work[1, 3] - work[2, 3] * work[1, a]
        v_2 -= work[2, b] * work[1, c] - work[2, c] * work[1, b]
        omega = 2.0 * v / rho
        omega_1 = (2.0 * v_1 - omega * rho_1) / rho
        p_d[1, 3 + k] = omega
        p_d[2, 3 + k] = omega_1
        p_d[3, 3 + k] = (2.0 * v_2 - 2.0 * omega_1 * rho_1 - omega * rho_2) / rho
    p_d[1, 6] = p_d[2, 6] = p_d[3, 6] = 0.0


# Tasks -----------------------------------------------------------------------------------------------


@tasks.register("waypoints")
def waypoints(
    robot: MobileManipulator, q0: Array, *, file: File = None, frame: Frame = "world"
) -> Spline:
    """Through the points of a file at their times, from rest to rest, by a spline of degree 7.

    Raises:
        UsageError: If the file has no times, or the path is too fast for the robot.
    """
    points, times = _placed(robot, q0, file, frame)
    if file is None:
        times = [_STOP * i for i in range(len(points))]
    if not times:
        raise UsageError(
            "task 'waypoints': parameter 'file': its points have no column t; needed: t (s) (the task "
            "'path' takes points without times)"
        )
    return _feasible(robot, _made(points, times, 0.0, "waypoints"))


@tasks.register("path")
def path(
    robot: MobileManipulator,
    q0: Array,
    *,
    file: File = None,
    frame: Frame = "world",
    travel: Annotated[
        float | None,
        parameter("s", "time for the way; 5 s, or more: 0.5 m/s and 1 rad/s at most", gt=0),
    ] = None,
) -> Spline:
    """Along the curve through the points of a file, whose times do not count, from rest to rest.

    Raises:
        UsageError: If two points in sequence are alike, or the path is too fast for the robot.
    """
    points, _ = _placed(robot, q0, file, frame)
    steps = np.diff(points, axis=0)
    ways = np.linalg.norm(steps[:, :3], axis=1)
    turns = 4.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(steps[:, 3:], axis=1), 1.0))
    length, angle = float(ways.sum()), float(turns.sum())
    # a turn counts as a way, so that the whole of it is as long as the whole of the way
    radius = length / angle if length > 0.0 and angle > 0.0 else 1.0
    lengths = np.hypot(ways, radius * turns)
    if not (alike := lengths > 0.0).all():
        i = int(alike.argmin())
        raise UsageError(
            f"task 'path': parameter 'file': points {i} and {i + 1} are alike; needed: points "
            "in sequence that differ"
        )
    if travel is None:
        travel = max(TRAVEL, _PEAK * length / _CRUISE[0], _PEAK * angle / _CRUISE[1])
    knots = np.concatenate([[0.0], np.cumsum(lengths)]).tolist()
    return _feasible(robot, _made(points, knots, travel, "path"))


def _made(points: Array, knots: list[float], travel: float, name: str) -> Spline:
    kind = PoseSpline if points.shape[1] == 7 else Spline
    return kind(tuple(map(tuple, points.tolist())), tuple(knots), travel, name)


def _placed(
    robot: MobileManipulator, q0: Array, table: Any, frame: str
) -> tuple[Array, list[float]]:
    """Points in world axes, shape (n, 3) or (n, 7), and their times if there are any."""
    place = place_of(robot, q0)
    if table is None:  # around a triangle, ahead or towards the base
        ahead, left, up = place.size if place.drives else -place.size, place.size, place.rise
        corners = [[0.0, 0.0, 0.0], [ahead, 0.5 * left, 0.0], [ahead, -0.5 * left, up]]
        return place.tip + np.array([*corners, corners[0]]) @ place.axes, []
    points = np.array([table[name] for name in POSITION]).T
    turns = np.array([table[name] for name in ORIENTATION if name in table]).T
    if frame == "start":
        first, axes = robot.tip_pose(q0).rotation, place.axes.T
        points = place.tip + points @ axes.T
        for i, (w, x, y, z) in enumerate(turns.tolist()):
            turn = pin.Quaternion(w, x, y, z).toRotationMatrix()
            turns[i] = quadruple(axes @ turn @ axes.T @ first)
            if i > 0 and turns[i] @ turns[i - 1] < 0.0:
                turns[i] *= -1.0
    return np.hstack([points, turns]) if turns.size else points, list(table.get("t", []))


def _feasible(robot: MobileManipulator, path: Spline) -> Spline:
    """The path, if the robot could follow it by its velocity limits.

    Raises:
        UsageError: If it is too fast.
    """
    knots = np.array(path.knots)
    if path.travel > 0.0:
        knots = np.linspace(*path.span, max(64, len(knots)))
    shares = np.arange(1, _SAMPLES + 1) / _SAMPLES
    times = (knots[:-1, None] + np.diff(knots)[:, None] * shares).ravel()
    rates = np.array([path.desired(t)[1] for t in times.tolist()])
    rates = np.nan_to_num(rates, nan=np.inf)
    fastest = _fastest(robot)
    for what, unit, columns, limit, sense in (
        ("move", "m/s", rates[:, :3], fastest[0], MOST_SPEED),
        ("turn", "rad/s", rates[:, 3:], fastest[1], MOST_TURNING),
    ):
        speeds = np.linalg.norm(columns, axis=1)
        most = min(limit, sense)
        if speeds.max() > most:
            reason = "by its velocity limits" if limit < sense else "the most for any robot"
            raise UsageError(
                f"task {path.name!r}: the tip would {what} at {speeds.max():.4g} {unit} at t = "
                f"{times[speeds.argmax()]:.4g} s; allowed for robot {robot.name!r}: {most:.4g} {unit} "
                f"({reason})"
            )
    return path


def _fastest(robot: MobileManipulator) -> tuple[float, float]:
    """Upper bounds of the tip's speed (m/s) and angular speed (rad/s) in any posture, by the velocity
    limits: each joint at its limit, the arm stretched."""
    model, limits = robot.model, robot.limits
    with np.errstate(invalid="ignore"):
        shares = np.abs(robot.velocity_map(robot.q_rest)) * limits.velocity
    rates = np.minimum(np.nansum(shares, axis=1), limits.joint_velocity)
    frame = model.frames[robot.tip_frame]
    lever, speed, turning = float(np.linalg.norm(frame.placement.translation)), 0.0, 0.0
    for joint in reversed(list(model.supports[frame.parentJoint])[1:]):
        i = model.joints[joint].idx_v
        if robot.slides[i]:
            speed += rates[i]
            lever += float(np.abs([limits.lower[i], limits.upper[i]]).max())
        elif rates[i] > 0.0:
            speed += rates[i] * lever if lever > 0.0 else 0.0
            turning += rates[i]
        lever += float(np.linalg.norm(model.jointPlacements[joint].translation))
    return speed, turning
