"""Files for other tools, read back by these."""

from __future__ import annotations

import copy
import csv
import json
import math
import re
import sys

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator
from support.variants import youbot_urdf, youbot_with_urdf

import mobman as mm
from mobman.bridges.export import export
from mobman.cli.main import mobman
from mobman.files import resource_folder

# of several types of platform, with and without meshes
ROBOTS = [
    "youbot",
    "tiago_no_hand",
    "kmr_iiwa",
    "hsr",
    "youbot_mecanum",
    "ranger_xarm7",
    "husky_xarm7",
]
OTHERS = sorted({path.stem for path in resource_folder("robots").glob("*.toml")} - {*ROBOTS})


@pytest.fixture(scope="module")
def record():
    """A run, one of whose numbers is none."""
    made = mm.simulate("turtlebot3_omx", "tsm", "circle", duration=0.1, scenario="saturated")
    made.auxiliary_error[7, 1] = np.nan
    return made


@pytest.fixture(scope="module")
def run(record, tmp_path_factory):
    return record.save(tmp_path_factory.mktemp("run") / "run.h5")


# CSV ---------------------------------------------------------------------------------------------


def test_csv_holds_every_number_with_its_unit(record, run, tmp_path):
    assert export(run, tmp_path / "run.csv") == ()
    with (tmp_path / "run.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert all(name.endswith("]") for name in header)
    assert {"t [s]", "torque/alpha_1 [N m or N]", "tip/position/x [m]"} <= {*header}
    own = record.to_pandas()
    assert [re.sub(r" \[[^]]*\]$", "", name) for name in header] == ["t", *own]
    numbers = np.array([[float(cell or "nan") for cell in row] for row in rows])
    assert np.array_equal(numbers, own.reset_index().to_numpy(), equal_nan=True)


# MCAP --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def messages(run, tmp_path_factory):
    """The messages of the run's file by topic: log time (ns) and content."""
    reading = pytest.importorskip("mcap.reader")
    file = tmp_path_factory.mktemp("mcap") / "run.mcap"
    assert export(run, file) == ()
    found = {}
    with file.open("rb") as stream:
        reader = reading.make_reader(stream, validate_crcs=True)
        assert {item.name: item.metadata for item in reader.iter_metadata()}["mobman"]["status"]
        for schema, channel, message in reader.iter_messages():
            content = json.loads(message.data)
            Draft202012Validator(json.loads(schema.data)).validate(content)
            told = (message.log_time, schema.name, content)
            found.setdefault(channel.topic, []).append(told)
    return found


def test_mcap_holds_every_number_at_its_time(record, messages):
    for column, (place, _) in (own := record.to_pandas()).attrs["places"].items():
        rows = messages[f"/{place}"]
        assert [time for time, *_ in rows] == [round(t * 1e9) for t in record.t]
        assert [content["t"] for *_, content in rows] == record.t.tolist()
        name = column[len(place) + 1 :] or "value"
        values = [content.get(name) for *_, content in rows]
        assert values == [x if math.isfinite(x) else None for x in own[column].tolist()]
    assert len(messages["/error/auxiliary"][7][-1]) == record.auxiliary_error.shape[1]


def test_mcap_has_frames_and_poses_of_the_robot(record, messages):
    robot = mm.load_robot("turtlebot3_omx")
    times = {round(t * 1e9): k for k, t in enumerate(record.t)}
    frames = messages["/tf"]
    assert frames[0][0] == 0
    assert frames[-1][0] == max(times)
    assert 0.03 * len(record.t) <= len(frames) <= 0.1 * len(record.t)
    for time, schema, content in frames:
        assert schema == "foxglove.FrameTransforms"
        q = record.q[times[time]]
        pin.forwardKinematics(robot.model, robot.data, q)
        for one in content["transforms"]:
            place = robot.data.oMi[robot.model.getJointId(one["child_frame_id"])]
            assert one["parent_frame_id"] == "world"
            assert one["timestamp"] == {"sec": time // 10**9, "nsec": time % 10**9}
            assert [*one["translation"].values()] == place.translation.tolist()
            x, y, z, w = one["rotation"].values()
            assert pin.Quaternion(w, x, y, z).matrix() == pytest.approx(place.rotation)
    for time, schema, content in messages["/tip/pose"]:
        assert schema == "foxglove.PoseInFrame"
        tip = robot.tip_pose(record.q[times[time]]).translation
        assert [*content["pose"]["position"].values()] == tip.tolist()
    for time, _, content in messages["/base/pose"]:
        x, y, _ = content["pose"]["position"].values()
        assert [x, y] == record.q[times[time], robot.platform_index[:2]].tolist()


def test_mcap_has_the_robots_shapes_once(messages):
    ((time, schema, content),) = messages["/scene"]
    assert (time, schema) == (0, "foxglove.SceneUpdate")
    frames = {one["child_frame_id"] for one in messages["/tf"][0][-1]["transforms"]}
    assert {one["frame_id"] for one in content["entities"]} <= frames
    triangles = [one for part in content["entities"] for one in part["triangles"]]
    assert sum(len(one["indices"]) for one in triangles) == 132
    for one in triangles:
        assert len(one["indices"]) % 3 == 0
        assert max(one["indices"]) < len(one["points"])


# MuJoCo ------------------------------------------------------------------------------------------


def _inertias(robot):
    """The bodies of a robot in MuJoCo's file, and Pinocchio's inertias of them."""
    base, virtual = robot.platform.base_joints, robot.platform.virtual_joints
    for name, inertia in list(zip(robot.model.names, robot.model.inertias, strict=True))[1:]:
        if name not in base[:-1] and name not in virtual:
            yield ("mobman/base" if name in base else name), inertia


@pytest.mark.parametrize(
    "name", [*ROBOTS, *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS)]
)
def test_mujoco_loads_the_robot_as_pinocchio_has_it(name, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    robot, file = mm.load_robot(name), tmp_path / "robot.xml"
    export(name, file)
    assert [path.name for path in tmp_path.iterdir()] == ["robot.xml"]
    assert "file=" not in file.read_text()
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("rest").id)
    mujoco.mj_forward(model, data)
    for body, inertia in _inertias(robot):
        i = model.body(body).id
        turn = pin.Quaternion(*model.body_iquat[i]).matrix()
        about = turn @ np.diag(model.body_inertia[i]) @ turn.T
        assert model.body_mass[i] == pytest.approx(inertia.mass, abs=1e-9)
        assert model.body_ipos[i] == pytest.approx(inertia.lever, abs=1e-9)
        assert about == pytest.approx(inertia.inertia, abs=1e-9)
    tip = robot.tip_pose(robot.q_rest)
    assert data.site("mobman/tip").xpos == pytest.approx(tip.translation, abs=1e-9)
    for joint, lower, upper in zip(robot.joint_names, *robot.limits[:2], strict=True):
        if joint not in robot.platform.base_joints and np.isfinite([lower, upper]).all():
            assert model.joint(joint).range == pytest.approx([lower, upper])
    motors = [model.actuator(i).name for i in range(model.nu)]
    pose = set(robot.platform.base_joints)
    acts = robot.actuation(robot.q_rest).T
    own = [robot.joint_names.index(joint) for joint in pose]
    assert motors == [
        one for one, column in zip(robot.velocity_names, acts, strict=True) if not column[own].any()
    ]
    for i, one in enumerate(motors):
        limit = robot.limits.torque[robot.velocity_names.index(one)]
        if np.isfinite(limit):
            assert model.actuator_ctrlrange[i] == pytest.approx([-limit, limit])


def test_motors_of_the_file_push_as_the_model_says(tmp_path, monkeypatch):
    """On the free arm of a fixed robot: M^-1 (v - bias) is MuJoCo's acceleration."""
    mujoco = pytest.importorskip("mujoco")
    robot = mm.load_robot("fixed_panda")
    monkeypatch.setattr("mobman.bridges.export.robot_parts", lambda _: ([], []))  # for speed
    export(robot, tmp_path / "robot.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    q, z, v = robot.q_rest + 0.05, random.normal(size=robot.nz), random.normal(size=robot.nz)
    for i, joint in enumerate(robot.joint_names):
        data.qpos[model.joint(joint).qposadr[0]] = q[i]
        data.qvel[model.joint(joint).dofadr[0]] = z[i]
    data.ctrl[:] = v
    mujoco.mj_forward(model, data)
    M, bias, B = robot.dynamics(q, z)
    expected = np.linalg.solve(M, B @ v - bias)
    found = [data.qacc[model.joint(joint).dofadr[0]] for joint in robot.joint_names]
    assert found == pytest.approx(expected, rel=1e-8)


def test_a_robot_on_the_ground_stays_up(tmp_path):
    """The tyres of the file carry the robot: it sinks by no more than they may."""
    mujoco = pytest.importorskip("mujoco")
    export("husky_xarm7", tmp_path / "robot.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(300):
        mujoco.mj_step(model, data)
    height = data.body("mobman/base").xpos[2]
    assert -2e-3 < height < 1e-4


def test_what_xml_cannot_say_is_said():
    from mobman.bridges.export import mjcf_content

    _, remarks = mjcf_content(mm.load_robot("youbot_mecanum"))
    assert any("wheel_joint_fl" in one and "rollers" in one for one in remarks)
    _, remarks = mjcf_content(mm.load_robot("kmr_iiwa"))
    assert any("v_x has no motor" in one for one in remarks)


# What is refused ---------------------------------------------------------------------------------


def test_command_writes_and_replaces_nothing_without_force(run, tmp_path):
    words = ["export", str(run), "-o", str(tmp_path / "run.csv"), "--json"]
    done = CliRunner().invoke(mobman, words)
    size = (tmp_path / "run.csv").stat().st_size
    assert json.loads(done.stdout) == {"file": words[3], "bytes": size}
    (tmp_path / "run.csv").write_text("mine")
    done = CliRunner().invoke(mobman, words)
    assert "is there already" in str(done.exception)
    assert (tmp_path / "run.csv").read_text() == "mine"
    CliRunner().invoke(mobman, [*words, "--force"])
    assert (tmp_path / "run.csv").stat().st_size == size
    done = CliRunner().invoke(mobman, ["export", "youbot", "-o", str(tmp_path / "robot.urdf")])
    assert "does not end in .csv or .mcap or .xml" in str(done.exception)


def test_an_inertia_of_no_body_is_made_one_and_said(tmp_path):
    text = youbot_urdf().replace('ixx="0.0016" iyy="0.0118"', 'ixx="0.0016" iyy="0.9"')
    assert text != youbot_urdf()
    (remark,) = export(mm.load_robot(youbot_with_urdf(tmp_path, text)), tmp_path / "robot.xml")
    assert remark == "the inertia of y_3 is that of no body; two moments are larger"


@pytest.mark.parametrize(
    ("what", "file", "message"),
    [
        ("youbot", "robot.csv", "no record"),
        ("youbot", "robot.mcap", "no record"),
        ("yuobot", "robot.xml", "did you mean 'youbot'"),
        ("run.h5", "run.csv", "there is no record run.h5"),
        ("youbot", "robot.urdf", "allowed: .csv, .mcap, .xml"),
    ],
)
def test_what_cannot_be_exported_is_refused(what, file, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(mm.MobmanError, match=re.escape(message)):
        export(what, file)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("library", "suffix"), [("mcap.writer", "mcap"), ("mujoco", "xml")])
def test_a_library_that_is_missing_is_named(library, suffix, run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(mm.MobmanError, match=re.escape(f"pip install 'mobman[{library[:4]}")):
        export(run, tmp_path / f"run.{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_a_record_whose_robot_is_code_is_exported_without_it(record, tmp_path):
    pytest.importorskip("mcap")
    unknown = copy.copy(record)
    unknown.spec = {**record.spec, "robot": {"name": "gone"}}
    (remark,) = export(unknown, tmp_path / "run.mcap")
    assert remark.startswith("the robot is left out: ")
    with pytest.raises(mm.MobmanError, match="there is no robot to write"):
        export(unknown, tmp_path / "run.xml")
