"""Runge-Kutta of order 4 on the plant's state."""

from __future__ import annotations

from typing import NamedTuple

from mobman.arrays import Array
from mobman.simulation.plant import Instant, Plant


class State(NamedTuple):
    """The plant's state, and the work done on it since the start."""

    q: Array
    """Configuration (m, rad), shape (nq,)."""
    z: Array
    """Reduced velocity, shape (nz,)."""
    work: float
    """Integral of z^T (B v - D) (J)."""


def rk4_step(
    plant: Plant, t: float, state: State, torque: Array, h: float, now: Instant | None = None
) -> State:
    """The state a step later, under a held torque.

    Args:
        plant: The plant.
        t: Time (s).
        state: State at t.
        torque: v, shape (nz,).
        h: Step (s).
        now: ``plant.at(t, q, z)``, if it is known already.
    """
    q, z, work = state
    instant = plant.at(t, q, z) if now is None else now
    dq1, dz1, power1 = _slopes(instant, z, torque)
    dq2, dz2, power2 = _slopes_at(plant, t + 0.5 * h, q + 0.5 * h * dq1, z + 0.5 * h * dz1, torque)
    dq3, dz3, power3 = _slopes_at(plant, t + 0.5 * h, q + 0.5 * h * dq2, z + 0.5 * h * dz2, torque)
    dq4, dz4, power4 = _slopes_at(plant, t + h, q + h * dq3, z + h * dz3, torque)
    sixth = h / 6.0
    return State(
        q + sixth * (dq1 + 2.0 * (dq2 + dq3) + dq4),
        z + sixth * (dz1 + 2.0 * (dz2 + dz3) + dz4),
        work + float(sixth * (power1 + 2.0 * (power2 + power3) + power4)),
    )


def _slopes_at(
    plant: Plant, t: float, q: Array, z: Array, torque: Array
) -> tuple[Array, Array, float]:
    return _slopes(plant.at(t, q, z), z, torque)


def _slopes(instant: Instant, z: Array, torque: Array) -> tuple[Array, Array, float]:
    """q', z' and the power that goes into the robot."""
    force = instant.force(torque)
    return instant.q_dot, instant.factor.solve(force - instant.bias), float(z @ force)
