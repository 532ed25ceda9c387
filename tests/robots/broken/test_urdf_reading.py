"""What reading a URDF puts up with, and that whatever it lets pass is clear to Pinocchio as well."""

from __future__ import annotations

import codecs
import copy
import errno
import locale
import os
import random
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from good_robot import URDF, GoodRobot

import mobman as mm
from mobman.errors import SpecError
from mobman.files import read_input
from mobman.robots.urdf.compose import flat_urdf
from mobman.robots.urdf.read import UrdfFile


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "a.urdf"
    path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
    return path


def read_urdf(path: Path) -> ET.Element:
    return UrdfFile(path, ()).parse()


def read(path: Path) -> tuple[ET.Element | None, str]:
    """The robot, or why there is none."""
    try:
        return read_urdf(path), ""
    except SpecError as error:
        return None, str(error)


def model_of(robot: ET.Element) -> pin.Model:
    """The model of a URDF without meshes' geometry, after its shapes were looked at."""
    xml = flat_urdf(copy.deepcopy(robot), "a.urdf")
    model = pin.buildModelFromXML(xml)
    for mesh in robot.iter("mesh"):
        mesh.tag, mesh.attrib = "box", {"size": "1 1 1"}
    xml = flat_urdf(robot, "a.urdf")
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        pin.buildGeomFromUrdfString(model, xml, kind)
    return model


def joint(name: str, robot: ET.Element) -> ET.Element:
    return next(found for found in robot.findall("joint") if found.get("name") == name)


# What is no mistake


ENCODED = {
    "UTF-8 with a mark": codecs.BOM_UTF8 + URDF.encode("utf-8"),
    "UTF-16": URDF.encode("utf-16"),
    "Latin-1, declared": URDF.replace("?>", ' encoding="ISO-8859-1"?>', 1)
    .replace("elbow", "ellbögen")
    .encode("latin-1"),
    "GBK, declared": URDF.replace("?>", ' encoding="GBK"?>', 1)
    .replace("elbow", "肘")
    .encode("gbk"),
    "blank lines first": ("\n\n  " + URDF).encode("utf-8"),
    "lines of another system": URDF.replace("\n", "\r\n").encode("utf-8"),
}


@pytest.mark.parametrize("how", ENCODED)
def test_encodings_and_line_ends_do_not_matter(tmp_path, how):
    robot = read_urdf(written(tmp_path, ENCODED[how]))
    assert len(robot.findall("joint")) == URDF.count("<joint name=") - 1  # one is a transmission's
    assert model_of(robot).njoints == 11


def test_elements_that_urdfs_do_not_know_are_kept_and_not_looked_at(tmp_path):
    robot = read_urdf(written(tmp_path, URDF))
    assert robot.find("gazebo/sensor:camera", {"sensor": "sensor"}) is None
    assert [part.tag for part in robot.find("gazebo")] == ["sensor:camera"]
    assert robot.find("transmission/joint").get("name") == "elbow"
    inner = '<gazebo><link name="base_link"/><mass value="${x}"/></gazebo><inertial/>'
    assert read_urdf(written(tmp_path, URDF.replace("</robot>", inner + "</robot>")))


def test_leftovers_of_xacro_without_effect_do_not_matter(tmp_path):
    text = URDF.replace(
        '<robot name="cart">',
        '<robot name="cart" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<!-- <xacro:include filename="a"/> ${x} --><xacro:sensor_of_nobody name="imu"/>',
    )
    assert model_of(read_urdf(written(tmp_path, text))).njoints == 11


def test_axes_are_unit_vectors(tmp_path):
    text = URDF.replace('<axis xyz="0 0 1"/>', '<axis xyz="0  0 -2.5"/>', 1)
    text = text.replace('<axis xyz="0 -1 0"/>', '<axis xyz="1e200 1e200 0"/>')
    robot = read_urdf(written(tmp_path, text))
    assert joint("lift", robot).find("axis").get("xyz") == "0.0 0.0 -1.0"
    tilted = np.array(
        joint("right_finger_joint", robot).find("axis").get("xyz").split(), dtype=float
    )
    assert np.allclose(tilted, [0.5**0.5, 0.5**0.5, 0.0], rtol=0, atol=1e-15)
    assert joint("elbow", robot).find("axis").get("xyz") == "0 1 0"  # as it is written


def test_what_is_not_said_of_limits_stands_for_not_known(tmp_path):
    text = URDF.replace('<limit effort="12" velocity="20"/>', '<limit lower="-1" effort="12"/>', 1)
    text = text.replace('upper="2" effort="40" velocity="2"', 'upper="2"')
    robot = read_urdf(written(tmp_path, text))
    assert joint("right_wheel_joint", robot).find("limit").attrib == {
        "effort": "12",
        "velocity": "0",
    }
    assert joint("elbow", robot).find("limit").get("effort") == "0"
    assert model_of(robot).njoints == 11


def test_a_fixed_joint_may_have_what_only_moving_ones_need(tmp_path, capfd):
    text = URDF.replace(
        '<child link="tool"/>',
        '<child link="tool"/><axis xyz="0 0 0"/><limit upper="nan"/><mimic joint="nobody"/><dynamics/>',
    )
    robot = read_urdf(written(tmp_path, text))
    assert {part.tag for part in joint("tool_joint", robot)} == {"parent", "child", "origin"}
    model_of(robot)
    assert capfd.readouterr() == ("", "")


HARMLESS = {
    "no name of the robot": ('<robot name="cart">', "<robot>"),
    "a version": ('<robot name="cart">', '<robot name="cart" version="1">'),
    "a colour of three numbers": ('rgba="0.5 0.5 0.5 1"', 'rgba="0.5 0.5 0.5"'),
    "a colour from 0 to 255": ('rgba="0.5 0.5 0.5 1"', 'rgba="128 128 128 255"'),
    "a colour that was not defined": ('<material name="grey"/>', '<material name="blue"/>'),
    "a colour without a name": (
        '<material name="grey"/>',
        '<material><color rgba="1 0 0 1"/></material>',
    ),
    "two colours of one name": (
        '<link name="base_link">',
        '<material name="grey"><color rgba="0 0 0 1"/></material><link name="base_link">',
    ),
    "a colour that is none": (
        '<link name="base_link">',
        '<material name="x"/><link name="base_link">',
    ),
    "a capsule": ('<sphere radius="0.05"/>', '<capsule radius="0.05" length="1"/>'),
    "no shape": ('<geometry><sphere radius="0.05"/></geometry>', ""),
    "an empty geometry": ('<sphere radius="0.05"/>', ""),
    "empty dynamics": ('<dynamics damping="10" friction="1"/>', "<dynamics/>"),
    "a safety controller": (
        '<dynamics damping="10" friction="1"/>',
        '<safety_controller soft_lower_limit="a"/><calibration rising="b"/>',
    ),
    "spaces around a number": ('<mass value="30"/>', '<mass value=" 30 "/>'),
    "numbers of all kinds": ('xyz="0.1 0 0.25"', 'xyz="+1.e-1 -.0 25E-02"'),
    "lines in a vector": ('xyz="0.1 0 0.25"', 'xyz="0.1\n&#9;0\n0.25"'),
    "moments of a program's rounding": ('iyy="0.9" iyz="0"', 'iyy="-5.4e-20" iyz="0"'),
    "no mass": ('<mass value="30"/>', '<mass value="0"/>'),
    "a mirrored mesh": ('<sphere radius="0.05"/>', '<mesh filename="a.stl" scale="1 -1 1"/>'),
    "a name in another script": (
        '<link name="base_link">',
        '<link name="база"/><link name="base_link">',
    ),
    "two joints of equal limits": ('lower="-2" upper="2"', ""),
}


@pytest.mark.parametrize("what", HARMLESS)
def test_what_makes_no_difference_is_no_mistake(tmp_path, what, capfd):
    old, new = HARMLESS[what]
    assert URDF.count(old) == 1
    text = URDF.replace(old, new)
    if "база" in new:
        text = text.replace(
            "</robot>",
            '<joint name="к" type="fixed"><parent link="база"/><child link="base_link"/></joint>'
            "</robot>",
        )
    model_of(read_urdf(written(tmp_path, text)))
    assert capfd.readouterr() == ("", "")


def test_robots_that_are_put_together_may_have_colours_of_one_name(tmp_path, capfd):
    robot = GoodRobot(tmp_path)
    grey = '<material name="grey"><color rgba="1 1 1 1"/></material>'
    robot.change(robot.boom, '<link name="foot"/>', grey + '<link name="foot"/>')
    robot.mount()
    robot.change_toml('prefix = "boom_"\n', "")
    assert "pan" in mm.load_robot(robot.toml).joint_names
    assert capfd.readouterr() == ("", "")


def test_colours_are_those_of_the_file(tmp_path):
    red = '<link name="base_link"><visual><geometry><sphere radius="1"/></geometry>'
    red += '<material name=""><color rgba="1 0 0 1"/></material></visual>'
    robot = read_urdf(written(tmp_path, URDF.replace('<link name="base_link">', red)))
    xml = flat_urdf(robot, "a.urdf").replace("package://cart_description/meshes/column.stl", "")
    model = pin.buildModelFromXML(xml)
    shapes = pin.buildGeomFromUrdfString(
        model, xml.replace('<mesh filename=""', '<box size="1 1 1"'), pin.VISUAL
    )
    colours = {shape.name: shape.meshColor.tolist() for shape in shapes.geometryObjects}
    assert colours["base_link_0"] == [1.0, 0.0, 0.0, 1.0]
    assert colours["base_link_1"] == [0.5, 0.5, 0.5, 1.0]


def test_a_file_without_a_name_gives_the_robot_its_own(tmp_path):
    text = URDF.replace('<robot name="cart">', "<robot>")
    assert read_urdf(written(tmp_path, text)).get("name") == "a"


def test_every_reading_gives_a_new_element(tmp_path):
    path = written(tmp_path, URDF)
    first = read_urdf(path)
    first.clear()
    assert read_urdf(path).findall("link")


@pytest.fixture
def decimal_comma():
    """The locale of a system that writes 0,5; skipped where none is installed."""
    before = locale.setlocale(locale.LC_NUMERIC)
    for name in ("de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "es_ES.UTF-8"):
        try:
            locale.setlocale(locale.LC_NUMERIC, name)
        except locale.Error:
            continue
        yield
        locale.setlocale(locale.LC_NUMERIC, before)
        return
    pytest.skip("no such locale is installed")


@pytest.mark.usefixtures("decimal_comma")
def test_a_decimal_comma_of_the_system_does_not_matter(tmp_path):
    assert model_of(read_urdf(written(tmp_path, URDF))).njoints == 11


# What cannot be read at all


def test_what_is_no_character_is_told(tmp_path):
    text = URDF.replace("?>", ' encoding="unicode_escape"?>', 1).replace("elbow", "\\ud800")
    with pytest.raises(SpecError, match="not in the encoding UNICODE_ESCAPE"):
        read_urdf(written(tmp_path, text))


@pytest.mark.parametrize(("kind", "make"), [("a folder", os.mkdir), ("a pipe", os.mkfifo)])
def test_what_is_no_file_is_not_opened(tmp_path, kind, make):
    make(tmp_path / "a.urdf")
    with pytest.raises(SpecError, match=rf"a\.urdf: it is {kind}; give a file"):
        read_urdf(tmp_path / "a.urdf")


def test_a_device_is_not_opened():
    with pytest.raises(SpecError, match="cannot read the URDF /dev/zero: it is a device"):
        read_urdf(Path("/dev/zero"))


@pytest.mark.parametrize("name", ["no/such.urdf", "a.urdf/b.urdf", "x" * 5000, "nul\0.urdf"])
def test_a_path_of_no_file_is_told(tmp_path, name):
    written(tmp_path, URDF)
    with pytest.raises(SpecError, match="cannot read the URDF"):
        read_urdf(tmp_path / name)


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    def refused(path, *arguments, **options):  # as it is for all but root, who may read everything
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    path = written(tmp_path, URDF)
    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(SpecError, match=r"a\.urdf: Permission denied"):
        read_urdf(path)


def test_a_file_that_grows_while_it_is_read_is_no_larger_than_allowed():
    """Files of the system say that they have 0 bytes, whatever they hold."""
    path = Path("/proc/self/environ")
    if not path.is_file() or not path.read_bytes():
        pytest.skip("this system has no such file")
    with pytest.raises(SpecError, match=r"larger than 1e-06 MB \(it should not\)"):
        read_input(path, "thing", 1e-6, "it should not")


def test_the_largest_file_that_is_allowed(tmp_path):
    filling = "<!--" + "x" * 4_900_000 + "-->"
    text = URDF.replace("</robot>", filling + "</robot>")
    assert read_urdf(written(tmp_path, text)).findall("link")


# Pinocchio never sees a bad one


def test_robots_of_the_data_package_are_clear_to_pinocchio(capfd):
    """All but the two that make no sense: one without links, one that mimics joints it lacks."""
    share = Path(pin.__file__).parents[4] / "share" / "example-robot-data" / "robots"
    paths = sorted(share.rglob("*.urdf"))
    assert len(paths) > 50
    for path in paths:
        robot, refusal = read(path)
        if robot is None:
            assert path.name in ("ur3.urdf", "alex_psyonic_hands.urdf"), refusal
            continue
        model = pin.buildModelFromXML(flat_urdf(robot, path.name))
        assert model.nq == model.nv
    assert capfd.readouterr() == ("", "")


VALUES = (
    "", " ", "nan", "-inf", "1e999", "0", "-1", "1e-320", "1 2", "1 2 3", "1 2 3 4", "0 0 0", "1,5",
    "0x1", "1_0", "１", "x", "base_link", "elbow", "tool", "world", "universe", "fixed", "continuous",
    "1e300 0 0", "-0.0", "1\t2 3", "é",
)  # fmt: skip


def mutated(chance: random.Random) -> str:
    """The good URDF with one to three random changes."""
    robot = ET.fromstring(URDF.replace("sensor:", ""))
    for _ in range(chance.randint(1, 3)):
        parents = [element for element in robot.iter() if len(element)]
        parent = chance.choice(parents)
        child = chance.choice(list(parent))
        kind = chance.randrange(5)
        if kind == 0:
            parent.remove(child)
        elif kind == 1:
            parent.append(copy.deepcopy(child))
        elif kind == 2:
            child.tag = chance.choice(["capsule", "box", "mesh", "link", "origin", "limit", "x"])
        elif child.attrib:
            name = chance.choice(sorted(child.attrib))
            if kind == 3:
                del child.attrib[name]
            else:
                child.set(name, chance.choice(VALUES))
    return ET.tostring(robot, encoding="unicode")


def test_what_passes_is_clear_to_pinocchio(tmp_path, capfd):
    """Whatever is changed, a URDF is refused with its name, or Pinocchio takes it without a word."""
    passed = refused = 0
    for seed in range(150):
        robot, refusal = read(written(tmp_path, mutated(random.Random(seed))))
        if robot is None:
            assert "a.urdf" in refusal
            assert "\n" not in refusal
            refused += 1
            continue
        masses = sum(float(m.get("value")) for m in robot.findall("link/inertial[1]/mass[1]"))
        model = model_of(robot)
        assert np.isclose(pin.computeTotalMass(model), masses), seed
        assert capfd.readouterr() == ("", ""), seed
        passed += 1
    assert min(passed, refused) > 30


def test_the_good_robot_is_read_as_it_is_written(tmp_path):
    robot = GoodRobot(tmp_path)
    element = read_urdf(robot.urdf)
    colour = '<material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>'
    plain = ET.fromstring(URDF.replace("sensor:", "").replace('<material name="grey"/>', colour))
    for tag in ("link", "joint"):
        read = [
            ET.canonicalize(ET.tostring(part), strip_text=True) for part in element.findall(tag)
        ]
        meant = [ET.canonicalize(ET.tostring(part), strip_text=True) for part in plain.findall(tag)]
        # what is added is what stands for "not known"
        assert [text.replace(' velocity="0"', "") for text in read] == meant
