"""What real files have that the format does not foresee: each kind is taken, or asked for, and said."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import threading
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from made_urdf import QUARTER, Robot, box, differential, four_wheels, mesh, write_wheel_stl

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.cli.robots import robots
from mobman.errors import SpecError, UsageError
from mobman.robots import catalogue
from mobman.robots.incoming.incoming import incoming
from mobman.robots.urdf.meshes import mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.simulation.run_spec import fingerprint


@pytest.fixture(autouse=True)
def data_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def mobman_robots():
    def call(*arguments, text=None):
        return CliRunner().invoke(robots, [str(a) for a in arguments], input=text)

    return call


@pytest.fixture
def added(mobman_robots, tmp_path):
    """A function from a made robot to its TOML's content and what was printed."""

    def call(robot, *options):
        urdf = robot.write(tmp_path / "some.urdf")
        done = mobman_robots("add", urdf, "-o", tmp_path / "some.toml", "--json", *options)
        assert done.exit_code == 0, done.exception
        return mm.load_robot(tmp_path / "some.toml"), json.loads(done.output)

    return call


def refusal(done):
    assert isinstance(done.exception, mm.MobmanError), done.output
    assert done.exception.exit_status == 2
    return str(done.exception)


# What is only for looking


@pytest.mark.parametrize(
    ("shape", "attributes"),
    [
        ("box", {"size": "0 0 0"}),
        ("box", {"size": "0.1 -0.1 0.1"}),
        ("sphere", {"radius": "0"}),
        ("cylinder", {"radius": "0.05"}),
        ("mesh", {"filename": ""}),
        ("mesh", {"filename": "a.stl", "scale": "0.001"}),
        ("mesh", {"filename": "a.stl", "scale": "1 1 1 1"}),
        ("mesh", {"filename": "a.stl", "scale": "1 1 0"}),
    ],
)
@pytest.mark.parametrize("use", ["visual", "collision"])
def test_geometry_never_stops_the_equations(tmp_path, use, shape, attributes):
    robot = differential().arm(tip="tool0")
    wanted = UrdfFile(robot.write(tmp_path / "plain.urdf"), ()).parse()
    robot.link("cam", mass=0, **{use: [(shape, attributes, (0, 0, 0))]})
    robot.joint("cam_joint", "fixed", "base_link", "cam", (0, 0, 0.2))
    file = UrdfFile(robot.write(tmp_path / "some.urdf"), ())
    found = file.parse()
    assert len(list(found.iter(use))) == len(list(wanted.iter(use)))
    (remark,) = file.remarks
    assert "'cam'" in remark
    assert "left out" in remark


def test_geometry_that_is_left_out_is_said_by_add_and_check(added):
    robot = differential().arm(tip="tool0").link("cam", visual=[box(0, 0, 0)], mass=0)
    robot.joint("cam_joint", "fixed", "base_link", "cam", (0, 0, 0.2))
    loaded, said = added(robot)
    assert any("'cam'" in warning for warning in said["warnings"])
    from mobman.checks.checks import run_checks

    (finding,) = run_checks(loaded, only=["urdf"])
    assert (finding.status, "'cam'" in finding.found) == ("warning", True)


# Limits


@pytest.mark.parametrize(
    ("lower", "upper"), [("-inf", "inf"), ("-INF", "+Infinity"), ("-.inf", ".inf")]
)
def test_infinite_range_is_continuous(added, lower, upper):
    robot = differential().arm(tip="tool0")
    joint = robot.xml.find("joint[@name='arm_6_joint']")
    joint.find("limit").attrib.update(lower=lower, upper=upper, effort="inf", velocity="-1")
    for wheel in ("wheel_left_joint", "wheel_right_joint"):
        element = robot.xml.find(f"joint[@name='{wheel}']")
        element.set("type", "revolute")
        element.append(joint.find("limit"))
    loaded, said = added(robot)
    assert set(said["wheels"]) == {"wheel_left_joint", "wheel_right_joint"}
    i, j = loaded.joint_names.index("arm_6_joint"), loaded.velocity_names.index("arm_6_joint")
    assert (loaded.limits.lower[i], loaded.limits.upper[i]) == (-math.inf, math.inf)
    assert (loaded.limits.torque[j], loaded.limits.velocity[j]) == (math.inf, math.inf)


def test_one_infinite_limit_leaves_the_other(added):
    robot = differential().arm(tip="tool0")
    robot.xml.find("joint[@name='arm_3_joint']/limit").attrib.update(lower="0.5", upper="inf")
    loaded, _ = added(robot)
    i = loaded.joint_names.index("arm_3_joint")
    assert (loaded.limits.lower[i], loaded.limits.upper[i]) == (0.5, math.inf)
    assert 0.5 <= loaded.q_rest[i] <= 0.5 + math.pi


@pytest.mark.parametrize(
    ("attribute", "value"),
    [("lower", "inf"), ("upper", "-inf"), ("effort", "-2"), ("velocity", "-inf"), ("upper", "nan")],
)
def test_other_limits_are_refused(tmp_path, attribute, value):
    robot = differential().arm(tip="tool0")
    robot.xml.find("joint[@name='arm_3_joint']/limit").set(attribute, value)
    with pytest.raises(SpecError, match=rf"arm_3_joint.*{attribute}"):
        UrdfFile(robot.write(tmp_path / "some.urdf"), ()).parse()


# Axles


@pytest.mark.parametrize("off", [0.0008, 0.0016, 0.005])
def test_rounded_angles_are_taken_as_exact_and_said(added, off):
    robot = differential("z").arm(tip="tool0")
    origin = robot.xml.find("joint[@name='wheel_left_joint']/origin")
    origin.set("rpy", f"{-QUARTER + off} 0 {off}")
    loaded, said = added(robot)
    assert loaded.spec.platform.parameters.get("heading", 0.0) == 0.0
    exact = mm.load_robot(
        {**loaded.spec.model_dump(by_alias=True), "folder": loaded.spec.folder}
    ).constraint_matrix(loaded.q_rest)
    np.testing.assert_array_equal(loaded.constraint_matrix(loaded.q_rest), exact)
    warned = [w for w in said["warnings"] if "wheel_left_joint" in w]
    assert bool(warned) == (math.hypot(off, off) > 1e-3)
    assert all(f"{1e3 * math.hypot(off, off):.3g}" in w for w in warned)


def test_axes_that_are_off_by_more_are_refused(mobman_robots, tmp_path):
    robot = differential("z").arm(tip="tool0")
    robot.xml.find("joint[@name='wheel_left_joint']/origin").set("rpy", f"{-QUARTER + 0.015} 0 0")
    done = mobman_robots("add", robot.write(tmp_path / "a.urdf"), "-o", tmp_path / "a.toml")
    assert "wheel_left_joint" in refusal(done)


@pytest.mark.parametrize(
    ("rpy", "up", "axes"), [((-QUARTER, 0, 0), "y", "z"), ((0, QUARTER, 0), "x", "y")]
)
def test_a_root_link_on_its_side(mobman_robots, tmp_path, rpy, up, axes):
    robot = differential().arm(tip="tool0")
    robot.link("root", mass=0)
    robot.joint("root_joint", "fixed", "root", "base_link", (0, 0, 0), rpy=rpy)
    urdf, toml = robot.write(tmp_path / "a.urdf"), tmp_path / "a.toml"
    question = refusal(mobman_robots("add", urdf, "-o", toml))
    assert f"lies on its side (wheel axes about {axes})" in question
    assert f"give --up {up}" in question
    assert mobman_robots("add", urdf, "-o", toml, "--up", up).exit_code == 0
    turned = mm.load_robot(toml)
    upright = differential().arm(tip="tool0").write(tmp_path / "b.urdf")
    assert mobman_robots("add", upright, "-o", tmp_path / "b.toml").exit_code == 0
    other = mm.load_robot(tmp_path / "b.toml")
    q, z = other.q_rest, np.linspace(-1.0, 1.0, other.nz)
    assert turned.joint_names == other.joint_names
    np.testing.assert_allclose(
        turned.tip_pose(q).homogeneous, other.tip_pose(q).homogeneous, atol=1e-12
    )
    np.testing.assert_allclose(turned.dynamics(q, z).bias, other.dynamics(q, z).bias, atol=1e-11)


# Sizes


@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_a_mesh_in_millimetres(mobman_robots, tmp_path, scale):
    write_wheel_stl(tmp_path / "tyre.stl", radius=100.0)
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.1), "z", visual=[mesh("tyre.stl", scale)])
    urdf = robot.arm(tip="tool0").write(tmp_path / "a.urdf")
    done = mobman_robots("add", urdf, "-o", tmp_path / "a.toml", "--json")
    if scale == 1.0:
        assert "millimetres" in refusal(done)
        assert not (tmp_path / "a.toml").exists()
    else:
        assert json.loads(done.output)["wheel_radius"] == pytest.approx(0.1, abs=1e-4)


def test_a_base_that_its_checks_call_wrong_is_not_written(mobman_robots, tmp_path):
    robot = differential().arm(tip="tool0")
    robot.link("keel", collision=[box(0.1, 0.1, 0.1)])
    robot.joint("keel_joint", "fixed", "base_link", "keel", (0, 0, -0.1))
    urdf, toml = robot.write(tmp_path / "a.urdf"), tmp_path / "a.toml"
    assert "keel" in refusal(mobman_robots("add", urdf, "-o", toml))
    assert not toml.exists()
    assert "keel" in refusal(mobman_robots("add", urdf, "-o", toml, "--force"))
    done = mobman_robots("add", urdf, "-o", toml, "--as-it-is", "--json")
    assert any("ground, wrong" in said for said in json.loads(done.output)["warnings"])
    assert re.search(r"^# WARNING: ground, wrong: .*keel", toml.read_text(), re.MULTILINE)
    assert mm.load_robot(toml).platform.wheels


# Meshes


@pytest.mark.parametrize(
    ("named", "there", "hint"),
    [
        ("meshes/wheel.stl", "meshes/Wheel.STL", "there is Wheel.STL"),
        ("Meshes/wheel.stl", "meshes/wheel.stl", "there is meshes/wheel.stl"),
        ("meshes/wheel.stl", "meshes/wheel.dae", "there is wheel.dae"),
        ("meshes/wheel.stl", "meshes/tyre.stl", ""),
        ("meshes\\wheel.stl", "meshes/wheel.stl", None),
        (".\\meshes\\sub\\wheel.stl", "meshes/sub/wheel.stl", None),
    ],
)
def test_names_of_meshes(tmp_path, named, there, hint):
    (tmp_path / there).parent.mkdir(parents=True)
    (tmp_path / there).write_bytes(b"x")
    robot = (
        Robot()
        .link("part", visual=[mesh(named)])
        .joint("j", "fixed", "base_link", "part", (0, 0, 0))
    )
    file = UrdfFile(robot.write(tmp_path / "a.urdf"), (tmp_path,))
    (found,) = mesh_paths(file.parse(), file)
    if hint is None:
        assert found.path == (tmp_path / there).resolve()
    else:
        assert found.path is None
        assert found.problem.endswith(hint) if hint else "there is" not in found.problem


# Ways in


def test_standard_input(mobman_robots, tmp_path, monkeypatch, data_home):
    text = differential().arm(tip="tool0").write(tmp_path / "a.urdf").read_bytes()
    reading, writing = os.pipe()
    os.write(writing, text)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        monkeypatch.setattr(sys, "stdin", pipe)
        given = incoming("-")
    assert given.made
    assert given.file.path.is_relative_to(data_home)
    assert given.file.path.read_bytes() == text


def test_a_pipe_and_its_copy(mobman_robots, tmp_path, data_home):
    text = differential().arm(tip="tool0").write(tmp_path / "a.urdf").read_bytes()
    os.mkfifo(tmp_path / "pipe")
    writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(text,))
    writer.start()
    done = mobman_robots("add", tmp_path / "pipe", "--name", "piped")
    writer.join()
    assert done.exit_code == 0, done.exception
    assert mm.load_robot("piped").n == 6
    assert (data_home / "mobman/robots/piped.urdf").read_bytes() == text


@pytest.mark.parametrize("address", ["http://a.b/c.urdf", "https://a.b/c", "git@a.b:c/d.git"])
def test_an_address_is_not_fetched(mobman_robots, address):
    text = refusal(mobman_robots("add", address))
    assert "not fetched; download it first" in text
    assert address in text


def test_a_folder_and_an_archive(mobman_robots, tmp_path, data_home):
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.1), "z", visual=[mesh("package://pkg/tyre.stl")])
    write_wheel_stl(tmp_path / "in/pkg/tyre.stl", radius=0.1)
    (tmp_path / "in/pkg/urdf").mkdir()
    robot.arm(tip="tool0").write(tmp_path / "in/pkg/urdf/cart.urdf")
    done = mobman_robots("add", tmp_path / "in", "-o", tmp_path / "a.toml", "--json")
    assert json.loads(done.output)["wheel_radius"] == pytest.approx(0.1, abs=1e-4)
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        for path in (tmp_path / "in").rglob("*.*"):
            archive.write(path, path.relative_to(tmp_path / "in"))
    done = mobman_robots("add", tmp_path / "all.zip", "--name", "zipped", "--json")
    assert json.loads(done.output)["wheel_radius"] == pytest.approx(0.1, abs=1e-4)
    found = mm.load_robot("zipped").urdf.files[0]
    assert all(m.path is not None for m in mesh_paths(found.parse(), found))
    (tmp_path / "in/pkg/urdf/other.urdf").write_bytes(b"<robot/>")
    text = refusal(mobman_robots("add", tmp_path / "in"))
    assert "cart.urdf" in text
    assert "other.urdf" in text


def test_an_archive_that_leads_outside_is_refused(mobman_robots, tmp_path, data_home):
    with zipfile.ZipFile(tmp_path / "bad.zip", "w") as archive:
        archive.writestr("../../../../evil.urdf", "<robot/>")
    assert "leads outside" in refusal(mobman_robots("add", tmp_path / "bad.zip"))
    assert not list(tmp_path.rglob("evil*"))


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"a.txt": 1}, "there is no URDF in the archive {}"),
        ({"a.urdf": 1, "in/b.urdf": 1}, "{} has 2 robots: name one of a.urdf, in/b.urdf, in /"),
        ({f"{i}": 1 for i in range(20_001)}, "{} has 20001 files; allowed: 20000"),
        ({"a.urdf": 2_100_000_000}, "{} unpacks to more than"),
        ({}, "cannot read the archive {}: "),
    ],
    ids=["no URDF", "two", "many files", "large", "no archive"],
)
def test_archives_that_are_no_robot_are_refused_by_their_name(
    mobman_robots, tmp_path, data_home, entries, words
):
    path = tmp_path / "some.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in entries:
            archive.writestr(name, "x")
        for entry in archive.infolist():
            entry.file_size = entries[entry.filename]  # as it states, whatever it holds
    if not entries:
        path.write_bytes(b"PK\3\4" + b"x" * 100)
    assert words.format(path) in refusal(mobman_robots("add", path))


XACRO = """<robot name="cart" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="reach" default="0.2"/>
<xacro:include filename="$(find parts)/arm.xacro"/>
<xacro:arm reach="$(arg reach)"/>
{rest}
</robot>"""


def xacro_robot(folder: Path) -> Path:
    pytest.importorskip("xacro")
    (folder / "ws/parts").mkdir(parents=True)
    plain = differential().arm(tip="tool0").write(folder / "plain.urdf").read_text()
    body = plain[plain.index("<link") : plain.index("</robot>")]
    inner = body.replace('xyz="0.1 0.0 0.0"', 'xyz="${reach/2} 0 0"')
    assert inner != body
    (folder / "ws/parts/arm.xacro").write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="arm" params="reach">'
        f"{inner}</xacro:macro></robot>"
    )
    (folder / "ws/mine").mkdir()
    path = folder / "ws/mine/cart.urdf.xacro"
    path.write_text(XACRO.format(rest=""))
    return path


def test_xacro_is_expanded(mobman_robots, tmp_path):
    path = xacro_robot(tmp_path)
    heights = {}
    for reach in (0.2, 0.6):
        toml = tmp_path / f"{reach}.toml"
        done = mobman_robots("add", path, "-o", toml, "--xacro-arg", f"reach:={reach}")
        assert done.exit_code == 0, done.exception
        assert "expanded by xacro" in done.output
        robot = mm.load_robot(toml)
        last = robot.model.frames[robot.tip_frame].placement.translation
        heights[reach] = float(np.linalg.norm(last))
        assert toml.with_suffix(".urdf").is_file()
    assert heights == pytest.approx({0.2: 0.1, 0.6: 0.3})


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        ('<link name="${[g.gi_frame.f_back for g in [(1 for _ in [1])]]}"/>', "'gi_frame'"),
        ('<link name="${().__class__}"/>', "'__class__'"),
        ('<link name="${(lambda f: f.func_globals)(str)}"/>', "'func_globals'"),
        ('<link name="$(eval [].__class__)"/>', "'__class__'"),
        ("<link name=\"$(eval ''.format)\"/>", "'format'"),
        ('<link name="$(env HOME)"/>', "HOME"),
        ('<xacro:include filename="$(find nowhere)/a.xacro"/>', "by xacro: $(find nowhere): there"),
        ('<link name="$(arg side)"/>', "--xacro-arg side:=VALUE"),
        ('<link name="${1/0}"/>', "division"),
        ('<link name="${undefined_name}"/>', "undefined_name"),
        ('<link name="$(eval 1/0)"/>', "expanded by xacro: division by zero"),
        (
            '<xacro:include filename="$(find no)/a"/>',
            "expanded by xacro: $(find no): there is no pa",
        ),
        ("<link name=\"${'a' * 10**10}\"/>", "it takes more than"),
    ],
)
def test_xacro_reaches_nothing_of_the_interpreter(mobman_robots, tmp_path, rest, words):
    path = xacro_robot(tmp_path)
    path.write_text(XACRO.format(rest=rest))
    text = refusal(mobman_robots("add", path, "-o", tmp_path / "a.toml"))
    assert words in text
    assert "cart.urdf.xacro" in text
    assert not (tmp_path / "a.toml").exists()


def test_what_is_no_xacro_takes_no_arguments(mobman_robots, tmp_path):
    urdf = differential().arm(tip="tool0").write(tmp_path / "a.urdf")
    assert "--xacro-arg" in refusal(mobman_robots("add", urdf, "--xacro-arg", "a:=1"))


def test_a_urdf_by_its_path(tmp_path, monkeypatch):
    urdf = differential().arm(tip="tool0").write(tmp_path / "some.urdf")
    with pytest.warns(UserWarning, match=r"robots add") as said:
        robot = mm.load_robot(urdf)
    assert (robot.name, robot.tip, robot.n) == ("some", "tool0", 6)
    assert "differential" in str(said[0].message)
    record = mm.simulate(robot, "pseudo-inverse", "circle", duration=0.01)
    assert record.save(tmp_path / "run.h5").is_file()
    assert mm.load_record(tmp_path / "run.h5").robot == "some"
    monkeypatch.chdir(tmp_path)
    assert catalogue.find_spec("some.urdf") == robot.spec  # said once: this warns no more


def test_a_urdf_by_its_path_that_does_not_tell_enough(tmp_path):
    urdf = differential().arm("a_", tip="a_tool").arm("b_", (0, 0.1, 0.1), tip="b_tool")
    with pytest.raises(UsageError, match=r"--tip.*robots add"):
        mm.load_robot(urdf.write(tmp_path / "some.urdf"))


# A base and an arm


def arm_alone(folder: Path) -> Path:
    robot = Robot(name="arm", root="arm_base").arm(xyz=(0, 0, 0.1), parent="arm_base", tip="tool0")
    return robot.fingers("tool0").write(folder / "arm.urdf")


def test_a_base_asks_for_an_arm_and_keeps_what_it_found(mobman_robots, tmp_path):
    base = differential().write(tmp_path / "base.urdf")
    text = refusal(mobman_robots("add", base))
    for word in ("--mount", "--on", "--prefix", "wheel_right_joint", "0.1 m", "base_link"):
        assert word in text


def test_an_arm_is_mounted(mobman_robots, tmp_path):
    base, arm = differential().write(tmp_path / "base.urdf"), arm_alone(tmp_path)
    text = refusal(mobman_robots("add", base, "--mount", arm))
    assert "--on" in text
    assert "base_link" in text
    toml = tmp_path / "both.toml"
    options = ("--mount", arm, "--on", "base_link", "--prefix", "up_")
    done = mobman_robots("add", base, *options, "-o", toml)
    assert done.exit_code == 0, done.exception
    content = tomllib.loads(toml.read_text())
    assert content["mount"][0]["lock"] == ["finger_*"]
    assert "lock" not in content["urdf"]
    robot = mm.load_robot(toml)
    assert (robot.tip, robot.n) == ("up_tool0", 6)
    assert set(content["rest"]) <= set(robot.joint_names)
    whole = mobman_robots("add", base, *options, "--name", "both")
    assert whole.exit_code == 0, whole.exception
    arm.unlink()
    base.unlink()
    assert mm.load_robot("both").n == 6


def test_an_arm_on_a_link_that_is_not_there(mobman_robots, tmp_path):
    base, arm = differential().write(tmp_path / "base.urdf"), arm_alone(tmp_path)
    text = refusal(mobman_robots("add", base, "--mount", arm, "--on", "deck"))
    assert "'deck'" in text
    assert "base_link" in text
    options = ("--on", "base_link", "--prefix", "a b")
    text = refusal(mobman_robots("add", base, "--mount", arm, *options))
    assert text.startswith(f"--mount {arm}: field 'prefix' is 'a b': ")


# The user's robots


def test_robots_are_removed_with_their_copies(mobman_robots, tmp_path, data_home):
    urdf = differential().arm(tip="tool0").write(tmp_path / "a.urdf")
    for name in ("mine", "mine.two"):
        assert mobman_robots("add", urdf, "--name", name).exit_code == 0
    assert mobman_robots("remove", "mine").exit_code == 0
    left = sorted(p.name for p in (data_home / "mobman/robots").iterdir())
    assert left == ["mine.two.toml", "mine.two.urdf"]
    assert urdf.is_file()
    none = "no robot of the name 'mine' was added by you; added: mine.two"
    for name, word in (("mine", none), ("tiago", "comes with"), ("../a", "'../a' was added")):
        assert word in refusal(mobman_robots("remove", name))
    by_hand = data_home / "mobman/robots/with space.toml"
    by_hand.write_text((data_home / "mobman/robots/mine.two.toml").read_text())
    assert mobman_robots("remove", "with space").exit_code == 0
    assert not by_hand.exists()


def test_one_broken_robot_stops_no_suite(mobman_robots, tmp_path, data_home):
    urdf = differential().arm(tip="tool0").write(tmp_path / "a.urdf")
    for name in ("sound", "broken", "lost"):
        assert mobman_robots("add", urdf, "--name", name).exit_code == 0
    folder = data_home / "mobman/robots"
    (folder / "broken.toml").write_text("schema = 1\n")
    (folder / "lost.urdf").unlink()
    assert {"sound", "broken", "lost"} <= set(mm.list_robots())
    from mobman.benchmark.expand import runs_of
    from mobman.benchmark.suite_tables import SuiteTables
    from mobman.toml_model import validate

    content = {
        "schema": 1, "name": "all", "duration": 1.0, "controllers": {"pi": {"law": "pseudo-inverse"}},
        "groups": [{"robots": ["*o*"], "tasks": ["circle"]}],
    }  # fmt: skip
    suite = validate(SuiteTables, content, "all")
    with pytest.warns(UserWarning, match="left out of the suite") as said:
        runs = runs_of(suite)
    assert len(said) == 2
    assert "sound" in {run.robot for run in runs}
    assert not {"broken", "lost"} & {run.robot for run in runs}


# Friction


def with_friction() -> Robot:
    robot = differential().arm(tip="tool0")
    for name, (damping, dry) in {"arm_2_joint": (2.0, 0.5), "wheel_left_joint": (0.3, 0.1)}.items():
        joint = robot.xml.find(f"joint[@name='{name}']")
        dynamics = joint.makeelement("dynamics", {"damping": str(damping), "friction": str(dry)})
        joint.append(dynamics)
    return robot


def test_friction_of_the_urdf_is_said(added):
    _, said = added(with_friction())
    (warning,) = (w for w in said["warnings"] if "dynamics" in w)
    assert "arm_2_joint" in warning
    assert "urdf-friction" in warning


@pytest.mark.parametrize("alpha", ["wheel-rates", "paper"])
def test_friction_of_the_urdf_brakes_its_joints(added, alpha):
    """The power that it takes is that of the joints, whatever the quasi-velocities are."""
    loaded, _ = added(with_friction())
    content = loaded.spec.model_dump(by_alias=True)
    content["platform"]["alpha"] = alpha
    robot = mm.load_robot({**content, "folder": loaded.spec.folder})
    from mobman.simulation.disturbances import UrdfFriction
    from mobman.simulation.pieces import Setting

    setting = Setting(robot, 1e-3, np.random.default_rng(0))
    resistance = UrdfFriction(velocity=0.1).start(setting)
    z = np.random.default_rng(1).standard_normal(robot.nz)
    B = robot.dynamics(robot.q_rest, z).B
    rate, torque = B.T @ z, np.zeros(robot.nz)
    resistance.entry(rate, torque)()
    q_dot = robot.velocity_map(robot.q_rest) @ z
    expected = 0.0
    for name, damping, dry in (("arm_2_joint", 2.0, 0.5), ("wheel_left_joint", 0.3, 0.1)):
        own = q_dot[robot.joint_names.index(name)]
        expected -= damping * own**2 + dry * own * math.tanh(own / 0.1)
    assert rate @ torque == pytest.approx(expected, rel=1e-12)
    assert np.all(resistance.slope >= 0.0)
    record = mm.simulate(robot, "pseudo-inverse", "circle", duration=0.02, scenario="urdf-friction")
    assert record.status == "ok"


def test_a_robot_that_states_no_friction_has_none(added):
    from mobman.simulation.disturbances import UrdfFriction
    from mobman.simulation.pieces import Setting

    loaded, said = added(differential().arm(tip="tool0"))
    assert not any("dynamics" in w for w in said["warnings"])
    assert UrdfFriction().start(Setting(loaded, 1e-3, np.random.default_rng(0))) is None


# Files that change, and copies


def test_a_file_that_changed_or_moved_is_said(mobman_robots, tmp_path, recwarn):
    urdf, toml = differential().arm(tip="tool0").write(tmp_path / "a.urdf"), tmp_path / "r.toml"
    assert mobman_robots("add", urdf, "-o", toml).exit_code == 0
    before = fingerprint(mm.load_robot(toml).spec)
    assert not [one for one in recwarn if "has changed" in str(one.message)]
    urdf.write_text(f"{urdf.read_text()}\n<!-- later -->")
    with pytest.warns(UserWarning, match=r"sha256'.*a\.urdf has changed.*robots add"):
        mm.load_robot(toml)
    toml.write_text(re.sub(r"^sha256.*\n", "", toml.read_text(), flags=re.MULTILINE))
    urdf.write_text(urdf.read_text().removesuffix("\n<!-- later -->"))
    assert fingerprint(mm.load_robot(toml).spec) == before  # which a run's identity has
    assert mobman_robots("add", urdf, "-o", toml, "--force").exit_code == 0
    urdf.rename(tmp_path / "b.urdf")
    with pytest.raises(SpecError, match="moved or removed"):
        mm.load_robot(toml)


def test_absolute_meshes_are_no_fault_of_a_copy(mobman_robots, tmp_path):
    write_wheel_stl(tmp_path / "tyre.stl", 0.1)
    robot = differential().arm(tip="tool0").link("cover", visual=[mesh("tyre.stl")])
    robot.joint("cover_joint", "fixed", "base_link", "cover", (0, 0, 0.2))
    urdf = robot.write(tmp_path / "a.urdf")
    assert mobman_robots("add", urdf, "--name", "mine").exit_code == 0
    (own,) = run_checks(mm.load_robot("mine"), only=("meshes",))
    assert own.status == "ok", own.found
    urdf.write_text(urdf.read_text().replace("tyre.stl", str(tmp_path / "tyre.stl")))
    assert mobman_robots("add", urdf, "-o", tmp_path / "r.toml").exit_code == 0
    (other,) = run_checks(mm.load_robot(tmp_path / "r.toml"), only=("meshes",))
    assert other.status == "warning"


# Facts in Python


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"wheel_radius": "0.1"}, ["wheel_radius is '0.1'", "above 0"]),
        ({"wheel_radius": -1}, ["wheel_radius is -1", "above 0"]),
        ({"wheel_radius": math.nan}, ["wheel_radius is nan", "finite"]),
        ({"heading": "a"}, ["heading is 'a'", "angle"]),
        ({"heading": 90}, ["heading is 90", "angle within a turn (rad)"]),
        ({"right_wheels": None}, ["right_wheels", "None", "a name"]),
        ({"wheels": [1]}, ["wheels is (1,)", "a name"]),
        ({"tip": 3}, ["tip is 3", "a name"]),
        ({"platform": b"x"}, ["platform is b'x'", "a name"]),
    ],
)
def test_facts_of_a_wrong_type_are_named(tmp_path, facts, words):
    with pytest.raises(UsageError) as refused:
        mm.load_robot(tmp_path / "none.urdf", **facts)
    for word in words:
        assert word in str(refused.value)


def test_modules_in_one_line_across_the_way_are_called_singular(tmp_path):
    robot = Robot()
    for side, y in (("right", -0.3), ("left", 0.3)):
        robot.link(f"{side}_fork")
        robot.joint(f"{side}_turn", "continuous", "base_link", f"{side}_fork", (0, y, 0.1))
        robot.wheel(f"{side}_wheel", (0, 0, 0), parent=f"{side}_fork")
    urdf = robot.arm(tip="tool0").write(tmp_path / "a.urdf")
    with pytest.raises(SpecError, match=r"singular at rest.*right_turn.*heading"):
        mm.load_robot(urdf, platform="swerve")
    with pytest.warns(UserWarning, match="swerve platform"):
        assert mm.load_robot(urdf, platform="swerve", heading=math.pi / 2).nz == 9


def test_an_address_is_refused_as_one():
    with pytest.raises(UsageError, match=r"https://a/b\.urdf is not fetched; download it first"):
        mm.load_robot("https://a/b.urdf")


def test_wheels_that_are_some_millimetres_off_the_ground_are_a_warning(added):
    """As far as the equations allow it: those of tracks, for instance."""
    robot = four_wheels().arm(tip="tool0")
    for side, y in (("right", -0.25), ("left", 0.25)):
        robot.xml.find(f"joint[@name='rear_{side}_wheel']/origin").set("xyz", f"-0.2 {y} 0.096")
    _, said = added(robot)
    assert any("+2.0 mm from the ground" in text for text in said["warnings"])
