"""The reduced dynamics (17) against the full ones (16), on every robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from support.differences import relative
from support.states import random_states


def _full(robot, q, q_dot):
    """M' and P' + G' of (16) from the inverse dynamics alone, column by column."""
    model, data = robot.model, robot.model.createData()
    nothing = np.zeros(robot.nq)
    still = pin.rnea(model, data, q, nothing, nothing).copy()
    inertia = np.array(
        [pin.rnea(model, data, q, nothing, unit) - still for unit in np.eye(robot.nq)]
    ).T
    return inertia, pin.rnea(model, data, q, q_dot, nothing).copy()


def test_inertia_is_symmetric_positive_definite(robot):
    for q, z in random_states(robot):
        m = robot.dynamics(q, z).M
        assert np.abs(m - m.T).max() <= 1e-13 * np.abs(m).max()
        assert np.linalg.eigvalsh(m)[0] > 0.0


def test_inertia_is_that_of_the_inverse_dynamics(robot):
    """Both triangles: Pinocchio's composite-body algorithm used to fill one only."""
    for q, z in random_states(robot, 20):
        inertia, _ = _full(robot, q, np.zeros(robot.nq))
        c = robot.velocity_map(q)
        assert relative(robot.dynamics(q, z).M, c.T @ inertia @ c) < 1e-11


def test_kinetic_energy_is_half_z_M_z(robot):
    for q, z in random_states(robot):
        still = np.zeros(robot.nz)
        kinetic = robot.energy(q, z) - robot.energy(q, still)
        expected = 0.5 * z @ robot.dynamics(q, z).M @ z
        # the potential energy, up to some 1e3 J, cancels in the difference
        assert abs(kinetic - expected) < 1e-10 * max(1.0, expected)


def test_actuation_is_that_of_the_motors(robot):
    """B = C^T B' of (17); every joint of the arm has a motor of its own."""
    for q, z in random_states(robot, 20):
        driven = robot.actuation(q)
        assert relative(robot.dynamics(q, z).B, robot.velocity_map(q).T @ driven) < 1e-12
        arm = np.zeros((robot.nq, robot.n))
        arm[robot.arm_index, np.arange(robot.n)] = 1.0
        assert np.array_equal(driven[:, robot.n_alpha :], arm)


def test_power_of_the_motors_is_what_the_robot_takes_up(robot):
    """d/dt of the energy under a torque is q'^T B' v: gravity and Coriolis forces do no more."""
    random = np.random.default_rng(8)
    for q, z in random_states(robot, 20):
        torque = random.standard_normal(robot.nz)
        dynamics = robot.dynamics(q, z)
        z_dot = np.linalg.solve(dynamics.M, dynamics.B @ torque - dynamics.bias)
        q_dot = robot.velocity_map(q) @ z
        h = 1e-5
        step = (
            robot.energy(q + h * q_dot, z + h * z_dot),
            robot.energy(q - h * q_dot, z - h * z_dot),
        )
        power = q_dot @ robot.actuation(q) @ torque
        scale = max(1.0, abs(power), np.abs(q_dot) @ np.abs(robot.actuation(q) @ torque))
        assert abs((step[0] - step[1]) / (2 * h) - power) < 1e-4 * scale


def test_acceleration_is_that_of_the_full_model_with_multipliers(robot):
    """(16) and the differentiated constraints as one linear system in q'' and lambda:

    [M' A^T; A 0] [q''; lambda] = [B' v - P' - G'; -A' q'].
    """
    random = np.random.default_rng(7)
    k, nq = robot.k, robot.nq
    for q, z in random_states(robot):
        torque = random.standard_normal(robot.nz)
        c, q_dot, c_dot_z = robot.velocity(q, z)
        inertia, bias = _full(robot, q, q_dot)
        a = robot.constraint_matrix(q)
        system = np.block([[inertia, a.T], [a, np.zeros((k, k))]])
        right = np.concatenate(
            (robot.actuation(q) @ torque - bias, -robot.constraint_matrix_rate(q, q_dot) @ q_dot)
        )
        expected = np.linalg.solve(system, right)[:nq]
        dynamics = robot.dynamics(q, z)
        z_dot = np.linalg.solve(dynamics.M, dynamics.B @ torque - dynamics.bias)
        assert relative(c @ z_dot + c_dot_z, expected) < 1e-9


def test_results_are_the_callers(robot):
    """The next call leaves them alone."""
    kept = []
    for q, z in random_states(robot, 3):
        for result in (robot.dynamics(q, z), robot.velocity(q, z)):
            kept.append((result, [part.copy() for part in result]))
    for result, copies in kept:
        for part, copy in zip(result, copies, strict=True):
            assert np.array_equal(part, copy)
