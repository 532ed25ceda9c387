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


def test_motors_act_on_the_driven_coordinates(robot):
    """B = C^T B', where B' of (16) has a 1 for each wheel and each joint of the arm."""
    driven = np.zeros((robot.nq, robot.nz))
    names = [*robot.platform.coordinates[3:], *robot.velocity_names[robot.n_alpha :]]
    for motor, name in enumerate(names):
        driven[robot.joint_names.index(name), motor] = 1.0
    assert np.array_equal(robot.actuation, driven)
    for q, z in random_states(robot, 20):
        assert relative(robot.dynamics(q, z).B, robot.velocity_map(q).T @ driven) < 1e-14


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
            (robot.actuation @ torque - bias, -robot.constraint_matrix_rate(q, q_dot) @ q_dot)
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
