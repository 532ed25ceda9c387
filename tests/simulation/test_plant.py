"""The true robot: other masses and inertias, a payload, disturbance torques."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.settings import true_robot
from support.states import random_states

import mobman as mm
from mobman.simulation.plant import Plant


def _centre_of_mass(robot, q):
    return pin.centerOfMass(robot.model, robot.model.createData(), q).copy()


def test_nothing_changed_is_the_same_robot(robot):
    assert true_robot(robot) is robot


def test_mass_factor_scales_everything_that_is_heavy(robot):
    heavy = true_robot(robot, 1.3)
    for q, z in random_states(robot, 20):
        nominal, true = robot.dynamics(q, z), heavy.dynamics(q, z)
        assert np.allclose(true.M, 1.3 * nominal.M, rtol=1e-10, atol=1e-10)
        assert np.allclose(true.bias, 1.3 * nominal.bias, rtol=1e-9, atol=1e-8)
        assert np.array_equal(true.B, nominal.B)
    assert np.isclose(pin.computeTotalMass(heavy.model), 1.3 * pin.computeTotalMass(robot.model))
    assert np.allclose(_centre_of_mass(heavy, robot.q_rest), _centre_of_mass(robot, robot.q_rest))


def test_inertia_factor_scales_the_moments_about_the_centres_of_mass_alone(robot):
    other = true_robot(robot, 1.0, 2.0)
    for name in robot.joint_names:
        i = robot.model.getJointId(name)
        link, true = robot.model.inertias[i], other.model.inertias[i]
        assert true.mass == link.mass
        assert np.allclose(true.lever, link.lever)
        assert np.allclose(true.inertia, 2.0 * link.inertia)


def test_both_factors_at_once(robot):
    other = true_robot(robot, 0.7, 1.1)
    i = robot.model.getJointId(robot.joint_names[robot.arm_index[-1]])
    link, true = robot.model.inertias[i], other.model.inertias[i]
    assert np.isclose(true.mass, 0.7 * link.mass)
    assert np.allclose(true.inertia, 1.1 * link.inertia)


def test_payload_is_a_point_mass_at_the_tip(robot):
    """M gains (J C)^T m (J C), J the tip's linear Jacobian; gravity its weight; the rest nothing."""
    mass = 1.7
    loaded = true_robot(robot, payload=mass)
    for q, z in random_states(robot, 20):
        jacobian = robot.tip_jacobian(q)[:3] @ robot.velocity_map(q)
        gained = loaded.dynamics(q, z).M - robot.dynamics(q, z).M
        expected = mass * jacobian.T @ jacobian
        assert np.allclose(gained, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))
        weight = loaded.dynamics(q, 0 * z).bias - robot.dynamics(q, 0 * z).bias
        assert np.allclose(weight, jacobian.T @ [0.0, 0.0, mass * 9.81], atol=1e-7)


def test_payload_moves_the_centre_of_mass(robot):
    mass = 1.7
    loaded = true_robot(robot, payload=mass)
    own = pin.computeTotalMass(robot.model)
    assert np.isclose(pin.computeTotalMass(loaded.model), own + mass)
    for q, _ in random_states(robot, 5):
        tip = robot.tip_pose(q).translation
        expected = (own * _centre_of_mass(robot, q) + mass * tip) / (own + mass)
        assert np.allclose(_centre_of_mass(loaded, q), expected, atol=1e-10)


def test_payload_is_not_scaled_by_the_mass_factor(youbot):
    own = pin.computeTotalMass(youbot.model)
    loaded = true_robot(youbot, 1.3, payload=1.0)
    assert np.isclose(pin.computeTotalMass(loaded.model), 1.3 * own + 1.0)


def test_nominal_robot_stays_as_it_was(youbot):
    before = youbot.dynamics(youbot.q_rest, np.ones(5)).M
    true_robot(youbot, 2.0, 3.0, 4.0)
    assert np.array_equal(before, youbot.dynamics(youbot.q_rest, np.ones(5)).M)


def test_kinematics_and_constraints_stay(robot):
    other = true_robot(robot, 1.3, 0.5, 1.0)
    assert other.platform is robot.platform
    assert other.joint_names == robot.joint_names
    for q, _ in random_states(robot, 5):
        assert np.allclose(other.tip_pose(q).homogeneous, robot.tip_pose(q).homogeneous)
        assert np.array_equal(other.constraint_matrix(q), robot.constraint_matrix(q))


def test_acceleration_solves_the_reduced_dynamics(robot):
    """M z' + Pz + G + D = B v with D = -B d for a disturbance torque d."""
    random = np.random.default_rng(81)
    for q, z in random_states(robot, 20):
        torque, disturbance = random.standard_normal((2, robot.nz))
        plant = Plant(robot, lambda t, d=disturbance: t * d)
        m, bias, b = robot.dynamics(q, z)
        for t in (0.0, 2.0):
            z_dot = plant.acceleration(t, q, z, torque)
            missing = m @ z_dot + bias - b @ (torque + t * disturbance)
            assert np.abs(missing).max() < 1e-9 * max(1.0, np.abs(bias).max())


def test_disturbance_is_a_torque_of_the_motors(youbot):
    """A disturbance and an equal torque of the motors do the same."""
    q, z = youbot.q_rest, np.ones(5)
    push = np.array([0.3, -0.2, 0.1, 0.5, -0.4])
    disturbed = Plant(youbot, lambda t: push).acceleration(0.0, q, z, np.zeros(5))
    driven = Plant(youbot).acceleration(0.0, q, z, push)
    assert np.allclose(disturbed, driven, atol=1e-10)


@pytest.mark.parametrize("form", ["name", "file", "path", "scenario", "robot"])
def test_plant_may_be_a_scenario_or_a_robot(form, youbot, tmp_path):
    """plant="heavier" has the scenario's masses and nothing else of it."""
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nmass_factor = 1.3\npayload = 1.0\n', encoding="utf-8")
    plant = {
        "file": str(file),
        "path": file,
        "name": "heavier",
        "scenario": mm.load_scenario("heavier"),
        "robot": true_robot(youbot, 1.3, payload=1.0),
    }[form]
    found = mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.02, plant=plant)
    expected = mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.02, scenario="heavier")
    nominal = mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.02)
    assert np.allclose(found.q, expected.q, atol=1e-13)
    assert not np.allclose(found.q, nominal.q, atol=1e-7)
    assert found.scenario == "nominal"
