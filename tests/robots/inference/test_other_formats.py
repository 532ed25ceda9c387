"""A model of Pinocchio and an MJCF file become the robots that they are."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from made_urdf import differential

import mobman as mm
from mobman.cli.main import mobman
from mobman.cli.robots import robots
from mobman.errors import SpecError, UsageError
from mobman.robots.incoming.incoming import incoming
from mobman.robots.incoming.models import urdf_of_model

WHEELS = {"right_wheels": "wheel_right_joint", "left_wheels": ["wheel_left_joint"]}


@pytest.fixture(autouse=True)
def data_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))


@pytest.mark.parametrize("free_flyer", [False, True])
def test_a_model_of_pinocchio(tmp_path, free_flyer):
    made = differential().arm(tip="tool0")
    made.xml.find("joint[@name='arm_4_joint']/axis").set("xyz", "0.6 0.8 0")  # unaligned
    urdf = str(made.write(tmp_path / "cart.urdf"))
    base = (pin.JointModelFreeFlyer(),) if free_flyer else ()
    model = pin.buildModelFromUrdf(urdf, *base)
    with pytest.raises(UsageError, match=r"^the model 'made': .*--wheel-radius"):
        mm.load_robot(model)
    with pytest.warns(UserWarning, match=r"^the model 'made' is taken as .*robots add"):
        robot = mm.load_robot(model, tip="tool0", wheel_radius=0.1, **WHEELS)
    with pytest.warns(UserWarning, match="robots add"):
        same = mm.load_robot(urdf)
    assert robot.tip == "tool0"
    assert robot.joint_names == same.joint_names
    q, z = same.q_rest, np.linspace(-1.0, 1.0, same.nz)
    np.testing.assert_allclose(
        robot.tip_pose(q).homogeneous, same.tip_pose(q).homogeneous, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(robot.dynamics(q, z).M, same.dynamics(q, z).M, atol=1e-10)
    np.testing.assert_allclose(robot.dynamics(q, z).bias, same.dynamics(q, z).bias, atol=1e-10)
    np.testing.assert_allclose(robot.limits.lower, same.limits.lower)
    np.testing.assert_allclose(robot.limits.torque, same.limits.torque)


@pytest.mark.parametrize(
    "command",
    [
        ("run", "cart.urdf", "--duration", "0.01"),
        ("view", "cart.urdf", "--html", "cart.html"),
        ("robots", "show", "cart.urdf"),
        ("robots", "check", "cart.urdf", "--no-simulation"),
        ("robots", "bounds", "cart.urdf"),
    ],
    ids=" ".join,
)
def test_help_says_which_commands_take_a_urdf(tmp_path, monkeypatch, command):
    differential().arm(tip="tool0").write(tmp_path / "cart.urdf")
    monkeypatch.chdir(tmp_path)
    with pytest.warns(UserWarning, match="cart.urdf is taken as robot"):
        done = CliRunner().invoke(mobman, command)
    assert done.exit_code == 0, done.output
    words = command[: command.index("cart.urdf")]
    assert "URDF)" in CliRunner().invoke(mobman, [*words, "--help"]).output


def test_a_model_with_other_joints_is_refused():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "a")
    model.addJoint(joint, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    with pytest.raises(SpecError, match=r"'ball'.*Spherical"):
        urdf_of_model(model)


def test_facts_are_for_urdfs():
    with pytest.raises(UsageError, match="only for a URDF"):
        mm.load_robot("youbot", tip="tip")
    with pytest.raises(UsageError, match="'tipp' is no fact"):
        mm.load_robot("some.urdf", tipp="tool0")


MJCF = """<mujoco model="cart"><compiler angle="radian"/><worldbody>
<geom name="floor" type="plane" size="5 5 0.1"/>
<body name="base" pos="0 0 0.1"><freejoint/>
  <inertial pos="0 0 0.05" mass="20" diaginertia="0.4 0.5 0.6"/>
  <geom name="hull" type="capsule" size="0.05 0.2" pos="0 0 0.3"/>
  <body name="wr" pos="0 -0.2 0"><joint name="right_wheel" axis="0 1 0" frictionloss="0.1"/>
    <geom type="cylinder" size="0.1 0.02" mass="1" euler="1.5707963267948966 0 0"/></body>
  <body name="wl" pos="0 0.2 0"><joint name="left_wheel" axis="0 1 0" armature="0.01"/>
    <geom type="cylinder" size="0.1 0.02" mass="1" euler="1.5707963267948966 0 0"/></body>
  <body name="shoulder" pos="0.1 0 0.2" quat="0.9238795325112867 0 0 0.3826834323650898">
    <joint name="yaw" axis="0 0 1" pos="0.01 0.02 0" range="-2 2" limited="true"/>
    <joint name="pitch" axis="0 1 0" pos="0 0 0.03" range="-1 1.5" limited="true"/>
    <geom type="box" size="0.03 0.03 0.1" pos="0 0 0.1" mass="2"/>
    <body name="fore" pos="0 0 0.25">
      <joint name="elbow" axis="0 1 0" ref="0.3" range="-1.2 1.8" limited="true"/>
      <geom type="mesh" mesh="wedge" mass="1"/>
      <body name="hand" pos="0.1 0 0.2" euler="0.2 0.1 -0.3">
        <joint name="wrist" type="slide" axis="0.6 0 0.8" range="0 0.2" limited="true"/>
        <geom type="sphere" size="0.03" mass="0.5"/><site name="tool" pos="0.02 0.03 0.05"/>
      </body></body></body>
</body></worldbody>
<asset><mesh name="wedge" vertex="0 0 0 0.1 0 0 0 0.1 0 0 0 0.2"/></asset>
<actuator><motor joint="yaw" gear="5" ctrlrange="-2 2" ctrllimited="true"/></actuator></mujoco>"""


def test_an_mjcf_file(tmp_path):
    """The kinematics and the inertia are MuJoCo's own, at random states."""
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "cart.xml"
    path.write_text(MJCF)
    done = CliRunner().invoke(robots, ["add", str(path), "-o", str(tmp_path / "c.toml"), "--json"])
    assert done.exit_code == 0, done.exception
    said = json.loads(done.output)
    assert set(said["wheels"]) == {"right_wheel", "left_wheel"}
    assert said["tip"] == "tool"
    for word in ("free joint", "armature", "left_wheel", "dynamics", "right_wheel"):
        assert any(word in warning for warning in said["warnings"]), word
    robot = mm.load_robot(tmp_path / "c.toml")
    assert robot.limits.torque[robot.velocity_names.index("yaw")] == pytest.approx(10.0)
    elbow = robot.joint_names.index("elbow")
    assert robot.limits.lower[elbow] == pytest.approx(-1.5)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    names = ["right_wheel", "left_wheel", "yaw", "pitch", "elbow", "wrist"]
    for _ in range(5):
        q = np.zeros(robot.nq)
        data.qpos[:] = model.qpos0
        for name in names:
            turned = float(random.uniform(-1.0, 1.0))
            q[robot.joint_names.index(name)] = turned
            data.qpos[model.jnt_qposadr[model.joint(name).id]] += turned
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(
            robot.tip_pose(q).translation, data.site("tool").xpos, rtol=0, atol=1e-9
        )
        mass = np.zeros((model.nv, model.nv))
        if hasattr(data, "qM"):
            mujoco.mj_fullM(model, mass, data.qM)
        else:
            mujoco.mj_fullM(model, data, mass)
        dofs = [int(model.jnt_dofadr[model.joint(name).id]) for name in names]
        own = [robot.joint_names.index(name) for name in names]
        found = pin.crba(robot.model, robot.model.createData(), q)
        found = np.triu(found) + np.triu(found, 1).T
        armature = np.diag(model.dof_armature[dofs])
        np.testing.assert_allclose(
            found[np.ix_(own, own)], mass[np.ix_(dofs, dofs)] - armature, rtol=0, atol=1e-9
        )
    file = incoming(path).file
    assert (file.path.parent / "meshes/0_wedge.stl").stat().st_size == 84 + 4 * 50
    assert len(list(file.parse().iter("sphere"))) == 3  # two ends of a capsule, one of the hand


ONE = '<body name="{0}"><joint name="j{0}"/><geom size="1"/></body>'
COUPLED = (
    '<body name="a"><joint type="ball"/><geom size="1"/><body><joint name="j" stiffness="1"/>'
    '<geom type="ellipsoid" size="1 1 2"/></body></body></worldbody><equality><joint joint1="j" '
    'polycoef="0 1 0 0 0"/></equality><tendon><fixed><joint joint="j" coef="1"/></fixed></tendon>'
    "<worldbody>"
)


@pytest.mark.parametrize(
    ("bodies", "words"),
    [
        ('<body><joint type="screw"/></body>', "invalid keyword"),
        ("", r"it has 0 robots \(no body has a hinge or a slide\); allowed: one"),
        (ONE.format("a") + ONE.format("b"), r"it has 2 robots \(a, b\); allowed: one"),
    ],
)
def test_an_mjcf_file_that_is_wrong(tmp_path, bodies, words):
    pytest.importorskip("mujoco")
    path = tmp_path / "bad.xml"
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    with pytest.raises(SpecError, match=rf"bad.xml cannot be taken: .*{words}"):
        incoming(path)


def test_what_an_mjcf_file_has_more_than_a_urdf_is_said(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "m.xml").write_text(f"<mujoco><worldbody>{COUPLED}</worldbody></mujoco>")
    said = "; ".join(incoming(tmp_path / "m.xml").said)
    for what in ("ball joint", "spring: j", "ellipsoid", "curve: equality0", "tendons: 1 are left"):
        assert what in said


def test_motors_hold_the_rest_posture_where_they_can(tmp_path):
    """With weak motors the arm rests nearer to where it hangs or stands."""
    held = {}
    for effort in (1000.0, 30.0):
        made = differential().arm(tip="tool0")
        for limit in made.xml.iter("limit"):
            limit.set("effort", str(effort))
        with pytest.warns(UserWarning, match="robots add"):
            robot = mm.load_robot(made.write(tmp_path / f"r{effort:.0f}.urdf"))
        data = robot.model.createData()
        torque = np.abs(pin.computeGeneralizedGravity(robot.model, data, robot.q_rest))
        held[effort] = float(torque[robot.arm_index].max())
    assert held[30.0] <= 0.75 * 30.0
    assert held[30.0] < held[1000.0]
