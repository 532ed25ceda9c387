"""Integration of the plant between ticks: Runge-Kutta of order 4, and the bounds of divergence."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.errors import SingularityError
from mobman.simulation.actuation import ActuationChain
from mobman.simulation.plant import Forces, Plant, accelerate, require_success

_LARGEST_STEP = 1e-3  # s: the plant's integration step is at most this

FASTEST = 1e4
"""1/s or m/s: a reduced velocity beyond it has diverged."""
FARTHEST = 1e3
"""m: a task error beyond it has diverged."""


class Divergence(IntEnum):
    """Reasons why a state counts as diverged."""

    NO = 0
    STATE = 11
    DESIRED = 12
    FAST = 13
    FAR = 14
    NOT_UNIT = 15

    def reason(self, z: Array, error: Array) -> str:
        """The reason in words, by the reduced velocity, shape (nz,), and the task error (m), (m,)."""
        return {
            Divergence.NO: "",
            Divergence.STATE: "the state is not finite",
            Divergence.DESIRED: "the desired trajectory is not finite",
            Divergence.FAST: f"|z| is {np.abs(z).max():.3g}, above {FASTEST:g}",
            Divergence.NOT_UNIT: "the desired quaternion, or axis, is not of length 1",
            Divergence.FAR: f"|e^e| is {np.abs(error).max():.3g} m, above {FARTHEST:g} m",
        }[self]


class _Step(NamedTuple):
    """A step of Runge-Kutta: its length, the state at which a slope is taken, the state at which it
    starts, and the four slopes of q, z and the work."""

    h: Vector
    q: Vector
    z: Vector
    q_0: Vector
    z_0: Vector
    q_slopes: Matrix
    z_slopes: Matrix
    power: Matrix
    work: Vector


class RungeKutta:
    """The plant's state, and its steps under a held torque.

    The state is in ``plant.now``; the quantities that depend on the velocity alone are there, too. At
    each state the dynamics are evaluated once, and what was evaluated for a measurement
    serves the step that follows.

    Args:
        plant: The plant, from the state q, z on, shapes (nq,) and (nz,), in steps of h (s).

    Attributes:
        h: Length of the next step (s), shape (1,).
        work: Integral of z^T (B v - D) since the start (J), shape (1,).
    """

    def __init__(self, plant: Plant, q: Array, z: Array, h: float) -> None:
        self.plant, now, nq, nz = plant, plant.now, plant.robot.nq, plant.robot.nz
        now.q[:], now.z[:] = q, z
        self.h, self.work = np.array([h], dtype=float), np.zeros(1)
        step = _Step(
            *(self.h, now.q, now.z, now.q.copy(), now.z.copy()),
            *(np.zeros((4, nq)), np.zeros((4, nz)), np.zeros((4, 1)), self.work),
        )
        motion = [plant.motion] if plant.slips else []
        self._stages = [
            sequence(
                *([plant.dynamics] if i else []),  # at the start they are evaluated
                *motion,
                bind(_slope, plant.forces, plant.q_dot, step, i),
                now.velocity,
            )
            for i in range(4)
        ]
        self._run_dynamics = now.run_dynamics
        now.velocity()

    @cached_property
    def _dynamics(self) -> Callable[[], int]:
        return sequence(self.plant.dynamics)

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
            plant.disturb(t + 0.5 * float(self.h[0]))
        run_dynamics()
        status = second()
        run_dynamics()
        status |= third()
        if plant.disturbed:
            plant.disturb(t + float(self.h[0]))
        run_dynamics()
        require_success(status | fourth())


class TickIntegrator:
    """Integrates the plant tick by tick (dt, s), from rest at q0 (m, rad), shape (nq,), in equal steps
    of at most 1 ms.

    Where torques arrive between ticks, by an actuation, a tick has two parts, each in steps of its own;
    the plant has the torque that acts from a tick on.

    Raises:
        SpecError: If friction is too steep to be integrated in these steps.
    """

    def __init__(
        self, plant: Plant, actuation: ActuationChain | None, q0: Array, dt: float
    ) -> None:
        h = dt / _steps_of(dt)
        plant.follow_friction(q0, h)
        self._plant, self._actuation = plant, actuation
        self._state = plant.own_state(q0, h) or RungeKutta(plant, q0, np.zeros(plant.robot.nz), h)
        split = actuation.split if actuation is not None else 0.0
        self._first, self._second = (split * dt, (1.0 - split) * dt) if split else (dt, 0.0)

    @property
    def work(self) -> float:
        """Integral of z^T (B v - D) since the start (J)."""
        return float(self._state.work[0])

    def advance(self, t: float) -> tuple[float, str] | None:
        """Go from a tick, at t (s), to the next; the dynamics are evaluated at the state.

        Returns:
            The time (s) and the reason if the state diverges on the way.

        Raises:
            SingularityError: If M is not positive definite somewhere on the way.
        """
        diverged = self._integrate(t, self._first)
        if self._second and self._actuation is not None and diverged is None:
            self._plant.v[:] = self._actuation.late
            return self._integrate(t + self._first, self._second, evaluated=False)
        return diverged

    def _integrate(
        self, t: float, length: float, evaluated: bool = True
    ) -> tuple[float, str] | None:
        """Integrate a part of a tick that starts at t; the dynamics are evaluated, or not yet."""
        state = self._state
        try:
            if not evaluated:
                state.evaluate(t)
            longest = self._plant.longest_step(_LARGEST_STEP)
            steps = 1 if length <= longest else _steps_of(length, longest)
            state.h[0] = length / steps
            state.step(t)
            for step in range(1, steps):
                later = t + step * length / steps
                state.evaluate(later)
                state.step(later)
        except SingularityError:
            # far and fast enough, rounding makes M indefinite before anything overflows
            now, near = self._plant.now, np.zeros((4, 3))
            found = Divergence(divergence(now.q, now.z, near[0], near))
            if not found:
                raise
            return t + length, found.reason(now.z, near[0])
        return None


def _steps_of(length: float, largest: float = _LARGEST_STEP) -> int:
    """Number of integration steps in so many seconds."""
    return max(1, math.ceil(length / largest - 1e-9))


@kernel
def divergence(q: Vector, z: Vector, tip: Vector, p_d: Matrix) -> int:
    """The number of a :class:`Divergence`, by the state, the tip (m), shape (3,), and the desired
    position in the first row of p_d, (4, 2) or more; as an enum it would be made in Python: 2 us."""
    directions = min(p_d.shape[1], 3)
    for i in range(q.shape[0]):
        if not math.isfinite(q[i]):
            return Divergence.STATE.value
    for i in range(z.shape[0]):
        if not math.isfinite(z[i]):
            return Divergence.STATE.value
    for i in range(directions):
        if not math.isfinite(tip[i] - p_d[0, i]):
            return Divergence.DESIRED.value
    for i in range(z.shape[0]):
        if abs(z[i]) > FASTEST:
            return Divergence.FAST.value
    for i in range(directions):
        if abs(tip[i] - p_d[0, i]) > FARTHEST:
            return Divergence.FAR.value
    return Divergence.NO.value


@kernel
def _slope(forces: Forces, q_dot: Vector, at: _Step, i: int) -> None:
    """The slope of stage i, and the state where the next one is taken: after the last, the state a
    step later, where the next step starts."""
    h, q_0, z_0, k_q, k_z, w = at.h[0], at.q_0, at.z_0, at.q_slopes, at.z_slopes, at.power
    accelerate(forces, k_z[i], w[i])
    for r in range(q_0.shape[0]):
        k_q[i, r] = q_dot[r]
    if i < 3:
        h = h if i == 2 else 0.5 * h
        for r in range(q_0.shape[0]):
            at.q[r] = q_0[r] + h * k_q[i, r]
        for r in range(z_0.shape[0]):
            at.z[r] = z_0[r] + h * k_z[i, r]
        return
    sixth = h / 6.0
    for r in range(q_0.shape[0]):
        q_0[r] += sixth * (k_q[0, r] + 2.0 * (k_q[1, r] + k_q[2, r]) + k_q[3, r])
        at.q[r] = q_0[r]
    for r in range(z_0.shape[0]):
        z_0[r] += sixth * (k_z[0, r] + 2.0 * (k_z[1, r] + k_z[2, r]) + k_z[3, r])
        at.z[r] = z_0[r]
    at.work[0] += sixth * (w[0, 0] + 2.0 * (w[1, 0] + w[2, 0]) + w[3, 0])
