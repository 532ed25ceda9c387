"""A link may have the name of a joint: in a URDF they are separate name spaces."""

from __future__ import annotations

import json
import pickle
import re
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from made_urdf import Robot, box, differential

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.cli.robots_add import add
from mobman.model.build import load_geometry
from mobman.simulation.rerun import verify
from mobman.viewer.view import View, make_scene

PLATFORM = {"type": "differential", "wheel_radius": 0.1}
PLATFORM |= {"right_wheel": "wheel_right_joint", "left_wheel": "wheel_left_joint"}


def rename(name: str) -> str:
    """One name for a joint and its link: of the wheels, of the arm, of the (fixed) tool."""
    return re.sub(r"_(joint_link|joint|link|fixed)$", "", name)


def shared(robot: Robot, rename=rename) -> Robot:
    for element in robot.xml.iter():
        for attribute in ("link", "joint", "name"):
            if attribute in element.attrib and element is not robot.xml:
                element.set(attribute, rename(element.get(attribute)))
    return robot


def made() -> Robot:
    robot = differential().arm(tip="tool0")
    for link in robot.xml.findall("link")[1:]:
        shape = ET.SubElement(ET.SubElement(link, "visual"), "geometry")
        ET.SubElement(shape, "box", size="0.05 0.05 0.1")
    return robot


@pytest.fixture(scope="module", params=["tool0", "arm_6"])
def tip(request):
    """Links at the end of a fixed and of a moving joint of their name."""
    return request.param


@pytest.fixture(scope="module")
def both(tip, tmp_path_factory):
    """The robot twice, added from URDFs with names of their own and with shared names."""
    robots, folder = [], tmp_path_factory.mktemp("both")
    for name, urdf, end in (
        ("apart", made(), tip.replace("arm_6", "arm_6_link")),
        ("shared", shared(made()), tip),
    ):
        file = urdf.write(folder / f"{name}.urdf")
        toml = folder / f"{name}.toml"
        done = CliRunner().invoke(add, [str(file), "--tip", end, "-o", str(toml), "--json"])
        assert done.exit_code == 0, done.exception
        robots.append((mm.load_robot(toml), json.loads(done.stdout)))
    return robots


def test_add_infers_the_same(both):
    (_, apart), (_, found) = both
    for key in ("platform", "wheel_radius", "half_track", "nq", "nz", "uncertain"):
        assert found[key] == apart[key]
    for key in ("wheels", "arm_joints", "locked"):
        assert found[key] == [rename(name) for name in apart[key]]
    assert found["rest"] == {rename(name): value for name, value in apart["rest"].items()}


def test_check_finds_the_same(both):
    (apart, _), (robot, _) = both
    found = run_checks(robot)
    assert {one.check: one.status for one in found} == {
        one.check: one.status for one in run_checks(apart)
    }
    assert not [one for one in found if one.status == "wrong"]


def test_run_is_the_same(both, tip, tmp_path):
    (apart, _), (robot, _) = both
    assert robot.joint_names == [rename(name) for name in apart.joint_names]
    assert robot.tip == tip
    record = mm.simulate(robot, "tsm", "circle", duration=0.02)
    expected = mm.simulate(apart, "tsm", "circle", duration=0.02)
    assert record.ok
    assert np.array_equal(record.q, expected.q)
    assert verify(record.save(tmp_path / "run.h5")).identical


def test_view_draws_the_same(both, tmp_path):
    (apart, _), (robot, _) = both
    scenes = [make_scene(one) for one in (apart, robot)]
    old, new = (scene.content["robots"][0] for scene in scenes)
    for what in ("frames", "joints", "tip"):
        assert json.dumps(new[what]) == re.sub(
            r'"name": "([^"]*)"', lambda m: f'"name": "{rename(m[1])}"', json.dumps(old[what])
        )
    assert [part["joint"] for part in new["parts"]] == [part["joint"] for part in old["parts"]]
    with View(scenes[1]) as shown:
        assert shown.save(tmp_path / "robot.html").stat().st_size > 0
    record = mm.simulate(robot, "tsm", "circle", duration=0.01)
    assert make_scene(record).content


def test_frames_and_shapes_have_the_names_of_their_links(both):
    (apart, _), (robot, _) = both
    again = pickle.loads(pickle.dumps(robot))
    for model in (robot.model, again.model, robot.model.copy()):
        assert [frame.name for frame in model.frames] == [
            rename(frame.name) for frame in apart.model.frames
        ]
    geometry, expected = load_geometry(robot), load_geometry(apart)
    for kind in ("visual", "collision"):
        shapes = getattr(geometry, kind).geometryObjects
        others = getattr(expected, kind).geometryObjects
        assert [one.name for one in shapes] == [
            f"{rename(one.name.rpartition('_')[0])}_{one.name.rpartition('_')[2]}" for one in others
        ]
        assert [one.parentJoint for one in shapes] == [one.parentJoint for one in others]


@pytest.mark.parametrize("taken", ["base_x", "base_theta", "universe"])
def test_links_with_names_that_joints_have_by_mobman_or_pinocchio(taken, tmp_path):
    urdf = shared(made(), lambda name: taken if name == "base_link" else name)
    robot = load(urdf.write(tmp_path / "robot.urdf"))
    assert robot.model.existFrame(taken, pin.FrameType.BODY)
    assert mm.simulate(robot, "tsm", "circle", duration=0.01).ok
    assert make_scene(robot).content


def load(urdf, tip="tool0", **fields):
    return mm.load_robot(
        {
            "schema": 1,
            "name": "made",
            "urdf": {"path": str(urdf)},
            "platform": PLATFORM,
            "arm": {"tip": tip},
            **fields,
        }
    )


@pytest.mark.parametrize("link", ["left_arm_1_joint", "left_tool0_fixed"])
def test_platforms_link_with_the_name_of_a_mounted_joint(link, tmp_path):
    platform = differential().link(link).joint("plate", "fixed", "base_link", link, (0, 0, 0.2))
    check_mounted(platform, link, tmp_path)


@pytest.mark.parametrize("joint", ["left_arm_3_link", "left_tool0"])
def test_platforms_joint_with_the_name_of_a_mounted_link(joint, tmp_path):
    platform = differential().link("plate").joint(joint, "fixed", "base_link", "plate", (0, 0, 0.2))
    check_mounted(platform, "plate", tmp_path)


def check_mounted(platform, parent, folder):
    """An arm mounted under names that collide moves as under names that do not."""
    base = platform.write(folder / "platform.urdf")
    arm = (
        Robot(name="arm", root="stand").arm(parent="stand", tip="tool0").write(folder / "arm.urdf")
    )
    robot, expected = (
        load(
            base,
            f"{prefix}tool0",
            mount=[{"path": str(arm), "prefix": prefix, "parent": parent}],
            rest={f"{prefix}arm_2_joint": -0.6, f"{prefix}arm_3_joint": 0.7},
        )
        for prefix in ("left_", "other_")
    )
    q = np.random.default_rng(1).uniform(-1.0, 1.0, robot.nq)
    z = np.ones(robot.nz)
    assert robot.tip_pose(q) == expected.tip_pose(q)
    assert np.array_equal(robot.dynamics(q, z).bias, expected.dynamics(q, z).bias)
    assert mm.simulate(robot, "tsm", "circle", duration=0.01).ok
    assert not [one for one in run_checks(robot, simulation=False) if one.status == "wrong"]
    assert make_scene(robot).content


def test_two_links_of_one_name_are_refused_as_before(tmp_path):
    urdf = made().link("arm_1_link", collision=[box(0.1, 0.1, 0.1)])
    with pytest.raises(mm.MobmanError, match="arm_1_link"):
        load(urdf.write(tmp_path / "robot.urdf"))
