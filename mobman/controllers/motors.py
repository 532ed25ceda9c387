r"""Motors as laws take account of them: limits of their torques, kept so that no integral winds up, caps
on how fast a law approaches its target, and torques that act late.

Of a delay that is not told: inside the unit ball the dynamic stage gives
:math:`\dot v = -\mu B^{-1} M b/dt`, so that on a plant of inertia M_t whose torques act d ticks late
:math:`S_{k+1} = S_k - \mu M_t^{-1} M S_{k-d}`. Each eigenvalue gamma of :math:`\mu M_t^{-1} M` has the
characteristic polynomial :math:`x^{d+1} - x^d + \gamma`, stable for
:math:`0 < \gamma < 2\sin(\pi/(4d + 2))`: 2, 1, 0.618, ... Where the delay is told, z' is predicted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from mobman.arrays import LARGEST, SMALLEST, Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.controllers.gains import Diagonal, diagonal
from mobman.controllers.task_errors import Stop
from mobman.errors import GainError
from mobman.linalg import apply, cholesky, cholesky_solve, dot, solve
from mobman.model.mobile_manipulator import MobileManipulator


def _torque_limits(name: str, given: Any) -> None:
    """Raises GainError unless limits are numbers above 0; None in the place of one is allowed."""
    for number in np.atleast_1d(np.asarray(given, dtype=object)):  # of a table, rows
        plain = isinstance(number, float | int | np.number) and not isinstance(number, bool)
        if number is not None and not (plain and SMALLEST <= number <= LARGEST):
            raise GainError(
                f"{name} = {given!r}: must be numbers from {SMALLEST:g} to {LARGEST:g}, one for "
                "all motors or one for each; null for a motor without a limit"
            )


def _caps(name: str, value: Any) -> None:
    """Raises GainError unless a cap is one number, or two."""
    if np.ndim(value) and np.shape(value) != (2,):
        raise GainError(
            f"{name} = {value!r}: must be one number, or two: of positions and of orientations"
        )


TorqueLimits = Annotated[float | Sequence[float | None], _torque_limits] | None
"""Largest |v| of each motor (N m, N): one number for all, or one for each with None where there is none;
None: those that act, see :meth:`LimitedMotors.torque_limits`."""
Cap = Annotated[Diagonal, _caps] | None
"""A largest norm: one number for positions and orientations alike, or one for each; None for none."""

_BRAKING = 2.0  # 1/s: rate at which the torque that a hedge falls back to slows all motions
_WITHIN = 0.98  # of a limit: how near that torque comes, so that there is a way to any other


class LimitedMotors:
    """Base of laws that keep their torques within limits.

    Whoever closes the loop says with :meth:`limit_motors`, before ``reset``, which limits act behind the
    law; simulation passes on those of the scenario's saturation. A law that is told another limit than
    the one that acts does not know that its torques are cut.
    """

    _acting: Array | None = None

    def limit_motors(self, acting: Array | None) -> None:
        """
        Args:
            acting: Largest |v| that acts (N m, N), shape (nz,), inf where nothing limits a motor; None
                if that is not known.
        """
        self._acting = acting

    def torque_limits(self, robot: MobileManipulator, given: TorqueLimits) -> Array:
        """Largest |v| of each motor (N m, N), shape (nz,); inf for those without a limit.

        Args:
            robot: The nominal robot, whose URDF's limits count where nothing says which act.
            given: The law's own gain, which comes first.

        Raises:
            GainError: If it has the wrong length.
        """
        if given is None:
            return (robot.limits.torque if self._acting is None else self._acting).copy()
        limits = np.asarray(given, dtype=float)  # None is NaN
        return diagonal("torque_limits", np.where(np.isnan(limits), np.inf, limits), robot.nz)


def plain_limits(limits: Array) -> list[float | None]:
    """Limits as a gain and a file have them: None for the motors without one."""
    return [float(limit) if np.isfinite(limit) else None for limit in limits]


def caps_of(cap: Cap) -> Array:
    """The caps of positions and of orientations, shape (2,); inf for none."""
    return np.full(2, np.inf) if cap is None else diagonal("cap", cap, 2)


@kernel
def cap(
    x: Vector, m: int, largest: Vector, power: float, weights: Vector, weight_power: float
) -> None:
    """Scale the positions and the orientations in x to a norm of largest^power at most, each by itself.

    Args:
        x: Errors or what is made of them; only the task's own are changed.
        m: How many these are: up to three of position, the rest of orientation.
        largest: Of positions and of orientations, shape (2,); inf for none.
        power: Exponent of it.
        weights: The norm is of x_i weights_i^weight_power.
        weight_power: See there.
    """
    for part in range(2):
        if math.isinf(largest[part]):
            continue
        first, last = (0, min(m, 3)) if part == 0 else (3, m)
        size = 0.0
        for i in range(first, last):
            size += (weights[i] ** weight_power * x[i]) ** 2
        size = math.sqrt(size)
        if size > largest[part] ** power:
            for i in range(first, last):
                x[i] *= largest[part] ** power / size


@kernel
def hedge(
    dt: float,
    limit: Vector,
    stage: Any,
    held: Any,
    J: Matrix,
    z: Vector,
    z_dot: Vector,
    M: Matrix,
    B: Matrix,
    inside: Vector,
    change: Vector,
    force: Vector,
    work: Matrix,
) -> int:
    """Bring the torque v of a sliding law within the motors' limits, without wind-up of its integrals.

    v moves towards one that brakes, z' = -2 z. The acceleration that it does not give,
    Delta = M^-1 B (v - v_wanted), leaves the reference: v_ref += Delta, its integral += dt Delta,
    and the integral of g -= J Delta, so that s of (31) and S of (51) stay where they were.

    ``limit`` is that of each |v|, inf where there is none; ``stage`` the kinematic one, ``held`` the
    other integrals, both advanced over the tick; J that of the coordinates in s; z and z' are measured.
    The last four are work space.
    """
    v, within = held.v, True
    for i in range(v.shape[0]):
        within = within and abs(v[i]) <= limit[i]
    if within:
        return 0
    for i in range(v.shape[0]):
        change[i] = -_BRAKING * z[i] - z_dot[i]
    apply(M, change, force)
    if solve(B, force, inside, work) != 0:
        return Stop.NO_INVERSE
    for i in range(v.shape[0]):
        inside[i] += v[i] - dt * held.v_dot[i]  # the torque under which z' was measured
        inside[i] = min(max(inside[i], -_WITHIN * limit[i]), _WITHIN * limit[i])
        change[i] = -v[i]
    fit_torque(limit, inside, v)
    for i in range(v.shape[0]):
        change[i] += v[i]
    apply(B, change, force)
    if cholesky(M, work) != 0:
        return Stop.NOT_DEFINITE
    cholesky_solve(work, force, change)
    for i in range(v.shape[0]):
        held.v_ref[i] += change[i]
        held.integral_v_ref[i] += dt * change[i]
    for i in range(J.shape[0]):
        stage.integral[i] -= dot(J[i], change)
    return 0


@kernel
def fit_torque(limit: Vector, inside: Vector, v: Vector) -> bool:
    """Move v towards a torque within the limits until all |v_i| <= limit_i; True if it moved.

    All motors move by one share of the way, so that the direction of the difference stays: clipping
    motor by motor would ask for another motion. A law that integrates must, where this is True, undo in
    its integrals what the motors do not do, or not integrate in this tick.

    Args:
        limit: Shape (nz,); inf where there is none.
        inside: A torque within the limits (what brakes the robot, or holds it), shape (nz,).
        v: The torque that is wanted, shape (nz,); written in place.
    """
    share = 1.0
    for i in range(v.shape[0]):
        if not abs(v[i]) <= limit[i]:
            bound = limit[i] if v[i] > 0.0 else -limit[i]
            share = min(share, (bound - inside[i]) / (v[i] - inside[i]))
    if share == 1.0:
        return False
    for i in range(v.shape[0]):
        v[i] = inside[i] + share * (v[i] - inside[i])
        v[i] = min(max(v[i], -limit[i]), limit[i])  # rounding
    return True


# Torques that act late --------------------------------------------------------------------------------

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


@kernel
def predict_acceleration(
    late: Matrix,
    v: Vector,
    M: Matrix,
    B: Matrix,
    z_dot: Vector,
    change: Vector,
    force: Vector,
    work: Matrix,
) -> int:
    """z' + M^-1 B (v_{k-1} - v_{k-1-d}) in the place of z': once all torques under way have arrived.

    ``v`` is v_{k-1}, which joins ``late``, v_{k-2}, v_{k-3}, ..., shape (d + 1, nz); M, B are nominal,
    z' is measured; the last three are work space.
    """
    last = late.shape[0] - 1
    for i in range(v.shape[0]):
        for k in range(last, 0, -1):
            late[k, i] = late[k - 1, i]
        late[0, i] = v[i]
        change[i] = v[i] - late[last, i]
    apply(B, change, force)
    if cholesky(M, work) != 0:
        return Stop.NOT_DEFINITE
    cholesky_solve(work, force, change)
    for i in range(v.shape[0]):
        z_dot[i] += change[i]
    return 0
