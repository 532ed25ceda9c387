"""Descriptions (TOML) that must be refused, and meshes, each with what the message must say."""

from __future__ import annotations

import os
import re

from cases import descriptions, meshes
from good_robot import MOUNT, TOML, URDF, GoodRobot

case = descriptions.case
FILE = "cart.toml"
ROBOT = "'cart'"

# The file


@case(FILE, "No such file")
def toml_is_not_there(robot: GoodRobot) -> None:
    robot.toml.unlink()


@case("mobman: there is no URDF in the folder ", FILE)
def toml_is_a_folder(robot: GoodRobot) -> None:
    """A folder is a robot if there is a URDF in it, whatever its name."""
    robot.toml.unlink()
    robot.toml.mkdir()


@case(FILE, "a device")
def toml_is_a_device(robot: GoodRobot) -> None:
    robot.toml.unlink()
    robot.toml.symlink_to("/dev/zero")


@case(FILE, "empty")
def toml_is_empty(robot: GoodRobot) -> None:
    robot.toml.write_bytes(b"")


@case(FILE, "'schema' is missing", "'name' is missing", "'platform' is missing", "'arm' is missing")
def toml_of_comments(robot: GoodRobot) -> None:
    robot.toml.write_text("# a robot\n", encoding="utf-8")


@case("mobman: the robot file ", FILE, "has 50 MB;", "allowed: 1 MB")
def toml_is_huge(robot: GoodRobot) -> None:
    os.truncate(robot.toml, 50_000_000)


@case(FILE, "not valid TOML", "line 1")
def toml_is_no_toml(robot: GoodRobot) -> None:
    robot.toml.write_text("robot: cart\n", encoding="utf-8")


@case(FILE, "not valid TOML", "XML")
def toml_is_a_urdf(robot: GoodRobot) -> None:
    robot.toml.write_bytes(robot.urdf.read_bytes())


@case(FILE, "not valid TOML", "byte 0xe9 in line 2", "UTF-8")
def toml_in_latin_1(robot: GoodRobot) -> None:
    robot.toml.write_bytes(TOML.replace('"cart"', '"cart\xe9"').encode("latin-1"))


@case(FILE, "not valid TOML", "UTF-8")
def toml_is_binary(robot: GoodRobot) -> None:
    robot.toml.write_bytes(bytes(range(256)))


@case(FILE, "not valid TOML", "nested")
def toml_nested_without_end(robot: GoodRobot) -> None:
    robot.toml.write_text("a = " + "[" * 100_000, encoding="utf-8")


@case(FILE, "not valid TOML", "line 3")
def toml_with_a_field_twice(robot: GoodRobot) -> None:
    robot.change_toml('name = "cart"', 'name = "cart"\nname = "wagon"')


@case(FILE, "not valid TOML", "digits")
def toml_with_a_number_without_end(robot: GoodRobot) -> None:
    robot.change_toml("wheel_radius = 0.1", f"wheel_radius = {'9' * 5000}")


# Its fields


@case(FILE, "'colour'", "unknown", "schema", "platform")
def unknown_key(robot: GoodRobot) -> None:
    robot.change_toml('name = "cart"', 'name = "cart"\ncolour = "red"')


@case(FILE, "'urdf.locks'", "unknown", "lock")
def unknown_key_of_a_table(robot: GoodRobot) -> None:
    robot.change_toml("lock = ", "locks = ")


@case(ROBOT, "[platform]", "'wheels_radius'", "unknown", "wheel_radius")
def unknown_key_of_the_platform(robot: GoodRobot) -> None:
    robot.change_toml("wheel_radius", "wheels_radius")


@case(FILE, "'name'", "5", "string")
def wrong_type(robot: GoodRobot) -> None:
    robot.change_toml('name = "cart"', "name = 5")


@case(FILE, "'urdf'", "'cart_description/urdf/cart.urdf'")
def path_in_place_of_a_table(robot: GoodRobot) -> None:
    table = TOML[TOML.index("[urdf]") : TOML.index("[platform]")]
    robot.change_toml(table, "")
    robot.change_toml('name = "cart"', 'name = "cart"\nurdf = "cart_description/urdf/cart.urdf"')


@case(ROBOT, "[platform]", "'wheel_radius'", "'0.1 m'", "number")
def number_with_a_unit(robot: GoodRobot) -> None:
    robot.change_toml("wheel_radius = 0.1", 'wheel_radius = "0.1 m"')


@case(ROBOT, "[platform]", "'wheel_radius'", "nan")
def number_that_is_nan(robot: GoodRobot) -> None:
    robot.change_toml("wheel_radius = 0.1", "wheel_radius = nan")


@case(ROBOT, "[platform]", "'wheel_radius'", "-0.1", "greater than 0")
def negative_radius(robot: GoodRobot) -> None:
    robot.change_toml("wheel_radius = 0.1", "wheel_radius = -0.1")


@case(FILE, "'rest.elbow'", "inf", "finite")
def infinite_rest(robot: GoodRobot) -> None:
    robot.change_toml("elbow = 0.6", "elbow = inf")


@case(FILE, "'arm' is missing")
def missing_table(robot: GoodRobot) -> None:
    robot.change_toml('[arm]\ntip = "tool"\n', "")


@case(FILE, "'platform.type' is missing")
def missing_type(robot: GoodRobot) -> None:
    robot.change_toml('type = "differential"\n', "")


@case(ROBOT, "'platform.type'", "'diferential'", "'differential'", "omnidirectional")
def unknown_type(robot: GoodRobot) -> None:
    robot.change_toml('"differential"', '"diferential"')


@case(FILE, "'schema'", "2", "1")
def schema_of_a_later_version(robot: GoodRobot) -> None:
    robot.change_toml("schema = 1", "schema = 2")


@case(FILE, "'schema' is missing")
def no_schema(robot: GoodRobot) -> None:
    robot.change_toml("schema = 1\n", "")


@case(ROBOT, "'urdf'", "'platform.body'")
def neither_urdf_nor_body(robot: GoodRobot) -> None:
    robot.change_toml(TOML[TOML.index("[urdf]") : TOML.index("[platform]")], "")


@case(ROBOT, "'urdf'", "'platform.body'", "one of them")
def both_urdf_and_body(robot: GoodRobot) -> None:
    body = (
        "[platform.body]\nmass = 30\nsize = [0.6, 0.4, 0.2]\nwheel_mass = 1\nwheel_width = 0.04\n"
    )
    robot.change_toml("[arm]", f"{body}\n[arm]")


FIXED = '[platform]\ntype = "fixed"\n\n'

# What it says of the URDF


@case(ROBOT, "'urdf.path'", "no.urdf")
def urdf_path_to_nothing(robot: GoodRobot) -> None:
    robot.change_toml("cart_description/urdf/cart.urdf", "no.urdf")


@case(ROBOT, "'urdf.packages'", "nowhere")
def packages_that_are_not_there(robot: GoodRobot) -> None:
    robot.change_toml("[urdf]", '[urdf]\npackages = ["nowhere"]')


@case(ROBOT, "'urdf.lock'", "'hand_*'", "elbow", "left_finger_joint")
def lock_that_matches_nothing(robot: GoodRobot) -> None:
    robot.change_toml('"*_finger_joint"', '"*_finger_joint", "hand_*"')


@case(ROBOT, "'urdf.lock'", "right_wheel_joint")
def locked_wheel(robot: GoodRobot) -> None:
    robot.change_toml('"*_finger_joint"', '"*_finger_joint", "right_wheel_joint"')


@case(ROBOT, "no joint is left for the arm", "'urdf.lock'")
def locked_arm(robot: GoodRobot) -> None:
    robot.change_toml('"*_finger_joint"', '"*_finger_joint", "lift", "shoulder", "elbow"')


@case(ROBOT, "'elbow' is its only joint", "two or more")
def one_joint_alone(robot: GoodRobot) -> None:
    robot.change_toml(TOML[TOML.index("[platform]") : TOML.index("[arm]")], FIXED)
    robot.change_toml("lift = 0.1", "")
    robot.change_toml('"*_finger_joint"', '"*_joint", "lift", "shoulder"')


@case(ROBOT, "'platform.left_wheel' is missing")
def missing_wheel(robot: GoodRobot) -> None:
    robot.change_toml('left_wheel = "left_wheel_joint"\n', "")


@case(ROBOT, "'platform.left_wheel'", "'left_wheel'", "left_wheel_joint")
def wheel_that_is_a_link(robot: GoodRobot) -> None:
    robot.change_toml('"left_wheel_joint"', '"left_wheel"')


@case(ROBOT, "'platform.left_wheel'", "'shoulder'", "axis", "y axis")
def wheel_that_is_the_arms(robot: GoodRobot) -> None:
    robot.change_toml('"left_wheel_joint"', '"shoulder"')


@case(ROBOT, "'platform.left_wheel'", "'left_wheel_joint'", "axis", "y axis")
def wheel_about_another_axis(robot: GoodRobot) -> None:
    robot.change_urdf(
        '<origin xyz="0 0.22 0.1" rpy="0 0 0"/>\n    <axis xyz="0 1 0"/>',
        '<origin xyz="0 0.22 0.1" rpy="0 0 0"/>\n    <axis xyz="0 0 1"/>',
    )


@case(ROBOT, "[platform]", "'left_wheel_joint'", "'right_wheel_joint'", "left one")
def wheels_mixed_up(robot: GoodRobot) -> None:
    robot.change_toml('right_wheel = "right_wheel_joint"', 'right_wheel = "left_wheel_joint"')
    robot.change_toml(
        'left_wheel = "left_wheel_joint"\nwheel', 'left_wheel = "right_wheel_joint"\nwheel'
    )


@case(ROBOT, "[platform]", "'right_wheel_joint'")
def one_wheel_twice(robot: GoodRobot) -> None:
    robot.change_toml('left_wheel = "left_wheel_joint"', 'left_wheel = "right_wheel_joint"')


@case(ROBOT, "'arm.tip'", "'hand'", "tool", "forearm")
def tip_that_is_not_there(robot: GoodRobot) -> None:
    robot.change_toml('tip = "tool"', 'tip = "hand"')


@case(ROBOT, "'arm.tip'", "'caster'", "no joint of the arm moves")
def tip_before_the_arm(robot: GoodRobot) -> None:
    robot.change_toml('tip = "tool"', 'tip = "caster"')


@case(ROBOT, "'rest'", "'wrist'", "elbow")
def rest_of_an_unknown_joint(robot: GoodRobot) -> None:
    robot.change_toml("elbow = 0.6", "wrist = 0.6")


@case(ROBOT, "'rest.elbow'", "90", "-2 to 2")
def rest_in_degrees(robot: GoodRobot) -> None:
    robot.change_toml("elbow = 0.6", "elbow = 90")


@case(ROBOT, "'rest.lift'", "150", "0 to 0.4")
def rest_in_millimetres(robot: GoodRobot) -> None:
    robot.change_toml("lift = 0.1", "lift = 150")


@case(ROBOT, "'criterion.weights'", "'wrist'")
def weight_of_an_unknown_joint(robot: GoodRobot) -> None:
    robot.toml.write_text(TOML + "[criterion]\nweights = { wrist = 1 }\n", encoding="utf-8")


@case(ROBOT, "not positive definite", "cart.urdf")
def urdf_without_masses(robot: GoodRobot) -> None:
    text = re.sub(r"<inertial>.*?</inertial>", "", URDF, flags=re.DOTALL)
    robot.urdf.write_text(text, encoding="utf-8")


@case(ROBOT, "left_finger_joint", "right_finger_joint", "in a circle", "<mimic>")
def joints_that_follow_each_other(robot: GoodRobot) -> None:
    robot.change_toml('lock = ["*_finger_joint"]', "lock = []")
    axis = '<axis xyz="0 -1 0"/>'
    robot.change_urdf(axis, f'{axis}<mimic joint="left_finger_joint"/>')


@case(ROBOT, "left_finger_joint", "of the platform", "urdf.lock")
def joint_that_follows_a_wheel(robot: GoodRobot) -> None:
    robot.change_toml('lock = ["*_finger_joint"]', 'lock = ["right_finger_joint"]')
    robot.change_urdf('<mimic joint="right_finger_joint"', '<mimic joint="right_wheel_joint"')


@case(ROBOT, "'base_theta'", "kept")
def joint_with_a_name_that_is_kept(robot: GoodRobot) -> None:
    robot.change_urdf('<joint name="tool_joint"', '<joint name="base_theta"')


@case("/dev/zero")
def urdf_is_a_device(robot: GoodRobot) -> None:
    robot.change_toml("cart_description/urdf/cart.urdf", "/dev/zero")


# Mounts


@case(ROBOT, "'mount[0].parent'", "'roof'", "base_link")
def mount_on_an_unknown_link(robot: GoodRobot) -> None:
    robot.mount()
    robot.change_toml('parent = "base_link"', 'parent = "roof"')


@case(ROBOT, "'mount[1].prefix'", "'boom_'", "twice", "another prefix")
def mounts_of_one_name(robot: GoodRobot) -> None:
    robot.mount()
    robot.toml.write_text(TOML + MOUNT + MOUNT, encoding="utf-8")


@case(ROBOT, "'mount[0].path'", "bom.urdf")
def mount_that_is_not_there(robot: GoodRobot) -> None:
    robot.mount()
    robot.change_toml('"boom.urdf"', '"bom.urdf"')


@case("boom.urdf", "joint 'pan'", "<limit> upper", "'one'")
def mount_with_a_broken_urdf(robot: GoodRobot) -> None:
    robot.mount()
    robot.change(robot.boom, 'upper="1"', 'upper="one"')


@case(FILE, "'mount.0.prefix'", "'a b'")
def mount_with_a_prefix_that_is_none(robot: GoodRobot) -> None:
    robot.mount()
    robot.change_toml('prefix = "boom_"', 'prefix = "a b"')


@case(FILE, "'mount.0.xyz")
def mount_at_two_numbers(robot: GoodRobot) -> None:
    robot.mount()
    robot.change_toml("xyz = [-0.2, 0, 0.25]", "xyz = [-0.2, 0]")


@case(FILE, "'mount'")
def mount_that_is_no_list(robot: GoodRobot) -> None:
    robot.mount()
    robot.change_toml("[[mount]]", "[mount]")


# Meshes

case = meshes.case
PACKAGE = (
    '<collision>\n      <geometry><mesh filename="package://cart_description/meshes/column.stl"/>'
)


def _mesh(robot: GoodRobot, filename: str) -> None:
    robot.change_urdf(PACKAGE, f'<collision>\n      <geometry><mesh filename="{filename}"/>')


@case("cart.urdf", "column.stl", "'column'", "missing in", "'urdf.packages'")
def mesh_that_is_not_there(robot: GoodRobot) -> None:
    robot.mesh.unlink()


@case("cart.urdf", "no package 'wagon_description'", "'column'", "'urdf.packages'")
def mesh_of_an_unknown_package(robot: GoodRobot) -> None:
    _mesh(robot, "package://wagon_description/meshes/column.stl")


@case("cart.urdf", "'package://cart_description/../boom.stl'", "outside its package")
def mesh_outside_its_package(robot: GoodRobot) -> None:
    (robot.folder / "boom.stl").write_bytes(robot.mesh.read_bytes())
    _mesh(robot, "package://cart_description/../boom.stl")


@case("cart.urdf", "https://", "package://")
def mesh_on_the_network(robot: GoodRobot) -> None:
    _mesh(robot, "https://localhost:1/column.stl")


@case("cart.urdf", "'.step'", "not read", ".stl, .dae, .obj")
def mesh_of_a_format_that_is_not_read(robot: GoodRobot) -> None:
    robot.mesh.with_suffix(".step").write_text("ISO-10303-21;", encoding="utf-8")
    _mesh(robot, "package://cart_description/meshes/column.step")


@case(ROBOT, "geometry", "column.stl")
def mesh_that_is_empty(robot: GoodRobot) -> None:
    robot.mesh.write_bytes(b"")
