"""A URDF made ready for flat coordinates."""

from __future__ import annotations

import hashlib

import numpy as np
import pinocchio as pin
from support.variants import ROBOTS, description

import mobman as mm
from mobman.robots.catalogue import as_spec
from mobman.robots.spec import read_spec
from mobman.robots.urdf.compose import flat_urdf
from mobman.robots.urdf.read import UrdfFile, urdf_sources

YOUBOT = UrdfFile(ROBOTS / "youbot.urdf", ())


def _model(**placement):
    return pin.buildModelFromXML(flat_urdf(YOUBOT.parse(), "youbot.urdf", **placement))


def test_continuous_joints_become_revolute_ones_without_limits_to_speak_of():
    model = _model()
    assert model.nq == model.nv
    for wheel in ("phi_1", "phi_2"):
        index = model.joints[model.getJointId(wheel)].idx_q
        assert model.lowerPositionLimit[index] < -1e6
        assert model.upperPositionLimit[index] > 1e6


def test_limited_joints_keep_their_limits():
    model = _model()
    index = model.joints[model.getJointId("y_2")].idx_q
    assert (model.lowerPositionLimit[index], model.upperPositionLimit[index]) == (-1.5708, 1.5708)


def test_root_is_mounted_at_the_offset():
    offset = np.array([0.3, -0.2, 0.1])
    model = _model(offset=offset)
    frame = model.frames[model.getFrameId("platform")]
    assert model.names[frame.parentJoint] == "base_theta"
    assert np.allclose(frame.placement.translation, offset)


def test_heading_turns_the_root():
    """A root link whose y axis is forward has it along the platform's x axis."""
    model = _model(heading=0.5 * np.pi)
    placement = model.frames[model.getFrameId("platform")].placement
    assert np.allclose(placement.rotation @ [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])


def test_no_base_joints_where_nothing_drives():
    model = _model(base_joints=())
    assert not any(name.startswith("base_") for name in list(model.names)[1:])


def test_inertias_survive():
    """All mass that the URDF has is in the model."""
    masses = [float(mass.get("value")) for mass in YOUBOT.parse().iter("mass")]
    model = _model()
    assert np.isclose(pin.computeTotalMass(model), sum(masses))


def test_hash_is_that_of_the_files_content(youbot):
    content = (ROBOTS / "youbot.urdf").read_bytes()
    assert youbot.urdf.sha256() == hashlib.sha256(content).hexdigest()


def test_file_of_the_data_package():
    (found,) = urdf_sources(read_spec(ROBOTS / "tiago.toml")).files
    assert found.path.is_file()
    # package://example-robot-data/... and package://tiago_description/... start from these
    assert any((folder / "example-robot-data").is_dir() for folder in found.package_folders)


def test_relative_path_starts_from_the_descriptions_folder(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.urdf").write_text("<robot/>", encoding="utf-8")
    spec = as_spec(description(urdf__path="sub/a.urdf"))
    (found,) = urdf_sources(spec.model_copy(update={"folder": tmp_path})).files
    assert found == UrdfFile((tmp_path / "sub" / "a.urdf").resolve(), found.package_folders)
    assert tmp_path in found.package_folders


def test_locked_joints_stay_at_rest_and_leave_q(youbot):
    """Locking joint 3 at 0.3 gives the youBot's own inertia with that joint held there."""
    locked = mm.load_robot(description(urdf__lock=["y_3"], rest__y_3=0.3))
    assert locked.joint_names == youbot.joint_names[:-1]
    q = np.append(locked.q_rest, 0.3)
    assert np.allclose(
        locked.tip_pose(locked.q_rest).homogeneous, youbot.tip_pose(q).homogeneous, atol=1e-12
    )
    z = np.zeros(youbot.nz)
    assert np.allclose(
        locked.dynamics(locked.q_rest, z[:-1]).M, youbot.dynamics(q, z).M[:-1, :-1], atol=1e-12
    )
