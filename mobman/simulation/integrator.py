"""Runge-Kutta of order 4 on the plant's state."""

from __future__ import annotations

from copy import copy

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Program, call, program
from mobman.simulation.plant import Plant, require_success


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
