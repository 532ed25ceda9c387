"""Energy and power of the reduced dynamics, on every robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from support.differences import derivative
from support.states import random_states


def test_kinetic_energy_grows_by_the_power_of_the_reduced_dynamics(robot):
    """dT/dt = z^T (B v - G) to 1e-8.

    T is Pinocchio's kinetic energy of the full model at q' = C z, which knows nothing of M, P or C'.
    Its derivative along the motion depends on (q', z') alone, so it is taken along the straight line
    (q + s q', z + s z'), by central differences of order 8. Rounding leaves some 1e-13 T and
    truncation less at this step, so 1e-8 of the power's own terms is far from both.
    """
    random = np.random.default_rng(5)
    model, data = robot.model, robot.model.createData()

    def kinetic(q, z):
        return pin.computeKineticEnergy(model, data, q, robot.velocity_map(q) @ z)

    for q, z in random_states(robot):
        torque = 10.0 * random.standard_normal(robot.nz)
        m, bias, b = robot.dynamics(q, z)
        z_dot = np.linalg.solve(m, b @ torque - bias)
        c = robot.velocity_map(q)
        q_dot = c @ z
        gravity = c.T @ pin.computeGeneralizedGravity(model, data, q)
        rate = derivative(
            lambda s, q=q, z=z, d=q_dot, a=z_dot: kinetic(q + s * d, z + s * a),
            h=_step(q_dot, z_dot),
        )
        driving, falling = z * (b @ torque), -z * gravity
        size = np.abs(driving).sum() + np.abs(falling).sum()
        assert abs(rate - driving.sum() - falling.sum()) < 1e-8 * size


def test_gravity_and_velocity_terms_do_the_work_of_the_energy(robot):
    """dE/dt = z^T B v with E = T + U: without torque, E does not change along the motion."""
    for q, z in random_states(robot, 50, seed=6):
        m, bias, _ = robot.dynamics(q, z)
        z_dot = -np.linalg.solve(m, bias)
        q_dot = robot.velocity_map(q) @ z
        rate = derivative(
            lambda s, q=q, z=z, d=q_dot, a=z_dot: robot.energy(q + s * d, z + s * a),
            h=_step(q_dot, z_dot),
        )
        assert abs(rate) < 1e-8 * max(1.0, np.abs(z * bias).sum())


def _step(q_dot, z_dot) -> float:
    """A step over which no angle moves by more than about 0.01 rad."""
    return 1e-2 / max(1.0, np.abs(q_dot[:3]).max(), np.abs(z_dot).max() * 0.1)
