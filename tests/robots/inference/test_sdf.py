"""SDF files become the robots that they are, wherever their frames lie."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest
from made_urdf import differential

import mobman as mm
from mobman.errors import MobmanError
from mobman.robots.incoming.incoming import incoming


def text(values):
    return " ".join(repr(float(v)) for v in values)


def pose_of(place: pin.SE3) -> str:
    return text([*place.translation, *pin.rpy.matrixToRpy(place.rotation)])


def placed(element) -> pin.SE3:
    origin = None if element is None else element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = ([float(v) for v in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))


def sdf_of(urdf: ET.Element, version: str, frames: str) -> str:
    """The same robot as SDF: links by poses in the model, or relative to their parents' joints, or with
    frames that are anywhere."""
    sdf = ET.Element("sdf", version=version)
    model = ET.SubElement(ET.SubElement(sdf, "world", name="w"), "model", name="cart")
    above = {j.find("child").get("link"): j for j in urdf.iter("joint")}
    random = np.random.default_rng(0)
    own = {}  # where SDF has a link's frame in that of its joint

    def place(link):  # the frame of its joint, in the model's
        joint = above.get(link)
        if joint is None:
            return pin.SE3.Identity()
        return place(joint.find("parent").get("link")) * placed(joint)

    for link in urdf.iter("link"):
        name = link.get("name")
        anywhere = frames == "anywhere" and name in above and name != "tool0"
        shift = pin.SE3.Random() if anywhere else pin.SE3.Identity()
        if anywhere:
            shift = pin.SE3(
                pin.rpy.rpyToMatrix(*random.uniform(-1, 1, 3)), random.uniform(-1, 1, 3)
            )
        own[name] = shift
        element = ET.SubElement(model, "link", name=name)
        if frames == "relative" and name in above:
            ET.SubElement(element, "pose", relative_to=above[name].get("name")).text = "0 0 0 0 0 0"
        else:
            ET.SubElement(element, "pose").text = pose_of(place(name) * shift)
        inertial = link.find("inertial")
        made = ET.SubElement(element, "inertial")
        ET.SubElement(made, "pose").text = pose_of(shift.inverse() * placed(inertial))
        mass = 0.0 if inertial is None else float(inertial.find("mass").get("value"))
        ET.SubElement(made, "mass").text = str(mass)
        moments = ET.SubElement(made, "inertia")
        for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
            value = "0" if inertial is None else inertial.find("inertia").get(key)
            ET.SubElement(moments, key).text = value
        for part in link.findall("collision"):
            shape = part.find("geometry")[0]
            seen = ET.SubElement(element, "collision", name="c")
            ET.SubElement(seen, "pose").text = pose_of(shift.inverse() * placed(part))
            kind = ET.SubElement(ET.SubElement(seen, "geometry"), shape.tag)
            for key, value in shape.items():
                ET.SubElement(kind, key).text = value
    for joint in urdf.iter("joint"):
        name, kind = joint.get("name"), joint.get("type")
        parent, child = (joint.find(end).get("link") for end in ("parent", "child"))
        sdf_kind = "revolute" if kind == "continuous" else kind
        element = ET.SubElement(model, "joint", name=name, type=sdf_kind)
        ET.SubElement(element, "parent").text = parent
        ET.SubElement(element, "child").text = child
        if frames == "relative":
            to = {"relative_to": parent}
            ET.SubElement(element, "pose", to).text = pose_of(placed(joint))
        else:
            ET.SubElement(element, "pose").text = pose_of(own[child].inverse())
        if kind == "fixed":
            continue
        axis = ET.SubElement(element, "axis")
        xyz = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
        in_model = place(child).rotation @ xyz
        if version == "1.6":
            ET.SubElement(axis, "use_parent_model_frame").text = "true"
        if version in ("1.4", "1.6"):
            ET.SubElement(axis, "xyz").text = text(in_model)
        elif frames == "anywhere":
            ET.SubElement(axis, "xyz", expressed_in="__model__").text = text(in_model)
        else:
            ET.SubElement(axis, "xyz").text = text(xyz)
        limit = ET.SubElement(axis, "limit")
        given = joint.find("limit")
        if kind == "continuous":
            given = {"lower": "-1e16", "upper": "1e16"}
        for key in ("lower", "upper", "effort", "velocity"):
            if given.get(key):
                ET.SubElement(limit, key).text = given.get(key)
    ET.SubElement(model, "plugin", name="drive", filename="libdrive.so")
    return ET.tostring(sdf, encoding="unicode")


@pytest.mark.filterwarnings("ignore:.*robots add")
@pytest.mark.parametrize(
    ("version", "frames"),
    [("1.4", "model"), ("1.6", "model"), ("1.7", "anywhere"), ("1.9", "relative")],
)
def test_an_sdf_file_is_the_robot_of_its_urdf(tmp_path, version, frames):
    made = differential("z").arm(tip="tool0")
    made.xml.find("joint[@name='arm_4_joint']/axis").set("xyz", "0.6 0.8 0")
    made.xml.find("joint[@name='arm_3_joint']/origin").set("rpy", "0.3 -0.2 0.5")
    same = mm.load_robot(made.write(tmp_path / "cart.urdf"))
    (tmp_path / "cart.sdf").write_text(sdf_of(made.xml, version, frames))
    with pytest.warns(UserWarning, match=r"1 plugin"):
        robot = mm.load_robot(tmp_path / "cart.sdf")
    assert robot.spec.platform.parameters == same.spec.platform.parameters
    order = [same.joint_names.index(name) for name in robot.joint_names]
    np.testing.assert_allclose(robot.limits.lower, same.limits.lower[order])
    for _ in range(3):
        q, z = np.random.default_rng(1).uniform(-1, 1, same.nq), np.linspace(-1.0, 1.0, same.nz)
        q[same.platform_index] = 0.3
        np.testing.assert_allclose(
            robot.tip_pose(q[order]).homogeneous, same.tip_pose(q).homogeneous, atol=1e-9
        )
        ours, theirs = robot.dynamics(q[order], z), same.dynamics(q, z)
        np.testing.assert_allclose(ours.M, theirs.M, atol=1e-8)
        np.testing.assert_allclose(ours.bias, theirs.bias, atol=1e-8)


MODEL = """<sdf version="1.9"><model name="m"><link name="base"/><link name="a"/>
<joint name="j" type="revolute"><parent>base</parent><child>a</child><axis><xyz>0 0 1</xyz></axis>
</joint>{more}</model>{beside}</sdf>"""


QUATERNION = '<link name="b"><pose rotation_format="quat_xyzw">{}</pose></link>'
SHAPE = '<link name="b"><collision name="c"><geometry>{}</geometry></collision></link>'


@pytest.mark.parametrize(
    ("more", "beside", "words"),
    [
        ("<include><uri>model://arm</uri></include>", "", "include.*within a model"),
        ('<frame name="f"><pose relative_to="g"/></frame>', "", "'g' is not there"),
        (
            '<link name="b"><pose relative_to="b">0 0 0 0 0 0</pose></link>',
            "",
            "'b' is defined by it",
        ),
        ('<link name="b"><pose>0 0 nan 0 0 0</pose></link>', "", "'b' is '0 0 nan"),
        (
            '<joint name="k" type="fixed"><parent>a</parent><child>z</child></joint>',
            "",
            "'z' is no link",
        ),
        (QUATERNION.format("0 0 1 0 0 0"), "", r"'b' is '0 0 1 0 0 0'; allowed: 7 finite numbers"),
        (QUATERNION.format("0 0 1 0 0 0 0"), "", "a quaternion that is not 0"),
        (
            SHAPE.format("<capsule><radius>x</radius></capsule>"),
            "",
            "<radius> is 'x'; allowed: a nu",
        ),
        (
            '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>',
            "",
            "'f' is defined b",
        ),
        ('<link name="a"/>', "", "'a' has no name, or one that is there already"),
        ("", '<model name="n"><joint name="i" type="prismatic"/></model>', "2 models with joints"),
    ],
)
def test_an_sdf_file_that_cannot_be_taken(tmp_path, more, beside, words):
    (tmp_path / "m.sdf").write_text(MODEL.format(more=more, beside=beside))
    with pytest.raises(MobmanError, match=words) as error:
        incoming(tmp_path / "m.sdf")
    assert "m.sdf" in str(error.value)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("", "no driven wheels"),
        ('<link name="b"><inertial><mass>-1</mass></inertial></link>', "mass"),
    ],
)
def test_messages_of_inference_name_the_sdf_file(tmp_path, more, words):
    (tmp_path / "m.sdf").write_text(MODEL.format(more=more, beside=""))
    with pytest.raises(MobmanError, match=words) as error:
        mm.load_robot(tmp_path / "m.sdf")
    assert str(tmp_path / "m.sdf") in str(error.value).partition(words)[0]
    assert "m.urdf" not in str(error.value)


def test_frames_on_joints_quaternions_and_usual_sizes(tmp_path):
    """A frame is on the link that a joint moves, through other frames; a capsule has SDF's sizes."""
    half = np.sqrt(0.5)
    more = (
        SHAPE.format("<capsule/>").replace("<link name=", '<link name="c"/><link name=', 1)
        + '<joint name="k" type="fixed"><parent>a</parent><child>b</child></joint>'
        + f'<joint name="l" type="revolute"><parent>b</parent><child>c</child>'
        f'<pose rotation_format="quat_xyzw">0 0 1 0 0 {half} {half}</pose><axis><mimic joint="j">'
        "<multiplier>2</multiplier><offset>1</offset><reference>0.5</reference></mimic></axis></joint>"
        '<frame name="f" attached_to="g"/><frame name="g" attached_to="l"/>'
    )
    (tmp_path / "m.sdf").write_text(MODEL.format(more=more, beside="").replace("1.9", "1.x"))
    robot = incoming(tmp_path / "m.sdf").file.parse()
    joints = {joint.get("name"): joint for joint in robot.iter("joint")}
    assert joints["f_fixed"].find("parent").get("link") == "c"
    assert np.allclose(placed(joints["l"]).rotation, pin.utils.rotate("z", np.pi / 2))
    assert joints["l"].find("mimic").attrib == {"joint": "j", "multiplier": "2.0", "offset": "0.0"}
    (cylinder,) = robot.findall("link[@name='b']/collision/geometry/cylinder")
    assert cylinder.attrib == {"radius": "0.5", "length": "1.0"}


def test_what_a_urdf_cannot_hold_is_said(tmp_path):
    more = """<link name="b"><visual name="v"><geometry><ellipsoid/></geometry></visual>
    <sensor name="s" type="imu"/></link>
    <joint name="ball" type="ball"><parent>a</parent><child>b</child></joint>
    <frame name="tool" attached_to="b"><pose degrees="true">0 0 1 0 0 90</pose></frame>"""
    (tmp_path / "m.sdf").write_text(MODEL.format(more=more, beside='<model name="floor"/>'))
    said = "; ".join(incoming(tmp_path / "m.sdf").said)
    for word in ("ball joint: 'ball' is held", "ellipsoid", "1 sensor", "1 kg", "floor"):
        assert word in said, word


@pytest.mark.filterwarnings("ignore:.*robots add")
def test_a_link_may_be_called_world(tmp_path):
    made = differential(root="world").arm(parent="world", tip="tool0")
    (tmp_path / "cart.sdf").write_text(sdf_of(made.xml, "1.7", "model"))
    same = mm.load_robot(made.write(tmp_path / "cart.urdf"))
    with pytest.warns(UserWarning, match=r"1 plugin"):
        assert mm.load_robot(tmp_path / "cart.sdf").joint_names == same.joint_names
