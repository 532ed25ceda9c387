"""URDFs that must be refused, each with what the message must say."""

from __future__ import annotations

import os
import re

from cases import urdfs
from good_robot import URDF, GoodRobot

case = urdfs.case
FILE = "cart.urdf"
TYPES = "fixed, revolute, prismatic, continuous"
XACRO = (FILE, "cannot be expanded by xacro")


def _declare_sensor(robot: GoodRobot) -> None:
    """Xacro refuses a prefix that is not declared, before it sees anything else."""
    robot.change_urdf("<gazebo reference", '<gazebo xmlns:sensor="about:sensor" reference')


# The file


@case(FILE)
def urdf_is_not_there(robot: GoodRobot) -> None:
    robot.urdf.unlink()


@case(FILE)
def urdf_is_a_folder(robot: GoodRobot) -> None:
    robot.urdf.unlink()
    robot.urdf.mkdir()


@case("nothing.urdf")
def urdf_is_a_link_to_nothing(robot: GoodRobot) -> None:
    robot.urdf.unlink()
    robot.urdf.symlink_to("nothing.urdf")


@case(FILE)
def urdf_is_a_link_to_itself(robot: GoodRobot) -> None:
    robot.urdf.unlink()
    robot.urdf.symlink_to(FILE)


@case(FILE, "empty")
def urdf_is_empty(robot: GoodRobot) -> None:
    robot.urdf.write_bytes(b"")


@case(FILE, "empty")
def urdf_is_blank(robot: GoodRobot) -> None:
    robot.urdf.write_bytes(b" \n\n\t")


@case("the URDF ", FILE, "has 50 MB;", "allowed: 5 MB", "meshes")
def urdf_is_huge(robot: GoodRobot) -> None:
    os.truncate(robot.urdf, 50_000_000)


@case(FILE, "binary")
def urdf_is_binary(robot: GoodRobot) -> None:
    robot.urdf.write_bytes(bytes(range(256)) * 8)


@case(FILE, "not valid XML", "'solid column")
def urdf_is_a_mesh(robot: GoodRobot) -> None:
    robot.urdf.write_bytes(robot.mesh.read_bytes())


@case(FILE, "UTF-8", "byte 0xe9 in line 5", "encoding=")
def urdf_in_latin_1(robot: GoodRobot) -> None:
    robot.urdf.write_bytes(URDF.replace("base_link", "basé_link").encode("latin-1"))


@case(FILE, "'klingon'", "UTF-8")
def urdf_in_an_unknown_encoding(robot: GoodRobot) -> None:
    robot.change_urdf('<?xml version="1.0"?>', '<?xml version="1.0" encoding="klingon"?>')


# The XML


@case(FILE, "not valid XML", "'wheel_radius")
def urdf_is_no_xml(robot: GoodRobot) -> None:
    robot.urdf.write_text("wheel_radius = 0.1\n", encoding="utf-8")


@case(FILE, "not valid XML", "line 25", "too early", "<inertial> of line 23")
def urdf_is_cut_off(robot: GoodRobot) -> None:
    text = URDF[: URDF.index('<inertia ixx="0.005"')]
    robot.urdf.write_text(text, encoding="utf-8")


@case(FILE, "not valid XML", "line 7", "too early")
def urdf_is_cut_off_in_a_tag(robot: GoodRobot) -> None:
    robot.urdf.write_text(URDF[: URDF.index('xyz="0 0 0.15"')], encoding="utf-8")


@case(FILE, "not valid XML", "mismatched tag", "<axis> of line 36 is not closed")
def urdf_with_an_open_tag(robot: GoodRobot) -> None:
    text = URDF.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0">', 1)
    robot.urdf.write_text(text, encoding="utf-8")


@case(FILE, "not valid XML", "line 3", "&amp;")
def urdf_with_a_bare_ampersand(robot: GoodRobot) -> None:
    robot.change_urdf('<material name="grey">', '<material name="black & white">')


@case(FILE, "not valid XML", "duplicate attribute", "line 8")
def urdf_with_an_attribute_twice(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', '<mass value="30" value="31"/>')


@case(FILE, "nested")
def urdf_nested_without_end(robot: GoodRobot) -> None:
    robot.add_to_urdf("<a>" * 100_000 + "</a>" * 100_000)


@case(FILE, "<!DOCTYPE>", "line 2", "remove it")
def urdf_of_a_billion_laughs(robot: GoodRobot) -> None:
    entities = ['<!ENTITY a0 "ha">']
    entities += [f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10)]
    declaration = f"<!DOCTYPE robot [{''.join(entities)}]>\n"
    robot.change_urdf('<robot name="cart">', declaration + '<robot name="&a9;">')


@case(FILE, "<!DOCTYPE>", "remove it")
def urdf_with_an_entity_from_a_file(robot: GoodRobot) -> None:
    declaration = '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]>\n'
    robot.change_urdf('<robot name="cart">', declaration + '<robot name="cart">&x;')


@case(FILE, "<!DOCTYPE>", "remove it")
def urdf_with_an_external_dtd(robot: GoodRobot) -> None:
    declaration = '<!DOCTYPE robot SYSTEM "http://localhost:1/robot.dtd">\n'
    robot.change_urdf('<robot name="cart">', declaration + '<robot name="cart">')


@case(FILE, "not valid XML", "undefined entity", "line 3")
def urdf_with_an_unknown_entity(robot: GoodRobot) -> None:
    robot.change_urdf('<material name="grey">', '<material name="grey&nbsp;">')


# Another format


@case(
    FILE,
    *("<sdf>", "<robot>", "SDF", "Gazebo"),
    added=(FILE, "SDF", "0 models with joints", "allowed: one"),
)
def urdf_is_an_sdf(robot: GoodRobot) -> None:
    robot.urdf.write_text('<sdf version="1.7"><model name="cart"/></sdf>', encoding="utf-8")


@case(FILE, "<mujoco>", "<robot>", "MJCF", added=(FILE, "MJCF", "0 robots", "allowed: one"))
def urdf_is_an_mjcf(robot: GoodRobot) -> None:
    robot.urdf.write_text('<mujoco model="cart"><worldbody/></mujoco>', encoding="utf-8")


@case(FILE, "web page", "download")
def urdf_is_a_web_page(robot: GoodRobot) -> None:
    robot.urdf.write_text("<!DOCTYPE html>\n<html><body>404</body></html>", encoding="utf-8")


@case(FILE, "no <link>", "SRDF")
def urdf_is_an_srdf(robot: GoodRobot) -> None:
    text = '<robot name="cart"><group name="arm"><joint name="elbow"/></group></robot>'
    robot.urdf.write_text(text, encoding="utf-8")


@case(
    FILE, "line 3", "<xacro:macro>", "run xacro first",
    added=(*XACRO, "unbound prefix", "line 155"),  # of the sensor: the macro itself is in order
)  # fmt: skip
def urdf_with_a_macro(robot: GoodRobot) -> None:
    declared = '<robot name="cart" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    robot.change_urdf('<robot name="cart">', declared)
    robot.change_urdf(
        '<material name="grey">',
        '<xacro:macro name="m" params="p"><link name="a"/></xacro:macro><material name="grey">',
    )


@case(FILE, "line 8", "'${mass}'", "run xacro first", added=(*XACRO, "'mass'", "not defined"))
def urdf_with_an_expression(robot: GoodRobot) -> None:
    _declare_sensor(robot)
    robot.change_urdf('<mass value="30"/>', '<mass value="${mass}"/>')


@case(FILE, "'$(arg prefix)tool'", "run xacro first", added=(*XACRO, "argument", "prefix"))
def urdf_with_an_argument(robot: GoodRobot) -> None:
    _declare_sensor(robot)
    robot.change_urdf('<link name="tool"/>', '<link name="$(arg prefix)tool"/>')


@case(FILE, "<xacro:arm>", "run xacro first")
def urdf_that_needs_a_macro(robot: GoodRobot) -> None:
    robot.change_urdf('<link name="tool"/>', '<xacro:arm tool="tool"/>')


# Links and joints


@case(FILE, "no <link>")
def urdf_without_links(robot: GoodRobot) -> None:
    robot.urdf.write_text('<robot name="cart"/>', encoding="utf-8")


@case(FILE, "version is '2.0'", "allowed: 1.x")
def urdf_of_a_later_version(robot: GoodRobot) -> None:
    robot.change_urdf('<robot name="cart">', '<robot name="cart" version="2.0">')


@case(FILE, "a <link> has no name")
def link_without_a_name(robot: GoodRobot) -> None:
    robot.add_to_urdf("<link/>")


@case(FILE, "a <joint> has no name")
def joint_without_a_name(robot: GoodRobot) -> None:
    robot.change_urdf('<joint name="lift" type="prismatic">', '<joint type="prismatic">')


@case(FILE, "duplicate link name 'column'", "line 67")
def link_that_is_there_twice(robot: GoodRobot) -> None:
    robot.add_to_urdf('<link name="column"/>')


@case(FILE, "duplicate joint name 'elbow'")
def joint_that_is_there_twice(robot: GoodRobot) -> None:
    robot.add_to_urdf(
        '<link name="b"/><joint name="elbow" type="fixed"><parent link="tool"/><child link="b"/></joint>'
    )


@case(FILE, "joint 'lift'", "no parent", '<parent link="..."/>')
def joint_without_a_parent(robot: GoodRobot) -> None:
    robot.change_urdf(
        '<parent link="base_link"/>\n    <child link="column"/>', '<child link="column"/>'
    )


@case(FILE, "joint 'lift'", "no child", '<child link="..."/>')
def joint_without_a_child(robot: GoodRobot) -> None:
    robot.change_urdf('<child link="column"/>', "<child/>")


@case(FILE, "joint 'elbow'", "parent 'uper_arm'", "no link", "upper_arm")
def parent_that_is_no_link(robot: GoodRobot) -> None:
    robot.change_urdf('<parent link="upper_arm"/>', '<parent link="uper_arm"/>')


@case(FILE, "joint 'tool_joint'", "child 'hand'", "no link")
def child_that_is_no_link(robot: GoodRobot) -> None:
    robot.change_urdf('<child link="tool"/>', '<child link="hand"/>')


@case(FILE, "joint 'second'", "'tool'", "'tool_joint'", "one parent")
def link_with_two_parents(robot: GoodRobot) -> None:
    robot.add_to_urdf(
        '<joint name="second" type="fixed"><parent link="column"/><child link="tool"/></joint>'
    )


@case(FILE, "2 root links (base_link, loose)", "allowed: one")
def urdf_with_two_roots(robot: GoodRobot) -> None:
    robot.add_to_urdf('<link name="loose"/>')


@case(FILE, "circle", "'a'", "'b'", "'a_to_b'", "'b_to_a'")
def links_in_a_circle(robot: GoodRobot) -> None:
    robot.add_to_urdf(
        '<link name="a"/><link name="b"/>'
        '<joint name="a_to_b" type="fixed"><parent link="a"/><child link="b"/></joint>'
        '<joint name="b_to_a" type="fixed"><parent link="b"/><child link="a"/></joint>'
    )


@case(FILE, "circle", "'base_link'", "'tool'", "'closing'")
def urdf_without_a_root(robot: GoodRobot) -> None:
    robot.add_to_urdf(
        '<joint name="closing" type="fixed"><parent link="tool"/><child link="base_link"/></joint>'
    )


@case(FILE, "circle", "'tool'", "'itself'")
def joint_from_a_link_to_itself(robot: GoodRobot) -> None:
    robot.change_urdf(
        '<joint name="tool_joint" type="fixed">', '<joint name="itself" type="fixed">'
    )
    robot.change_urdf(
        '<parent link="forearm"/>\n    <child link="tool"/>',
        '<parent link="tool"/>\n    <child link="tool"/>',
    )


@case(FILE, "joint 'elbow'", "'Revolute'", TYPES)
def joint_of_an_unknown_type(robot: GoodRobot) -> None:
    robot.change_urdf(
        '<joint name="elbow" type="revolute">', '<joint name="elbow" type="Revolute">'
    )


@case(FILE, "joint 'elbow'", "no type", TYPES)
def joint_without_a_type(robot: GoodRobot) -> None:
    robot.change_urdf('<joint name="elbow" type="revolute">', '<joint name="elbow">')


@case(FILE, "joint 'world_joint'", "'floating'", TYPES, "make it fixed", "mobman adds")
def floating_joint(robot: GoodRobot) -> None:
    robot.add_to_urdf(
        '<link name="world"/><joint name="world_joint" type="floating">'
        '<parent link="world"/><child link="base_link"/></joint>'
    )


@case(FILE, "joint 'world_joint'", "'planar'", TYPES, "make it fixed", "mobman adds")
def planar_joint(robot: GoodRobot) -> None:
    robot.add_to_urdf(
        '<link name="world"/><joint name="world_joint" type="planar">'
        '<parent link="world"/><child link="base_link"/></joint>'
    )


@case(FILE, "joint 'left_finger_joint'", "'finger'", "no joint")
def mimic_of_an_unknown_joint(robot: GoodRobot) -> None:
    robot.change_urdf('<mimic joint="right_finger_joint"', '<mimic joint="finger"')


@case(FILE, "joint 'left_finger_joint'", "itself")
def mimic_of_itself(robot: GoodRobot) -> None:
    robot.change_urdf('<mimic joint="right_finger_joint"', '<mimic joint="left_finger_joint"')


# Numbers


@case(FILE, "joint 'elbow'", "<origin> xyz", "'0.4 0'", "3 finite numbers", "(m)")
def origin_of_two_numbers(robot: GoodRobot) -> None:
    robot.change_urdf('<origin xyz="0.4 0 0"/>', '<origin xyz="0.4 0"/>')


@case(FILE, "joint 'elbow'", "<origin> xyz", "''", "3 finite numbers")
def origin_of_no_number(robot: GoodRobot) -> None:
    robot.change_urdf('<origin xyz="0.4 0 0"/>', '<origin xyz=""/>')


@case(FILE, "joint 'elbow'", "<origin> rpy", "'nan 0 0'", "3 finite numbers", "(rad)")
def origin_with_nan(robot: GoodRobot) -> None:
    robot.change_urdf('<origin xyz="0.4 0 0"/>', '<origin xyz="0.4 0 0" rpy="nan 0 0"/>')


@case(FILE, "joint 'elbow'", "<origin> xyz", "'0,4 0 0'", "decimal point")
def origin_with_a_decimal_comma(robot: GoodRobot) -> None:
    robot.change_urdf('<origin xyz="0.4 0 0"/>', '<origin xyz="0,4 0 0"/>')


@case(FILE, "joint 'elbow'", "<origin> xyz", "'0.4m 0 0'", "3 finite numbers", "(m)")
def origin_with_a_unit(robot: GoodRobot) -> None:
    robot.change_urdf('<origin xyz="0.4 0 0"/>', '<origin xyz="0.4m 0 0"/>')


@case(FILE, "joint 'elbow'", "quat_xyzw", "rpy")
def origin_with_a_quaternion(robot: GoodRobot) -> None:
    robot.change_urdf('<origin xyz="0.4 0 0"/>', '<origin xyz="0.4 0 0" quat_xyzw="0 0 0 1"/>')


@case(FILE, "joint 'lift'", "<axis> xyz", "'0 0 0'", "not 0")
def axis_of_no_direction(robot: GoodRobot) -> None:
    robot.change_urdf(
        '<origin xyz="0.1 0 0.25"/>\n    <axis xyz="0 0 1"/>',
        '<origin xyz="0.1 0 0.25"/>\n    <axis xyz="0 0 0"/>',
    )


@case(FILE, "joint 'lift'", "<axis> xyz", "'z'", "3 finite numbers")
def axis_in_words(robot: GoodRobot) -> None:
    robot.change_urdf(
        '<origin xyz="0.1 0 0.25"/>\n    <axis xyz="0 0 1"/>',
        '<origin xyz="0.1 0 0.25"/>\n    <axis xyz="z"/>',
    )


@case(
    FILE, "joint 'elbow'", "revolute", "no <limit>", "lower, upper, effort, velocity", "continuous"
)
def revolute_joint_without_limits(robot: GoodRobot) -> None:
    robot.change_urdf('<limit lower="-2" upper="2" effort="40" velocity="2"/>', "")


@case(FILE, "joint 'lift'", "prismatic", "no <limit>", "lower, upper, effort, velocity")
def prismatic_joint_without_limits(robot: GoodRobot) -> None:
    robot.change_urdf('<limit lower="0" upper="0.4" effort="400" velocity="0.1"/>', "")


@case(FILE, "joint 'elbow'", "lower is 2", "upper -2", "lower <= upper")
def limits_the_wrong_way_round(robot: GoodRobot) -> None:
    robot.change_urdf('lower="-2" upper="2"', 'lower="2" upper="-2"')


@case(FILE, "joint 'elbow'", "<limit> upper", "'1e999'", "finite number")
def limit_beyond_all_numbers(robot: GoodRobot) -> None:
    robot.change_urdf('lower="-2" upper="2"', 'lower="-2" upper="1e999"')


@case(FILE, "joint 'elbow'", "<limit> lower", "'-115 deg'", "rad")
def limit_in_degrees(robot: GoodRobot) -> None:
    robot.change_urdf('lower="-2" upper="2"', 'lower="-115 deg" upper="2"')


@case(FILE, "joint 'elbow'", "<limit> effort", "'-40'", "0 or more", "N m")
def negative_effort(robot: GoodRobot) -> None:
    robot.change_urdf('effort="40"', 'effort="-40"')


@case(FILE, "joint 'shoulder'", "<limit> velocity", "'-2'", "0 or more", "rad/s")
def negative_velocity(robot: GoodRobot) -> None:
    robot.change_urdf('effort="60" velocity="2"', 'effort="60" velocity="-2"')


@case(FILE, "joint 'lift'", "<dynamics> damping", "'lots'", "0 or more")
def damping_in_words(robot: GoodRobot) -> None:
    robot.change_urdf('damping="10"', 'damping="lots"')


@case(FILE, "link 'base_link'", "<mass> value", "'-30'", "0 or more", "kg")
def negative_mass(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', '<mass value="-30"/>')


@case(FILE, "link 'base_link'", "<mass> value", "'NaN'", "0 or more")
def mass_that_is_nan(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', '<mass value="NaN"/>')


@case(FILE, "link 'base_link'", "<mass> value", "'0x1e'", "0 or more")
def mass_in_hexadecimal(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', '<mass value="0x1e"/>')


@case(FILE, "link 'base_link'", "<mass> has no 'value'", "kg")
def mass_without_a_value(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', "<mass>30</mass>")


@case(FILE, "link 'base_link'", "<inertial> has no <mass>")
def inertial_without_mass(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', "")


@case(FILE, "link 'base_link'", "<inertial> has no <inertia>", "ixx")
def inertial_without_inertia(robot: GoodRobot) -> None:
    robot.change_urdf('<inertia ixx="0.6" ixy="0" ixz="0" iyy="0.9" iyz="0" izz="1.3"/>', "")


@case(FILE, "link 'base_link'", "<inertia> has no 'iyz'", "kg m^2")
def inertia_without_a_product(robot: GoodRobot) -> None:
    robot.change_urdf('iyy="0.9" iyz="0"', 'iyy="0.9"')


@case(FILE, "link 'base_link'", "<inertia> izz", "'-1.3'", "0 or more")
def negative_inertia(robot: GoodRobot) -> None:
    robot.change_urdf('izz="1.3"', 'izz="-1.3"')


# Several at once, and what only the whole shows


@case(
    FILE, "3 problems", "(1) line 8", "'-30'", "(2)", "<limit> upper", "'nan'", "(3)", "left_finger"
)
def three_problems_at_once(robot: GoodRobot) -> None:
    robot.change_urdf('<mass value="30"/>', '<mass value="-30"/>')
    robot.change_urdf('lower="-2" upper="2"', 'lower="-2" upper="nan"')
    robot.change_urdf('<mimic joint="right_finger_joint"', '<mimic joint="finger"')


@case(FILE, "7 problems", "(5)", "... and 2 more")
def more_problems_than_anybody_reads(robot: GoodRobot) -> None:
    text, count = re.subn(r'<mass value="', '<mass value="-', URDF)
    assert count > 6
    text = text.replace('<mass value="-30"', '<mass value="30"')
    robot.urdf.write_text(text, encoding="utf-8")
