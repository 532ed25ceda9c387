"""The baselines at single instants: full-model computed torque makes the plant do what they ask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from support.states import random_states
from support.task_errors import errors_at

import mobman as mm
from mobman.controllers.baselines import (
    ExtendedJacobianControl,
    TrackingGains,
    computed_torque,
)
from mobman.controllers.gains import Positive, gain
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import GainError, SingularityError, UnknownNameError
from mobman.model.criterion import Posture
from mobman.simulation.plant import Plant

T = 0.7


def _near_rest(robot, count=15, seed=70):
    """States whose Jacobians are far from singular."""
    random = np.random.default_rng(seed)
    for _, z in random_states(robot, count, seed):
        yield robot.q_rest + 0.3 * random.standard_normal(robot.nq), 0.3 * z


def _acceleration(robot, law, q, z, **gains):
    controller = mm.make_controller(law, **gains)
    controller.reset(robot, mm.make_task("circle", robot), 1e-3)
    torque = controller.step(T, q, z, np.zeros(robot.nz))
    return Plant(robot).acceleration(T, q, z, torque)


def _errors(robot, q, z, extended):
    task = mm.make_task("circle", robot)
    return errors_at(TaskSpace(robot, task, Posture.of(robot) if extended else None), T, q, z)


def test_computed_torque_gives_the_wanted_acceleration(robot):
    random = np.random.default_rng(71)
    for q, z in random_states(robot, 20):
        wanted = random.standard_normal(robot.nz)
        force, torque, work = *np.zeros((2, robot.nz)), np.zeros((robot.nz, robot.nz))
        assert computed_torque(*robot.dynamics(q, z), wanted, torque, force, work) == 0
        assert np.allclose(Plant(robot).acceleration(0.0, q, z, torque), wanted, atol=1e-9)


@pytest.mark.parametrize("law", ["pseudo-inverse", "extended-jacobian"])
def test_error_obeys_the_linear_equation(law, youbot, tiago):
    """e'' + K_v e' + K_p e = 0 with e'' = J z' + J' z - p_d''."""
    for robot in (youbot, tiago):
        for q, z in _near_rest(robot):
            z_dot = _acceleration(robot, law, q, z, K_p=9.0, K_v=5.0)
            e = _errors(robot, q, z, law == "extended-jacobian")
            e_ddot = e.J @ z_dot + e.J_dot_z - e.p_ddot
            residual = e_ddot + 5.0 * e.e_dot + 9.0 * e.e
            assert np.abs(residual).max() < 1e-8 * max(1.0, np.abs(e_ddot).max())


def test_null_space_descends_the_criterion_and_damps(youbot):
    """What the tip does not need is -k_0 C^T dF/dq - k_d z, projected."""
    criterion = Posture.of(youbot)
    for q, z in _near_rest(youbot):
        z_dot = _acceleration(youbot, "pseudo-inverse", q, z, k_0=3.0, k_d=2.0)
        jacobian = _errors(youbot, q, z, False).J
        free = np.eye(youbot.nz) - np.linalg.pinv(jacobian) @ jacobian
        descent = -3.0 * youbot.velocity_map(q).T @ criterion.gradient(q) - 2.0 * z
        assert np.allclose(free @ z_dot, free @ descent, atol=1e-8)


def test_pseudo_inverse_is_the_shortest_without_a_null_space_term(youbot):
    for q, z in _near_rest(youbot):
        z_dot = _acceleration(youbot, "pseudo-inverse", q, z, k_0=0.0, k_d=0.0)
        jacobian = _errors(youbot, q, z, False).J
        assert np.allclose(np.linalg.pinv(jacobian) @ jacobian @ z_dot, z_dot, atol=1e-9)


def test_damping_trades_the_task_for_a_shorter_acceleration(youbot):
    """z' minimises |J z' - w|^2 + mu^2 |z'|^2, w the wanted acceleration of the tip."""
    for q, z in _near_rest(youbot):
        z_dot = _acceleration(youbot, "damped-least-squares", q, z, mu=0.3, k_0=0.0, k_d=0.0)
        e = _errors(youbot, q, z, False)
        wanted = e.p_ddot - 10.0 * e.e_dot - 25.0 * e.e - e.J_dot_z
        gradient = e.J.T @ (e.J @ z_dot - wanted) + 0.3**2 * z_dot
        assert np.abs(gradient).max() < 1e-8 * max(1.0, np.abs(wanted).max())
        exact = _acceleration(youbot, "pseudo-inverse", q, z, k_0=0.0, k_d=0.0)
        assert np.linalg.norm(z_dot) < np.linalg.norm(exact)


@pytest.mark.parametrize("law", ["pseudo-inverse", "damped-least-squares"])
def test_descent_of_the_criterion_does_not_disturb_the_tip(law, youbot):
    for q, z in _near_rest(youbot):
        jacobian = _errors(youbot, q, z, False).J
        with_descent = _acceleration(youbot, law, q, z, k_0=50.0, k_d=10.0)
        without = _acceleration(youbot, law, q, z, k_0=0.0, k_d=0.0)
        assert np.abs(with_descent - without).max() > 1e-3
        assert np.abs(jacobian @ (with_descent - without)).max() < 1e-8


def test_small_damping_is_the_pseudo_inverse(youbot):
    for q, z in _near_rest(youbot, 5):
        exact = _acceleration(youbot, "pseudo-inverse", q, z)
        damped = _acceleration(youbot, "damped-least-squares", q, z, mu=1e-5)
        assert np.allclose(damped, exact, rtol=1e-5, atol=1e-5 * np.abs(exact).max())


def test_damping_bounds_the_acceleration_at_a_singularity(youbot):
    """The arm straight up: the pseudo-inverse's acceleration grows beyond bounds nearby."""
    q = youbot.q_rest.copy()
    q[youbot.joint_names.index("y_2")] = -np.pi / 2 + 1e-5
    q[youbot.joint_names.index("y_3")] = 0.0
    z = np.zeros(youbot.nz)
    exact, damped = (
        np.linalg.norm(_acceleration(youbot, law, q, z, k_0=0.0, k_d=0.0))
        for law in ("pseudo-inverse", "damped-least-squares")
    )
    assert exact > 1e4
    assert damped < 1e3


LINK = """<link name="l{i}"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/><origin xyz="{x} 0 0"/>
<axis xyz="{axis}"/><limit lower="-3" upper="3" effort="100" velocity="5"/></joint>"""


def test_damping_gives_an_acceleration_at_a_singularity(tmp_path):
    """A yaw and two pitches, stretched out: the pseudo-inverse refuses it."""
    links = [("base", 0.0, "0 0 1"), ("l0", 0.0, "0 1 0"), ("l1", 0.3, "0 1 0")]
    parts = [LINK.format(i=i, parent=p, x=x, axis=axis) for i, (p, x, axis) in enumerate(links)]
    tip = """<link name="tip"/><joint name="fixed" type="fixed"><parent link="l2"/><child link="tip"/>
    <origin xyz="0.3 0 0"/></joint>"""
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(f'<robot name="arm"><link name="base"/>{"".join(parts)}{tip}</robot>')
    robot = mm.load_robot(urdf, platform="fixed")
    q, z = np.array([0.0, 0.7, 0.0]), np.zeros(3)
    with pytest.raises(SingularityError):
        _acceleration(robot, "pseudo-inverse", q, z)
    assert np.isfinite(_acceleration(robot, "damped-least-squares", q, z)).all()


def test_argument_that_nothing_has_the_name_of(youbot):
    """A kernel finds its arguments by their names."""

    def push(gravity, v):
        """Never called."""

    law = ExtendedJacobianControl(ExtendedJacobianControl.Gains())
    law.kernels = (push,)
    with pytest.raises(UnknownNameError, match=r"kernel 'push'.*'gravity'.*valid names: .*bias"):
        law.reset(youbot, mm.make_task("circle", youbot), 1e-3)


def test_gain_of_the_name_of_another_quantity(youbot):
    """A kernel that asks for M must not be given the inertia in the place of a gain."""

    @dataclass(frozen=True, kw_only=True)
    class Gains(TrackingGains):
        M: Positive = gain(1.0, "kg", "a mass")

    law = ExtendedJacobianControl(Gains())
    with pytest.raises(GainError, match=r"M is a gain of 'extended-jacobian'.*'computed_torque'"):
        law.reset(youbot, mm.make_task("circle", youbot), 1e-3)
