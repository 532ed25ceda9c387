"""Joints that follow others (<mimic>), against a model in which the coupling is a constraint."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.differences import derivative, relative
from support.platforms import on
from support.states import random_states

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.errors import UsageError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.task_map import TaskMap
from mobman.simulation.plant import Plant
from mobman.tasks.singular import stretched

INERTIA = (
    '<inertial><origin xyz="0.02 0.01 {z}"/><mass value="{m}"/>'
    '<inertia ixx="0.03" iyy="0.02" izz="0.01" ixy="0.001" ixz="0" iyz="0.002"/></inertial>'
)
# a lift of two stages and a cover beside it, an arm, a levelled wrist behind a mimic of a mimic
JOINTS = [
    ("lift_1", "prismatic", "root", "0 0 0.1", "0 0 1", ""),
    ("lift_2", "prismatic", "lift_1", "0 0 0.1", "0 0 1", ("lift_1", 0.8, 0.02)),
    ("pan", "revolute", "lift_2", "0.1 0 0.1", "0 0 1", ""),
    ("shoulder", "revolute", "pan", "0 0 0.1", "0 1 0", ""),
    ("elbow", "revolute", "shoulder", "0.3 0 0", "0 1 0", ("shoulder", -1.7, 0.3)),
    ("roll", "revolute", "elbow", "0.2 0 0", "1 0 0", ""),
    ("level", "revolute", "roll", "0.1 0 0", "0 1 0", ("elbow", -0.5, 0.1)),
    ("cover", "prismatic", "lift_1", "0.2 0.1 0", "0 0 1", ("lift_1", -0.5, 0.0)),
]
FREE = ("lift_1", "pan", "shoulder", "roll")


def _urdf():
    text = '<robot name="mimic"><link name="root"/>'
    for i, (name, kind, parent, xyz, axis, follows) in enumerate(JOINTS):
        law = ""
        if follows:
            law = '<mimic joint="{}" multiplier="{}" offset="{}"/>'.format(*follows)
        text += f'<link name="{name}">{INERTIA.format(z=0.05, m=2.0 - 0.2 * i)}</link>'
        text += (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{law}'
            '<limit lower="-2" upper="2" effort="100" velocity="2"/></joint>'
        )
    tool = '<joint name="tool" type="fixed"><parent link="level"/><child link="tool0"/>'
    return f'{text}<link name="tool0"/>{tool}<origin xyz="0.15 0 0.02"/></joint></robot>'


@pytest.fixture(scope="module", params=["differential", "car-like"])
def robot(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("mimic")
    (folder / "arm.urdf").write_text(_urdf(), encoding="utf-8")
    rest = {"lift_1": 0.1, "shoulder": 0.4, "roll": 0.5}
    mount = [{"path": "arm.urdf", "parent": "deck"}]
    content = {**on(request.param), "mount": mount, "rest": rest, "arm": {"tip": "tool0"}}
    return mm.load_robot({**content, "folder": folder})


def _on_the_constraint(robot):
    for q, z in random_states(robot, 10):
        yield robot.consistent(0.5 * q), z


def test_sizes_and_positions(robot):
    assert robot.velocity_names[robot.n_alpha :] == list(FREE)
    assert robot.n == len(FREE)
    followers = {one.joint: one for one in robot.followers}
    assert followers["level"].of == "shoulder"
    assert followers["level"].ratio == pytest.approx(0.85)
    assert followers["level"].offset == pytest.approx(-0.5 * 0.3 + 0.1)
    at = dict(zip(robot.joint_names, robot.q_rest, strict=True))
    for name, *_, follows in JOINTS:
        if follows:
            of, ratio, offset = follows
            assert at[name] == pytest.approx(ratio * at[of] + offset, abs=1e-15)


def test_the_accelerations_are_those_of_the_constrained_full_model(robot):
    """[M' A^T; A 0] [q''; -lam] = [B' v - nle; -A' q'], all joints free in M', to 1e-9."""
    plant, data = Plant(robot), robot.model.createData()
    random = np.random.default_rng(4)
    for q, z in _on_the_constraint(robot):
        torque = random.standard_normal(robot.nz)
        c, q_dot, c_dot_z = robot.velocity(q, z)
        q_ddot = c @ plant.acceleration(0.0, q, z, torque) + c_dot_z
        upper = np.triu(pin.crba(robot.model, data, q))
        nle = pin.nonLinearEffects(robot.model, data, q, q_dot)
        a, a_rate = robot.constraint_matrix(q), robot.constraint_matrix_rate(q, q_dot)
        kkt = np.block([[upper + np.triu(upper, 1).T, a.T], [a, np.zeros((robot.k, robot.k))]])
        right = np.concatenate([robot.actuation(q) @ torque - nle, -a_rate @ q_dot])
        expected = np.linalg.solve(kkt, right)[: robot.nq]
        assert relative(q_ddot, expected) < 1e-9


def test_constraints_rates_and_energy(robot):
    for q, z in _on_the_constraint(robot):
        c, q_dot, _ = robot.velocity(q, z)
        a = robot.constraint_matrix(q)
        assert np.abs(a @ c).max() < 1e-12 * np.abs(c).max()
        assert np.linalg.matrix_rank(a) == robot.k
        assert np.allclose(c.T @ robot.actuation(q), np.eye(robot.nz), atol=1e-12)
        assert np.allclose(robot.velocity_map(q), c, atol=1e-14)
        moved = derivative(lambda s, q=q, d=q_dot: robot.tip_pose(q + s * d).translation, 1e-3)
        assert relative((robot.tip_jacobian(q) @ q_dot)[:3], moved) < 1e-9
        m = robot.dynamics(q, z).M
        assert np.allclose(m, robot.reduced_inertia(q), rtol=1e-10, atol=1e-12)
        kinetic = pin.computeKineticEnergy(robot.model, robot.data, q, q_dot)
        assert 0.5 * z @ m @ z == pytest.approx(kinetic, rel=1e-11)


def test_the_extended_jacobian_is_the_rate_of_its_map(robot):
    """Along the motion q' = C z by small steps, in the gauge that is carried."""
    criterion = Posture.of(robot)
    for q, z in _on_the_constraint(robot):
        now = extended_kinematics(robot, TaskMap(), criterion, q, z)
        j_e = robot.tip_jacobian(q)[:3] @ robot.velocity_map(q)
        assert np.allclose(now.J[:3], j_e, atol=1e-12)
        complement = now.complement
        assert np.allclose(robot.constraint_matrix(q) @ complement.T, 0.0, atol=1e-12)
        h, values = 1e-5, []
        for s in (-h, h):
            middle = q + 0.5 * s * robot.velocity_map(q) @ z
            there = q + s * robot.velocity_map(middle) @ z
            other = extended_kinematics(robot, TaskMap(), criterion, there, z).complement
            u, _, vt = np.linalg.svd(complement @ other.T)
            values.append(u @ vt @ other @ criterion.gradient(there))
        rate = (values[1] - values[0]) / (2.0 * h)
        assert relative(now.J[3:] @ z, rate) < 1e-5


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_no_posture_of_the_arm_is_higher_than_the_stretched_one(robot, up):
    way = np.array([0.0, 0.0, up])
    highest = stretched(robot, robot.q_rest, way)
    assert np.allclose(robot.consistent(highest), highest, atol=1e-12)
    height = way @ robot.tip_pose(highest).translation
    random, arm = np.random.default_rng(1), robot.arm_index
    low, high = robot.limits.lower[arm], robot.limits.upper[arm]
    for _ in range(200):
        q = highest.copy()
        q[arm] = random.uniform(low, high)
        assert way @ robot.tip_pose(robot.consistent(q)).translation <= height + 1e-6
    turning = [robot.velocity_names.index(name) for name in ("pan", "shoulder", "roll")]
    row = way @ robot.tip_jacobian(highest)[:3] @ robot.velocity_map(highest)
    assert np.abs(row[turning]).max() < 1e-6


def test_a_start_off_the_coupling_is_refused(robot):
    q = robot.q_rest.copy()
    q[robot.joint_names.index("lift_2")] += 0.01
    with pytest.raises(UsageError, match=r"q0: lift_2 is .*; allowed with the other coordinates"):
        mm.simulate(robot, "tsm", "circle", duration=0.01, q0=q)


def test_a_run_keeps_the_coupling(robot):
    record = mm.simulate(robot, "tsm", "circle", duration=0.3)
    assert record.status == "ok"
    for q in record.q[::50]:
        assert np.allclose(robot.consistent(q), q, rtol=0.0, atol=1e-12)
    assert record.metrics["constraint_residual"] < 1e-12


def test_check_says_what_follows_and_what_is_cut(robot, tmp_path):
    (said,) = run_checks(robot, only=["following"])
    assert said.status == "ok"
    assert "'level' follows 'shoulder' at 0.85 of its rate" in said.found
    (tmp_path / "arm.urdf").write_text(_urdf(), encoding="utf-8")
    spec = robot.spec.model_dump(by_alias=True)
    spec["mount"][0]["lock"] = ["lift_1", "cover"]
    held = mm.load_robot({**spec, "folder": tmp_path})
    names = [one.joint for one in held.followers]
    assert names == ["elbow", "level"]  # what follows a locked joint is held where that takes it
    warned = [item for item in run_checks(held, only=["following"]) if item.status == "warning"]
    assert len(warned) == 1
    assert "'lift_2'" in warned[0].found
    assert "'cover'" not in warned[0].found
    model, full = held.model, robot.model
    assert model.nq == full.nq - 3
    tip, same = held.tip_pose(held.q_rest), robot.tip_pose(robot.q_rest)
    assert np.allclose(tip.translation, same.translation, atol=1e-12)
