"""Integration of the plant between ticks: Runge-Kutta of order 4, and the bounds of divergence."""

from __future__ import annotations

import math
from copy import copy
from typing import NamedTuple

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.errors import SingularityError
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, Program, call, program
from mobman.simulation.actuation import ActuationChain
from mobman.simulation.plant import Plant, require_success

_LARGEST_STEP = 1e-3  # s: the plant's integration step is at most this

FASTEST = 1e4
"""1/s or m/s: a reduced velocity beyond it has diverged."""
FARTHEST = 1e3
"""m: a task error beyond it has diverged."""

_STATE, _DESIRED, _FAST, _FAR = 11, 12, 13, 14


class RungeKutta:
    """The plant's state, and its steps under a held torque.

    The state is in ``plant.now``; the quantities that depend on the velocity alone are there, too. At
    each state the dynamics are evaluated once, and what was evaluated for a measurement
    serves the step that follows.

    Args:
        plant: The plant.
        q: Its configuration, shape (nq,).
        z: Its reduced velocity, shape (nz,).
        h: Length of a step (s).

    Attributes:
        work: Integral of z^T (B v - D) since the start (J), shape (1,).
    """

    def __init__(self, plant: Plant, q: Array, z: Array, h: float) -> None:
        self.plant = plant
        now, robot = plant.now, plant.robot
        now.q[:] = q
        now.z[:] = z
        self.work = np.zeros(1)
        self._start = now.q.copy(), now.z.copy()
        self._slopes = np.zeros((4, robot.nq)), np.zeros((4, robot.nz)), np.zeros((4, 1))
        self._run_dynamics = now.run_dynamics
        self._dynamics = program(plant.dynamics_steps())
        self._set_step(h)
        program(now.velocity_steps())()

    def of_step(self, h: float) -> RungeKutta:
        """Another one on the same state, with steps of h (s)."""
        other = copy(self)
        other._set_step(h)
        return other

    def _set_step(self, h: float) -> None:
        self._h = float(h)
        plant, now = self.plant, self.plant.now
        (q_0, z_0), (q_slopes, z_slopes, power) = self._start, self._slopes
        stages: list[Program] = []
        for i, fraction in enumerate((0.5, 0.5, 1.0, 0.0)):
            slopes = [
                *plant.friction_steps(),
                plant.acceleration_step(z_slopes[i], power[i]),
                *plant.motion_steps(q_slopes[i]),
            ]
            to_the_next = (
                call(_go, q_0, z_0, q_slopes[i], z_slopes[i], fraction * self._h, now.q, now.z)
                if i < 3
                else call(
                    _finish,
                    *(q_0, z_0, q_slopes, z_slopes, power, self._h),
                    *(now.q, now.z, self.work),
                )
            )
            dynamics = plant.dynamics_steps() if i else []
            stages.append(program([*dynamics, *slopes, to_the_next, *now.velocity_steps()]))
        self._stages = stages

    def evaluate(self, t: float) -> None:
        """Evaluate the dynamics at the state and the time t (s).

        Raises:
            SingularityError: If M is not positive definite.
        """
        self.plant.now.run_dynamics()
        self.plant.disturb(t)
        require_success(self._dynamics())

    def step(self, t: float) -> None:
        """Go on from t to t + h under the plant's torque; the dynamics are evaluated at the state.

        Raises:
            SingularityError: If M is not positive definite somewhere on the way.
        """
        plant, run_dynamics = self.plant, self._run_dynamics
        first, second, third, fourth = self._stages
        first()
        if plant.disturbed:
            plant.disturb(t + 0.5 * self._h)
        run_dynamics()
        status = second()
        run_dynamics()
        status |= third()
        if plant.disturbed:
            plant.disturb(t + self._h)
        run_dynamics()
        if status := status | fourth():
            require_success(status)


class _Part(NamedTuple):
    """A tick, or a part of one."""

    state: RungeKutta
    length: float
    """s."""
    steps: int


class TickIntegrator:
    """Integrates the plant tick by tick, from rest, in equal steps of at most 1 ms.

    Where torques arrive between ticks, a tick has two parts, each in steps of its own.

    Args:
        plant: The plant, with the torque that acts from a tick on.
        actuation: Gives the torque that arrives later in the tick; None if none does.
        q0: Start (m, rad), shape (nq,).
        dt: Sampling period (s).

    Raises:
        SpecError: If friction is too steep to be integrated in these steps.
    """

    def __init__(
        self,
        plant: Plant,
        actuation: ActuationChain | None,
        q0: Array,
        dt: float,
    ) -> None:
        steps = _steps_of(dt)
        plant.require_followed(q0, dt / steps)
        self._plant, self._actuation = plant, actuation
        self._state = RungeKutta(plant, q0, np.zeros(plant.robot.nz), dt / steps)
        self._first = _Part(self._state, dt, steps)
        self._second: _Part | None = None
        if actuation is not None and actuation.split:
            self._first = self._part(actuation.split * dt)
            self._second = self._part((1.0 - actuation.split) * dt)
        self._runs_away = program(
            [divergence_step(plant.now.q, plant.now.z, np.zeros(3), np.zeros((4, 3)))]
        )

    @property
    def work(self) -> float:
        """Integral of z^T (B v - D) since the start (J)."""
        return float(self._state.work[0])

    def advance(self, t: float) -> tuple[float, str] | None:
        """Go from a tick to the next; if the state diverges on the way, the time (s) and the reason.

        Args:
            t: The tick's time (s); the dynamics are evaluated at the state.

        Raises:
            SingularityError: If M is not positive definite somewhere on the way.
        """
        first, second = self._first, self._second
        diverged = self._integrate(first, t)
        if second is not None and self._actuation is not None and diverged is None:
            self._plant.v[:] = self._actuation.late
            return self._integrate(second, t + first.length, evaluated=False)
        return diverged

    def _part(self, length: float) -> _Part:
        steps = _steps_of(length)
        return _Part(self._state.of_step(length / steps), length, steps)

    def _integrate(self, part: _Part, t: float, evaluated: bool = True) -> tuple[float, str] | None:
        """Integrate a part that starts at t; the dynamics are evaluated at the state, or not yet."""
        state, length, steps = part
        try:
            if not evaluated:
                state.evaluate(t)
            state.step(t)
            for step in range(1, steps):
                later = t + step * length / steps
                state.evaluate(later)
                state.step(later)
        except SingularityError:
            # far and fast enough, rounding makes M indefinite before anything overflows
            z = self._plant.now.z
            if (reason := divergence_reason(self._runs_away(), z, np.zeros(3))) is None:
                raise
            return t + length, reason
        return None


def _steps_of(length: float) -> int:
    """Number of integration steps in so many seconds."""
    return max(1, math.ceil(length / _LARGEST_STEP - 1e-9))


def divergence_step(q: Array, z: Array, tip: Array, p_d: Array) -> Call:
    """A step that reports a status if the state has diverged; see :func:`divergence_reason`.

    Args:
        q: Configuration, shape (nq,).
        z: Reduced velocity, shape (nz,).
        tip: Position of the tip (m), shape (3,).
        p_d: The desired position in its first row, shape (4, m).
    """
    return call(_diverged, q, z, tip, p_d)


def divergence_reason(status: int, z: Array, error: Array) -> str | None:
    """Meaning of a status of :func:`divergence_step`; None if it is not one of its own.

    Args:
        status: The status.
        z: Reduced velocity, shape (nz,).
        error: Task error (m), shape (m,).
    """
    return {
        _STATE: "the state is not finite",
        _DESIRED: "the desired trajectory is not finite",
        _FAST: f"|z| is {np.abs(z).max():.3g}, above {FASTEST:g}",
        _FAR: f"|e^e| is {np.abs(error).max():.3g} m, above {FARTHEST:g} m",
    }.get(status)


@kernel
def _diverged(q: Vector, z: Vector, tip: Vector, p_d: Matrix) -> int:
    for i in range(q.shape[0]):
        if not math.isfinite(q[i]):
            return _STATE
    for i in range(z.shape[0]):
        if not math.isfinite(z[i]):
            return _STATE
    for i in range(p_d.shape[1]):
        if not math.isfinite(tip[i] - p_d[0, i]):
            return _DESIRED
    for i in range(z.shape[0]):
        if abs(z[i]) > FASTEST:
            return _FAST
    for i in range(p_d.shape[1]):
        if abs(tip[i] - p_d[0, i]) > FARTHEST:
            return _FAR
    return 0


@kernel
def _go(
    q_0: Vector, z_0: Vector, q_slope: Vector, z_slope: Vector, h: float, q: Vector, z: Vector
) -> None:
    """The state where the next slopes are taken."""
    for i in range(q.shape[0]):
        q[i] = q_0[i] + h * q_slope[i]
    for i in range(z.shape[0]):
        z[i] = z_0[i] + h * z_slope[i]


@kernel
def _finish(
    q_0: Vector,
    z_0: Vector,
    q_slopes: Matrix,
    z_slopes: Matrix,
    power: Matrix,
    h: float,
    q: Vector,
    z: Vector,
    work: Vector,
) -> None:
    """The state a step later, from the four slopes; also where the next step starts."""
    sixth = h / 6.0
    for i in range(q.shape[0]):
        q_0[i] += sixth * (
            q_slopes[0, i] + 2.0 * (q_slopes[1, i] + q_slopes[2, i]) + q_slopes[3, i]
        )
        q[i] = q_0[i]
    for i in range(z.shape[0]):
        z_0[i] += sixth * (
            z_slopes[0, i] + 2.0 * (z_slopes[1, i] + z_slopes[2, i]) + z_slopes[3, i]
        )
        z[i] = z_0[i]
    work[0] += sixth * (power[0, 0] + 2.0 * (power[1, 0] + power[2, 0]) + power[3, 0])
