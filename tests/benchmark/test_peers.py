"""The peers in the comparison of speed do what they are said to do, on the same robots."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import mobman as mm
from mobman.errors import UsageError

ROOT = Path(__file__).parents[2]


def _peer(name):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "benchmarks")
        return importlib.import_module(f"peers.{name}")


pink_ik = _peer("pink_ik")
mujoco_step = _peer("mujoco_step")


@pytest.fixture
def with_pink():
    pytest.importorskip("pink")
    pytest.importorskip(pink_ik.SOLVER)


@pytest.fixture
def mujoco():
    return pytest.importorskip("mujoco")


@pytest.fixture
def driven(differential_robot):
    """Every robot that the MuJoCo peer knows."""
    if differential_robot.followers:
        pytest.skip("has joints that follow others")
    return differential_robot


# Pink ------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("with_pink")
def test_pink_moves_the_tip_to_its_target(robot):
    tracking = pink_ik.PinkTracking(robot)
    for _ in range(100):
        tracking.move_target()
    ahead = tracking.distance
    assert ahead > 0.01
    distances = []
    for _ in range(1000):
        tracking.step()
        distances.append(tracking.distance)
    assert distances[0] < ahead
    assert distances[-1] < 1e-3 * ahead


@pytest.mark.usefixtures("with_pink")
def test_pink_follows_a_target_that_moves(robot):
    tracking = pink_ik.PinkTracking(robot)
    start = tracking.configuration.get_transform_frame_to_world(robot.tip).translation.copy()
    for _ in range(round(pink_ik.PERIOD / pink_ik.DT / 2)):
        tracking.step()
        assert tracking.distance < 1e-3
    end = tracking.configuration.get_transform_frame_to_world(robot.tip).translation
    np.testing.assert_allclose(end - start, [0.0, 0.0, -2.0 * pink_ik.RADIUS], atol=1e-3)


@pytest.mark.usefixtures("with_pink")
def test_pink_leaves_the_robot_as_it_was(robot):
    lower, upper = robot.model.lowerPositionLimit.copy(), robot.model.upperPositionLimit.copy()
    rest = robot.q_rest.copy()
    pink_ik.make_pink_step(robot)()
    np.testing.assert_array_equal(robot.model.lowerPositionLimit, lower)
    np.testing.assert_array_equal(robot.model.upperPositionLimit, upper)
    np.testing.assert_array_equal(robot.q_rest, rest)
    assert not hasattr(robot.model, "configuration_limit")


@pytest.mark.usefixtures("with_pink")
def test_pinks_solve_stays_where_it_is_and_asks_for_motion(youbot):
    tracking = pink_ik.PinkTracking(youbot)
    tracking.move_target()
    before = tracking.configuration.q.copy()
    other = tracking.snapshot()
    assert np.linalg.norm(tracking.solve()) > 0.01
    np.testing.assert_array_equal(tracking.configuration.q, before)
    tracking.step()
    np.testing.assert_array_equal(other.configuration.q, before)
    solve = pink_ik.make_pink_solve(youbot)
    for _ in range(100):
        solve()


def test_missing_pink_is_told(youbot, monkeypatch):
    monkeypatch.setitem(sys.modules, "pink", None)
    with pytest.raises(UsageError, match=r"needs pink; .* pip install 'mobman\[speed\]'"):
        pink_ik.make_pink_step(youbot)


@pytest.mark.usefixtures("with_pink")
def test_missing_solver_is_told(youbot):
    with pytest.raises(UsageError, match=r"no 'none-such' here, only: .*daqp"):
        pink_ik.make_pink_step(youbot, "none-such")


# MuJoCo ----------------------------------------------------------------------------------------


def _random_posture(robot, seed=0):
    model, q = robot.model, robot.q_rest.copy()
    lower = np.maximum(model.lowerPositionLimit, -3.0)
    upper = np.minimum(model.upperPositionLimit, 3.0)
    return q + np.random.default_rng(seed).uniform(lower - q, upper - q)


def test_mujoco_model_has_the_same_inertia(driven, mujoco):
    model, data = mujoco_step.make_mujoco_model(driven)
    own = driven.model
    assert model.body_mass.sum() == pytest.approx(pin.computeTotalMass(own), rel=1e-12)
    assert model.nv == driven.nq + 3  # z, roll and pitch beside
    dofs = mujoco_step.dof_index(driven, model)
    for seed in range(3):
        q = _random_posture(driven, seed)
        mujoco_step.set_configuration(driven, model, data, q)
        unit = np.eye(model.nv)
        inertia = np.zeros((model.nv, model.nv))
        for i in range(model.nv):
            mujoco.mj_mulM(model, data, inertia[i], unit[i])
        upper = np.triu(pin.crba(own, own.createData(), q))
        expected = upper + np.triu(upper, 1).T
        np.testing.assert_allclose(inertia[np.ix_(dofs, dofs)], expected, atol=1e-9)


def test_mujoco_model_has_the_same_gravity(driven, mujoco):
    model, data = mujoco_step.make_mujoco_model(driven)
    q = _random_posture(driven)
    mujoco_step.set_configuration(driven, model, data, q)
    dofs = np.array(mujoco_step.dof_index(driven, model))[driven.arm_index]
    expected = pin.computeGeneralizedGravity(driven.model, driven.model.createData(), q)
    np.testing.assert_allclose(data.qfrc_bias[dofs], expected[driven.arm_index], atol=1e-9)


class Driven:
    """A robot that drives for some time after its start."""

    def __init__(self, robot, mujoco, speed, turning, duration=2.0):
        self.model, self.data = mujoco_step.make_mujoco_model(robot)
        names = np.array(robot.joint_names)
        address = [self.model.joint(name).qposadr[0] for name in names[robot.platform_index[3:]]]
        arm = [self.model.joint(name).qposadr[0] for name in names[robot.arm_index]]
        self.rates = mujoco_step.drive(robot, self.model, self.data, speed, turning)
        mujoco.mj_step(self.model, self.data, 3000)
        start, heading = self.data.qpos.copy(), self._heading()
        self.tilt = self.arm_error = self.lift = 0.0
        for _ in range(round(duration / mujoco_step.DT)):
            mujoco.mj_step(self.model, self.data)
            up = self.data.body(mujoco_step.BASE).xmat[8]
            self.tilt = max(self.tilt, float(np.arccos(min(1.0, up))))
            self.lift = max(self.lift, abs(float(self.data.qpos[2])))
            error = np.abs(self.data.qpos[arm] - robot.q_rest[robot.arm_index]).max()
            self.arm_error = max(self.arm_error, float(error))
        self.rolled = self.data.qpos[address] - start[address]
        self.distance = float(np.linalg.norm(self.data.qpos[:2] - start[:2]))
        self.turned = self._heading() - heading

    def _heading(self):
        quaternion = self.data.body(mujoco_step.BASE).xquat
        return 2.0 * float(np.arctan2(quaternion[3], quaternion[0]))


def test_mujoco_robot_rolls_straight_on_its_wheels(driven, mujoco):
    run = Driven(driven, mujoco, speed=0.3, turning=0.0)
    radius = float(driven.spec.platform.parameters["wheel_radius"])
    np.testing.assert_allclose(radius * np.abs(run.rates), 0.3, rtol=1e-9)
    np.testing.assert_allclose(run.distance, 2.0 * 0.3, rtol=0.02)
    np.testing.assert_allclose(run.distance, radius * np.abs(run.rolled).mean(), rtol=0.01)
    assert run.tilt < 0.002  # rad
    assert run.lift < 0.001  # m
    assert run.arm_error < 0.01  # rad, m


def test_mujoco_robot_turns_by_its_wheels(driven, mujoco):
    run = Driven(driven, mujoco, speed=0.3, turning=0.3)
    c = driven.velocity_map(driven.q_rest)
    x, _, theta, *wheels = driven.platform_index
    by_wheels = (c[theta] @ np.linalg.pinv(c[wheels])) @ run.rolled
    np.testing.assert_allclose(run.turned, by_wheels, rtol=0.02)
    # The mass ahead of the axle resists: its acceleration v w across times its lever d is the moment.
    own = driven.model
    ahead = pin.centerOfMass(own, own.createData(), driven.q_rest)[0] - driven.q_rest[x]
    wheel = own.jointPlacements[own.getJointId(driven.joint_names[wheels[0]])].translation
    slowing = (ahead - wheel[0]) * 0.3 * mujoco_step.SPEEDING / wheel[1] ** 2
    np.testing.assert_allclose(run.turned, 2.0 * 0.3 / (1.0 + slowing), rtol=0.03)
    assert run.tilt < 0.002
    assert run.arm_error < 0.01


def test_mujoco_step_is_a_step(driven, mujoco):
    step = mujoco_step.make_mujoco_step(driven)
    model, data = step.args
    assert model.opt.timestep == mujoco_step.DT
    before, place = data.time, data.qpos[:2].copy()
    step()
    assert data.time - before == pytest.approx(mujoco_step.DT)
    assert np.linalg.norm(data.qpos[:2] - place) > 0.5 * mujoco_step.SPEED * mujoco_step.DT
    on_ground = {model.geom(contact.geom[1]).bodyid[0] for contact in data.contact}
    wheels = {model.body(driven.joint_names[i]).id for i in driven.platform_index[3:]}
    assert wheels <= on_ground
    assert all(model.geom(contact.geom[0]).name == "ground" for contact in data.contact)


def test_missing_mujoco_is_told(youbot, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(UsageError, match=r"needs mujoco; .* pip install 'mobman\[speed\]'"):
        mujoco_step.make_mujoco_step(youbot)


def test_mujoco_peer_refuses_other_platforms():
    other = SimpleNamespace(name="r", spec=SimpleNamespace(platform=SimpleNamespace(type="omni")))
    with pytest.raises(UsageError, match="'omni' platform"):
        mujoco_step.mujoco_xml(other)


def test_mujoco_peer_refuses_joints_that_follow_others():
    with pytest.raises(UsageError, match=r"joint '\w+' of robot 'stretch' follows another"):
        mujoco_step.mujoco_xml(mm.load_robot("stretch"))
