"""``mobman robots add``: the file that it writes, and that it leaves nothing behind."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from click.testing import CliRunner
from made_urdf import Robot, car, differential, four_wheels, no_wheels, three_omni_wheels

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.cli.robots_add import _TYPES, add
from mobman.errors import UsageError
from mobman.files import write_new
from mobman.model.platforms.platform import platforms
from mobman.model.platforms.wheelless import Unicycle
from mobman.robots.catalogue import list_robots
from mobman.robots.incoming.describe import choose_name
from mobman.robots.incoming.licence import licence
from mobman.robots.spec import UrdfSource
from mobman.robots.urdf.read import urdf_file

TIAGO = "tiago_description/robots"


@pytest.fixture(autouse=True)
def data_home(tmp_path, monkeypatch):
    """A user's folder that is empty."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def run():
    def call(*arguments):
        return CliRunner().invoke(add, [str(argument) for argument in arguments])

    return call


def refused(result, *words):
    """The command ended as one that was asked for wrongly, in one message with the words."""
    assert isinstance(result.exception, mm.MobmanError), result.exception
    assert result.exception.exit_status == 2
    for word in words:
        assert word in str(result.exception)


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture
def urdf(tmp_path):
    return differential().arm(tip="tool0").fingers("tool0").write(tmp_path / "robot.urdf")


def test_writes_a_robot_that_can_be_loaded_and_run(run, urdf, tmp_path):
    done = run(urdf, "--name", "mine", "-o", tmp_path / "mine.toml")
    assert done.exit_code == 0, done.exception
    robot = mm.load_robot(tmp_path / "mine.toml")
    assert (robot.name, robot.tip, robot.n) == ("mine", "tool0", 6)
    assert "UNCERTAIN" not in (tmp_path / "mine.toml").read_text()
    for word in (
        "differential",
        "0.1 m",
        "0.2000 m",
        "tool0",
        "2 joints",
        "mobman robots check",
        "mobman run",
    ):
        assert word in done.output
    record = mm.simulate(robot, "tsm", "circle", duration=10.0)
    assert record.ok
    assert np.linalg.norm(record.task_error[-1000:], axis=1).max() < 1e-4


def test_comments_say_why(run, urdf, tmp_path):
    run(urdf, "-o", tmp_path / "mine.toml")
    text = (tmp_path / "mine.toml").read_text()
    assert "wheel_radius = 0.1 # collision cylinder of wheel_right_joint_link" in text
    assert "half the distance of the wheels' centres is 0.2000 m" in text
    assert '"finger_*", # fingers' in text
    content = tomllib.loads(text)
    assert "half_track" not in content["platform"]
    assert content["urdf"]["path"] == "robot.urdf"
    assert content["license"] == "not stated"


def test_json(run, urdf, tmp_path):
    done = run(urdf, "-o", tmp_path / "a.toml", "--json")
    content = json.loads(done.output)
    assert content["wheels"] == ["wheel_right_joint", "wheel_left_joint"]
    assert content["wheel_radius"] == pytest.approx(0.1)
    assert content["locked"] == ["finger_left_joint", "finger_right_joint"]


@pytest.mark.parametrize(
    ("below", "expected"),
    [(".", "robot.urdf"), ("sub/folder", "../../robot.urdf"), ("../beside_not_above", None)],
)
def test_path_is_relative_where_one_folder_is_above_the_other(run, urdf, tmp_path, below, expected):
    folder = tmp_path / below
    done = run(urdf, "-o", folder / "r.toml")
    assert done.exit_code == 0, done.exception
    content = tomllib.loads((folder / "r.toml").read_text())
    assert content["urdf"]["path"] == (expected or str(urdf.resolve()))
    mm.load_robot(folder / "r.toml")


def test_goes_to_the_users_folder_with_a_copy_of_the_urdf(run, urdf, data_home):
    done = run(urdf, "--name", "mine")
    assert done.exit_code == 0, done.exception
    (written,) = data_home.rglob("*.toml")
    assert written.name == "mine.toml"
    assert tomllib.loads(written.read_text())["urdf"]["path"] == "mine.urdf"
    assert "mobman run mine" in done.output
    urdf.unlink()
    assert mm.load_robot("mine").n == 6


def test_package_paths_are_kept(run, tmp_path):
    (tmp_path / "packages").mkdir()
    urdf = differential().arm().write(tmp_path / "robot.urdf")
    run(urdf, "--package-path", tmp_path / "packages", "-o", tmp_path / "r.toml")
    assert tomllib.loads((tmp_path / "r.toml").read_text())["urdf"]["packages"] == ["packages"]


def test_missing_meshes_are_told_with_the_option_that_finds_them(run, urdf, tmp_path):
    mesh = '<visual><geometry><mesh filename="package://body/base.stl"/></geometry></visual></link>'
    urdf.write_text(urdf.read_text().replace("</link>", mesh, 1))
    told = json.loads(run(urdf, "--json", "-o", tmp_path / "r.toml").output)["warnings"]
    (warning,) = [text for text in told if "meshes" in text]
    assert "1 of 1 meshes are missing, 'package://body/base.stl'" in warning
    assert "--package-path" in warning
    (tmp_path / "packages" / "body").mkdir(parents=True)
    (tmp_path / "packages" / "body" / "base.stl").touch()
    found = ("--package-path", tmp_path / "packages", "--json", "-o", tmp_path / "found.toml")
    assert "meshes" not in " ".join(json.loads(run(urdf, *found).output)["warnings"])


def test_licence_of_the_package(run, tmp_path):
    (tmp_path / "package.xml").write_text("<package><license>Apache 2.0</license></package>")
    (tmp_path / "urdf").mkdir()
    run(differential().arm().write(tmp_path / "urdf" / "robot.urdf"), "-o", tmp_path / "r.toml")
    assert tomllib.loads((tmp_path / "r.toml").read_text())["license"].startswith("Apache-2.0 (")


def test_names_that_toml_and_patterns_know_as_special(run, tmp_path):
    robot = Robot(name='my "robot"\n[x]')
    robot.wheel("wheel/right #1", (0, -0.2, 0.1)).wheel("wheel/left #1", (0, 0.2, 0.1))
    robot.arm("m[0]/ü", tip="m[0]/tool0")
    robot.link("f").joint('odd"[a]', "revolute", "base_link", "f", (0, 0, 0.3), limits=(0.5, 1.0))
    done = run(robot.write(tmp_path / "robot.urdf"), "-o", tmp_path / "r.toml", "--name", "r")
    assert done.exit_code == 0, done.exception
    loaded = mm.load_robot(tmp_path / "r.toml")
    assert loaded.tip == "m[0]/tool0"
    assert loaded.spec.rest['odd"[a]'] == 0.5


@pytest.mark.parametrize(
    "arguments",
    [("--platform", "omnidirectional"), (), ("--platform", "unicycle"), ("--platform", "fixed")],
)
def test_other_platforms(run, tmp_path, arguments):
    urdf = four_wheels().arm(tip="tool0").write(tmp_path / "robot.urdf")
    done = run(urdf, "-o", tmp_path / "r.toml", *arguments)
    assert done.exit_code == 0, done.exception
    robot = mm.load_robot(tmp_path / "r.toml")
    assert robot.spec.platform.type == (arguments[1] if arguments else "skid-steer")
    assert robot.n == 6


@pytest.fixture
def own_type(monkeypatch):
    """Platform types of the user's own: one that asks for what is found, one that does not."""

    class Sled(Unicycle):
        inferred = ("axle", "height")

    class Unasked(Unicycle):
        pass

    monkeypatch.setattr(platforms, "_items", {"sled": Sled, "unasked": Unasked})
    monkeypatch.delitem(vars(_TYPES), "fields", raising=False)
    yield
    vars(_TYPES).pop("fields", None)


@pytest.mark.usefixtures("own_type")
def test_a_registered_platform_type_is_offered_with_the_fields_that_it_asks_for(run, tmp_path):
    urdf = four_wheels().arm(tip="tool0").write(tmp_path / "robot.urdf")
    done = run(urdf, "-o", tmp_path / "r.toml", "--platform", "sled")
    assert done.exit_code == 0, done.exception
    given = tomllib.loads((tmp_path / "r.toml").read_text())
    assert given["platform"] == {"type": "sled", "axle": [0.2, 0.0], "height": 0.05}
    assert given["urdf"]["lock"] == ["*_wheel"]
    assert "unicycle" in run("--help").output
    assert "sled" in run("--help").output
    assert "unasked" not in run("--help").output
    assert run(urdf, "--platform", "custom").exit_code == 2


@pytest.mark.parametrize(("build", "alpha"), [(car, 2), (three_omni_wheels, 3)])
def test_platforms_that_steer_and_that_slide(run, tmp_path, build, alpha):
    urdf = build().arm(tip="tool0").write(tmp_path / "robot.urdf")
    done = run(urdf, "-o", tmp_path / "r.toml")
    assert done.exit_code == 0, done.exception
    assert mm.load_robot(tmp_path / "r.toml").nz == alpha + 6


def test_what_is_asked_for_is_in_one_line_with_status_2(tmp_path):
    urdf = no_wheels().write(tmp_path / "robot.urdf")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mobman",
            "robots",
            "add",
            str(urdf),
            "-o",
            str(tmp_path / "r.toml"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "--right-wheel" in done.stderr
    assert "Traceback" not in done.stderr
    assert files(tmp_path) == ["robot.urdf"]


def test_an_existing_file_is_kept_without_force(run, urdf, tmp_path):
    (tmp_path / "r.toml").write_text("mine")
    refused(run(urdf, "-o", tmp_path / "r.toml"), "r.toml", "--force")
    assert (tmp_path / "r.toml").read_text() == "mine"
    assert run(urdf, "-o", tmp_path / "r.toml", "--force").exit_code == 0
    assert mm.load_robot(tmp_path / "r.toml").n == 6


def test_a_name_that_comes_with_mobman_is_refused(run, urdf, data_home):
    refused(run(urdf, "--name", "tiago"), "tiago", "--name")
    refused(run(urdf, "--name", "tiago", "--force"), "tiago", "--name")
    assert not data_home.exists()


def test_a_name_that_is_registered_is_refused_without_force(run, urdf, tmp_path, monkeypatch):
    monkeypatch.setattr("mobman.robots.catalogue._registered", {"mine": None})
    refused(run(urdf, "--name", "mine"), "'mine'", "--force")
    # a file is used by its path, whatever the name in it
    assert run(urdf, "--name", "mine", "-o", tmp_path / "r.toml").exit_code == 0


def test_the_urdf_of_a_robot_that_comes_with_mobman_gets_a_name_of_its_own(run, tmp_path):
    robot = differential().arm(tip="tool0")
    robot.xml.set("name", "youbot")
    urdf = robot.write(tmp_path / "robot.urdf")
    assert run(urdf).exit_code == 0
    assert "my_youbot" in list_robots()
    refused(run(urdf), "my_youbot", "--force")
    assert run(urdf, "--force").exit_code == 0
    refused(run(urdf, "--name", "youbot"), "comes with mobman", "--name")


@pytest.mark.parametrize("name", ["", "../x", "a b", "-x"])
def test_a_name_that_cannot_be(run, urdf, name):
    refused(run(urdf, f"--name={name}"), "--name")


def test_a_robot_that_cannot_be_loaded_leaves_nothing_behind(run, tmp_path):
    robot = differential().arm(tip="tool0")
    for link in robot.xml.iter("link"):
        for inertial in link.findall("inertial"):
            link.remove(inertial)  # no mass anywhere
    urdf = robot.write(tmp_path / "robot.urdf")
    result = run(urdf, "-o", tmp_path / "deep" / "er" / "r.toml")
    refused(result, "nothing was written")
    assert ".part" not in str(result.exception)
    assert files(tmp_path) == ["robot.urdf"]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, OSError("disk full")])
def test_interrupted_it_leaves_nothing_behind(run, urdf, tmp_path, monkeypatch, stop):
    def interrupted(spec):
        raise stop

    monkeypatch.setattr("mobman.model.build.load_robot", interrupted)
    assert run(urdf, "-o", tmp_path / "new" / "r.toml").exit_code != 0
    assert files(tmp_path) == ["robot.urdf"]


@pytest.mark.parametrize(
    "content",
    ["no xml", "<robot/>", "<sdf/>", "<robot name='x'><link name='a'/><link name='b'/></robot>"],
)
def test_what_is_no_urdf_is_refused(run, tmp_path, content):
    (tmp_path / "robot.urdf").write_text(content)
    refused(run(tmp_path / "robot.urdf", "-o", tmp_path / "r.toml"), "")
    assert files(tmp_path) == ["robot.urdf"]


def test_a_file_that_is_not_there(run, tmp_path):
    refused(run(tmp_path / "none.urdf"), "there is no URDF at")


def test_macros_are_to_be_expanded_first(run, tmp_path):
    (tmp_path / "robot.urdf").write_text(
        "<robot name='x' xmlns:xacro='http://ros.org/wiki/xacro'><link name='a'/><xacro:arm/></robot>"
    )
    refused(run(tmp_path / "robot.urdf"), "xacro")


@pytest.mark.parametrize(
    ("file", "tip", "fold"),
    [
        ("tiago.urdf", "hand_palm_link", "ok"),
        ("tiago_no_hand.urdf", "arm_tool_link", "ok"),
        pytest.param("tiago_dual.urdf", "hand_right_palm_link", "warning", marks=pytest.mark.slow),
        ("tiago_dual.urdf", "hand_left_palm_link", "ok"),
    ],
)
def test_tiago_as_it_ships(run, tmp_path, file, tip, fold):
    """Where the default circle leads into an algorithmic singularity, the check says so, and that laws
    without the extended Jacobian hold."""
    urdf = urdf_file(
        UrdfSource(package="example-robot-data", path=f"{TIAGO}/{file}"), tmp_path, ""
    ).path
    done = run(urdf, "--tip", tip, "-o", tmp_path / "t.toml")
    assert done.exit_code == 0, done.exception
    robot = mm.load_robot(tmp_path / "t.toml")
    assert robot.spec.urdf.package == "example-robot-data"
    assert robot.platform.radius == pytest.approx(0.0985, abs=1e-3)
    assert robot.platform.half_track == pytest.approx(0.2022, abs=1e-3)
    assert robot.n == 8  # the torso's lift belongs to the arm
    (finding,) = run_checks(robot, only=("fold",))
    assert finding.status == fold
    record = mm.simulate(robot, "tsm", "circle", duration=10.0, dt=4e-3)
    assert record.ok == (fold == "ok")
    if not record.ok:
        record = mm.simulate(robot, "tsm-null-space", "circle", duration=10.0, dt=4e-3)
        assert record.ok
    assert np.linalg.norm(record.task_error[-250:], axis=1).max() < 1e-4


def test_licence_of_the_header_comes_before_that_of_a_folder_above(run, tmp_path):
    (tmp_path / "LICENSE").write_text("MIT License\n\nPermission is hereby granted, free of charge")
    urdf = differential().arm().write(tmp_path / "robot.urdf")
    assert run(urdf, "-o", tmp_path / "a.toml").exit_code == 0
    assert tomllib.loads((tmp_path / "a.toml").read_text())["license"].startswith("MIT")
    header = "<!-- Copyright 2020 A. Maker\n  Licensed under the Apache License, Version 2.0 -->"
    urdf.write_text(urdf.read_text().replace("<link", f"{header}<link", 1))
    assert run(urdf, "-o", tmp_path / "b.toml").exit_code == 0
    content = tomllib.loads((tmp_path / "b.toml").read_text())
    assert content["license"].startswith("Apache-2.0")
    assert "A. Maker" in content["source"]


@pytest.mark.parametrize(
    ("old", "new"), [('lower="-2.5"', 'lower="low"'), ('radius="0.1"', 'radius="wide"')]
)
def test_what_is_no_number_is_refused(run, urdf, tmp_path, old, new):
    text = urdf.read_text()
    assert old in text
    urdf.write_text(text.replace(old, new))
    refused(run(urdf, "-o", tmp_path / "r.toml"))
    assert files(tmp_path) == ["robot.urdf"]


@pytest.mark.parametrize(
    ("axis", "length"),
    [
        ("0 0 1", 0.2),
        ("0 0 -1", 0.6),
        pytest.param("0 0 -1", 0.2, marks=pytest.mark.slow),
        pytest.param("0 0 1", 0.6, marks=pytest.mark.slow),
    ],
)
def test_a_car_steers_to_where_its_arm_turns(run, tmp_path, axis, length):
    urdf = car(axis).arm(tip="tool0", length=length).write(tmp_path / "robot.urdf")
    assert run(urdf, "-o", tmp_path / "r.toml").exit_code == 0
    text = (tmp_path / "r.toml").read_text()
    assert "does not move the tip at once" in text
    couplings = tomllib.loads(text)["criterion"]["couplings"]
    weights = {coupling.pop("weight") for coupling in couplings}
    assert couplings == [
        {"joint": f"{side}_steering", "to": "arm_1_joint", "ratio": float(axis.split()[2])}
        for side in ("right", "left")
    ]
    robot = mm.load_robot(tmp_path / "r.toml")
    reach = np.linalg.norm(
        (robot.tip_pose(robot.q_rest).translation - robot.arm_origin(robot.q_rest))[:2]
    )
    (weight,) = weights
    share = weight / (weight + 0.05)
    radius, lap = 0.5, 4.0 * np.pi
    # an arm that would turn by more than 45 degrees for the circle does not go round it
    alone = reach > np.sqrt(2.0) * radius
    assert alone == (length == 0.6)
    if not alone:  # the car goes round
        assert share == pytest.approx(0.5)
        turned = 2.0 * np.pi
    else:  # the arm goes round, and a lap turns the car by 0.01 rad
        turned = 0.01
        assert share * np.pi * radius**2 / (reach * robot.platform.wheelbase) == pytest.approx(
            turned, rel=0.05
        )
    record = mm.simulate(robot, "tsm", "circle", duration=30.0, dt=4e-3)
    assert record.ok
    assert np.linalg.norm(record.task_error[-1000:], axis=1).max() < 1e-4
    heading = abs(record.q[-1, robot.joint_names.index("base_theta")])
    assert heading < 2.0 * turned * 30.0 / lap
    assert (heading > 0.5 * turned * 30.0 / lap) == (not alone)


@pytest.mark.parametrize(
    ("file", "robot", "expected"),
    [
        ("mine.urdf", "other", "mine"),
        ("robot.urdf", "other", "other"),
        ("robot_description.urdf", "other", "other"),
        ("Main.urdf", "other", "other"),
        ("___.urdf", "other", "other"),
        ("model.urdf", "", "model"),
        ("tiago.urdf", "tiago", "my_tiago"),
        ("tiago_no_hand.urdf", "tiago", "my_tiago_no_hand"),
        ("tiago_dual.urdf", "tiago", "my_tiago_dual"),
    ],
)
def test_the_name_is_that_of_the_file_unless_it_says_nothing(tmp_path, file, robot, expected):
    assert choose_name(None, None, robot or "-", tmp_path / file) == expected


@pytest.mark.parametrize("output", ["noext", "r.tml", "r.TOML"])
def test_an_output_that_does_not_end_in_toml_is_refused(run, urdf, tmp_path, output):
    refused(run(urdf, "-o", tmp_path / output), output, ".toml")
    assert files(tmp_path) == ["robot.urdf"]


@pytest.mark.parametrize("option", ["--heading", "--wheel-radius"])
@pytest.mark.parametrize("value", ["inf", "nan"])
def test_numbers_that_are_not_finite_are_refused_at_once(run, tmp_path, option, value):
    refused(run(tmp_path / "none.urdf", f"{option}={value}"), option, value, "finite")


def test_a_folder_that_cannot_be_made_is_named(run, urdf, tmp_path):
    (tmp_path / "file").write_text("")
    result = run(urdf, "-o", tmp_path / "file" / "sub" / "r.toml")
    refused(result, str(tmp_path / "file" / "sub"), "cannot be made")
    refused(run(urdf, "-o", tmp_path / "file" / "r.toml"), str(tmp_path / "file"))
    assert files(tmp_path) == ["file", "robot.urdf"]


def test_folders_made_half_way_are_taken_back(run, urdf, tmp_path):
    result = run(urdf, "-o", tmp_path / "outer" / "inner" / ("x" * 300) / "r.toml")
    refused(result, "cannot be made", "inner")
    assert files(tmp_path) == ["robot.urdf"]


def test_a_folder_that_cannot_be_written_is_named(run, urdf, tmp_path):
    result = run(urdf, "-o", tmp_path / "new" / f"{'x' * 249}.toml")
    refused(result, str(tmp_path / "new"), "nothing can be written", "name too long")
    assert files(tmp_path) == ["robot.urdf"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "licensed under the Creative Commons Attribution-NonCommercial-NoDerivs 3.0 Unported "
            "License",
            "CC-BY-NC-ND-3.0",
        ),
        ("CC BY-SA 4.0", "CC-BY-SA-4.0"),
        ("Licensed under the Apache License, Version 2.0", "Apache-2.0"),
        ("Redistribution and use in source and binary forms ... Neither the name", "BSD-3-Clause"),
        ("Redistribution and use in source and binary forms", "BSD-2-Clause"),
        ("MIT License", "MIT"),
        ("GNU GENERAL PUBLIC LICENSE Version 3, 29 June 2007", "GPL-3.0"),
        (
            "the GNU Lesser General Public License as published by the Free Software Foundation; "
            "either version 2.1 of the License, or (at your option) any later version",
            "LGPL-2.1-or-later",
        ),
        ("GPLv2", "GPL-2.0"),
        ("GNU GENERAL PUBLIC LICENSE", "GPL"),
        ("Creative Commons Zero v1.0 Universal", "CC0-1.0"),
        ("SPDX-License-Identifier: MPL-2.0", "MPL-2.0"),
    ],
)
def test_short_name_of_the_licence(urdf, text, expected):
    urdf.write_text(urdf.read_text().replace("<link", f"<!-- {text} --><link", 1))
    assert licence(urdf) == f"{expected} (says the URDF's header)"


@pytest.mark.parametrize(
    "content", ["<package><license>TODO</license></package>", "<package><license>BSD", "<package/>"]
)
def test_a_package_that_states_no_licence(urdf, content):
    """And what is above the repository says nothing of it."""
    folder = urdf.parent / "repository"
    (folder / ".git").mkdir(parents=True)
    (folder / "package.xml").write_text(content)
    (urdf.parent / "LICENSE").write_text("MIT License")
    assert licence(urdf.rename(folder / "robot.urdf")) == "not stated"


def test_several_licences_are_quoted(run, urdf, tmp_path):
    (tmp_path / "package.xml").write_text("<package><license>BSD, Apache 2.0</license></package>")
    run(urdf, "-o", tmp_path / "r.toml")
    content = tomllib.loads((tmp_path / "r.toml").read_text())
    assert content["license"].startswith("BSD, Apache 2.0 (")


def test_advice_about_options_only_where_they_can_help(run, tmp_path):
    massless = differential().arm(tip="tool0")
    for link in massless.xml.iter("link"):
        for inertial in link.findall("inertial"):
            link.remove(inertial)
    result = run(massless.write(tmp_path / "robot.urdf"), "-o", tmp_path / "r.toml")
    refused(result, "correct the URDF")
    assert "--right-wheel" not in str(result.exception)
    result = run(
        differential().arm(tip="tool0").write(tmp_path / "robot.urdf"),
        "-o", tmp_path / "r.toml", "--heading", "1.0",
    )  # fmt: skip
    refused(result, "--right-wheel", "--heading")


def without_links(*places):
    raise PermissionError(1, "Operation not permitted")


@pytest.mark.parametrize("links", [True, False])
def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr("os.link", without_links)
    write_new(tmp_path / "new" / "a.toml", "one", False, "")
    assert (tmp_path / "new" / "a.toml").read_text() == "one"
    write_new(tmp_path / "new" / "a.toml", "two", True, "")
    assert (tmp_path / "new" / "a.toml").read_text() == "two"
    assert files(tmp_path) == ["new", "new/a.toml"]


def test_a_file_that_came_up_meanwhile_is_kept(tmp_path):
    (tmp_path / "a.toml").write_text("theirs")
    with pytest.raises(UsageError, match=r"a\.toml is there already; add --force"):
        write_new(tmp_path / "a.toml", "mine", False, "")
    assert (tmp_path / "a.toml").read_text() == "theirs"
    assert files(tmp_path) == ["a.toml"]
