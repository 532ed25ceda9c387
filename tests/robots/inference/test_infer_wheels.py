"""Wheels, the platform's type, forward and the radius."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made_urdf import (
    TURNED,
    Robot,
    box,
    car,
    cylinder,
    differential,
    four_wheels,
    mesh,
    sphere,
    three_omni_wheels,
    write_wheel_stl,
)

from mobman.robots.infer.findings import TYPES, Undecided


def locked(found, why):
    return {joint for lock in found.locks if why in lock.why for joint in lock.joints}


@pytest.mark.parametrize("local", TURNED)
def test_differential_whatever_the_local_axis(inferred, local):
    found = inferred(differential(local, track=0.36).arm(tip="tool0"))
    assert found.platform.type.value == "differential"
    assert found.fields["right_wheel"].value == "wheel_right_joint"
    assert found.fields["left_wheel"].value == "wheel_left_joint"
    assert found.fields["wheel_radius"].value == pytest.approx(0.1)
    assert "collision cylinder of wheel_right_joint_link" in found.fields["wheel_radius"].why
    assert found.platform.half_track == pytest.approx(0.18)
    assert "heading" not in found.fields


def test_wheels_without_names_and_with_wide_limits(inferred):
    robot = Robot()
    for name, y in (("j1", 0.2), ("j2", -0.2)):
        robot.link(f"l_{name}", collision=[robot.tyre(0.08)])
        robot.joint(
            name,
            "revolute",
            "base_link",
            f"l_{name}",
            (0, y, 0.08),
            axis="0 1 0",
            limits=(-1e5, 1e5),
        )
    found = inferred(robot.arm())
    assert (found.fields["right_wheel"].value, found.fields["left_wheel"].value) == ("j2", "j1")


def test_casters_are_locked_even_if_as_large_as_the_wheels(inferred):
    robot = differential()
    for name, x, y in (("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("bl", -0.2, 0.1), ("br", -0.2, -0.1)):
        robot.caster(f"{name}_caster", (x, y, 0.1), radius=0.1)
    found = inferred(robot.arm())
    assert found.platform.type.value == "differential"
    casters = {
        f"{end}_caster_{part}" for end in ("fl", "fr", "bl", "br") for part in ("swivel", "wheel")
    }
    assert locked(found, "casters") == casters


def test_a_trailer_is_no_caster(inferred):
    """Both its wheels are behind one joint, as those of a caster with two, but far apart."""
    robot = differential()
    for name, x, aside, radius in (("hitch", -0.4, 0.2, 0.1), ("fork", 0.3, 0.03, 0.04)):
        robot.link(name).joint(f"{name}_joint", "continuous", "base_link", name, (x, 0, radius))
        for side, y in (("r", -aside), ("l", aside)):
            tyre = [robot.tyre(radius)]
            robot.wheel(
                f"{name}_{side}", (-0.02 if x > 0 else -0.5, y, 0), parent=name, collision=tyre
            )
    found = inferred(robot.arm())
    assert locked(found, "trailer") == {"hitch_joint", "hitch_r", "hitch_l"}
    assert locked(found, "casters") == {"fork_joint", "fork_r", "fork_l"}


def test_smaller_wheels_in_parallel_do_not_drive(inferred):
    robot = differential()
    for side, y in (("r", -0.15), ("l", 0.15)):
        robot.wheel(f"small_{side}", (-0.3, y, 0.05), collision=[robot.tyre(0.05)])
    found = inferred(robot.arm())
    assert found.fields["right_wheel"].value == "wheel_right_joint"
    assert locked(found, "do not drive") == {"small_r", "small_l"}


def test_suspension_is_locked(inferred):
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.link(f"{side}_carrier")
        robot.joint(
            f"{side}_spring",
            "prismatic",
            "base_link",
            f"{side}_carrier",
            (0, y, 0.1),
            limits=(-0.01, 0.01),
        )
        robot.wheel(f"{side}_wheel", (0, 0, 0), parent=f"{side}_carrier")
    found = inferred(robot.arm())
    assert found.platform.type.value == "differential"
    assert locked(found, "suspension") == {"right_spring", "left_spring"}


@pytest.mark.parametrize(
    ("yaw", "heading"),
    [(0.0, None), (math.pi / 2, math.pi / 2), (math.pi, math.pi), (-math.pi / 2, -math.pi / 2)],
)
def test_forward_is_where_names_and_the_arm_say(inferred, yaw, heading):
    """The whole robot turned in its root link's frame."""
    robot = Robot(root="root", body=False)
    robot.link("base_link", collision=[box(0.5, 0.3, 0.1)])
    robot.joint("turned", "fixed", "root", "base_link", (0, 0, 0), (0, 0, yaw))
    robot.wheel("wheel_right_joint", (0, -0.2, 0.1)).wheel("wheel_left_joint", (0, 0.2, 0.1))
    found = inferred(robot.arm(tip="tool0"))
    assert found.fields["right_wheel"].value == "wheel_right_joint"
    assert (found.fields["heading"].value if heading is not None else None) == heading
    forward = np.array([math.cos(yaw), math.sin(yaw)])
    assert found.platform.forward.direction == pytest.approx(forward, abs=1e-9)


def test_which_way_is_forward_is_uncertain_without_names_and_arm(inferred):
    robot = Robot()
    for name, x in (("a", -0.2), ("b", 0.2)):
        robot.wheel(name, (x, 0, 0.1), yaw=math.pi / 2)
    found = inferred(robot.arm(xyz=(0, 0, 0.1)))
    assert abs(found.fields["heading"].value) == pytest.approx(math.pi / 2)
    assert any("--heading" in doubt for doubt in found.uncertain)


def test_heading_may_be_given(inferred):
    found = inferred(differential().arm(), heading=math.pi)
    assert found.fields["right_wheel"].value == "wheel_left_joint"
    assert found.fields["heading"].value == math.pi


def test_four_wheels_are_skid_steered_and_may_be_mecanum(inferred):
    found = inferred(four_wheels().arm())
    assert found.platform.type.value == "skid-steer"
    assert found.fields["right_wheels"].value == ["front_right_wheel", "rear_right_wheel"]
    assert found.fields["left_wheels"].value == ["front_left_wheel", "rear_left_wheel"]
    assert any("--platform omnidirectional" in doubt for doubt in found.uncertain)
    asked = inferred(four_wheels().arm(), platform="omnidirectional")
    assert asked.fields["kind"].value == "mecanum"


@pytest.mark.parametrize("where", ["mesh", "plug-in", "rollers", "one roller", "robot"])
def test_mecanum_by_what_names_say(inferred, where):
    robot = four_wheels()
    if where == "mesh":
        robot = four_wheels(
            collision=[Robot.tyre(0.1)], visual=[mesh("package://x/meshes/Mecanum_wheel.dae")]
        )
    elif where == "plug-in":
        gazebo = robot.xml.makeelement("gazebo", {})
        gazebo.append(robot.xml.makeelement("plugin", {"filename": "libgazebo_ros_planar_move.so"}))
        robot.xml.append(gazebo)
    elif where == "robot":
        robot.xml.set("name", "myOmniBase")
    else:
        count, out = (6, 0.09) if where == "rollers" else (1, 0.0)
        for end in ("front_right", "front_left", "rear_right", "rear_left"):
            for i in range(count):
                robot.link(f"{end}_roller_{i}", mass=0.01)
                robot.joint(
                    f"{end}_r{i}",
                    "continuous",
                    f"{end}_wheel_link",
                    f"{end}_roller_{i}",
                    (0, 0, out),
                    axis="1 1 0",
                )
    found = inferred(robot.arm())
    assert found.platform.type.value == "omnidirectional"
    assert found.fields["kind"].value == "mecanum"
    assert len(found.fields["wheels"].value) == 4
    assert found.platform.type.why


def test_three_omni_wheels(inferred):
    found = inferred(three_omni_wheels().arm())
    assert (found.platform.type.value, found.fields["kind"].value) == ("omnidirectional", "omni")
    assert set(found.fields["wheels"].value) == {"drive_0", "drive_1", "drive_2"}
    assert found.fields["wheel_radius"].value == pytest.approx(0.1)


def test_car(inferred):
    found = inferred(car().arm())
    assert found.platform.type.value == "car-like"
    values = {key: finding.value for key, finding in found.fields.items()}
    assert values["rear_right_wheel"] == "rear_right"
    assert values["rear_left_wheel"] == "rear_left"
    assert values["steering"] == ["right_steering", "left_steering"]
    assert values["front_wheels"] == ["front_right", "front_left"]


def test_steerable_wheels_only_ask_for_a_platform(inferred):
    robot = Robot()
    for x in (-0.2, 0.2):
        for y in (-0.2, 0.2):
            robot.caster(f"module_{x}_{y}", (x, y, 0.1), radius=0.1)
    with pytest.raises(
        Undecided, match=r"swivel or steer.*--platform omnidirectional.*--platform unicycle"
    ):
        inferred(robot.arm())


@pytest.mark.parametrize("kind", ["continuous", "revolute"])
@pytest.mark.parametrize("named", [False, True])
def test_modules_that_steer_and_roll_are_swerve(inferred, kind, named):
    robot, options = Robot(), {}
    limits = (-1.6, 1.6) if kind == "revolute" else None
    for i, (x, y) in enumerate([(0.3, 0.2), (-0.3, 0.2), (0.3, -0.2), (-0.3, -0.2)]):
        robot.link(f"fork_{i}")
        robot.joint(f"steer_{i}", kind, "base_link", f"fork_{i}", (x, y, 0.1), limits=limits)
        for side, left in (("a", 0.04), ("b", -0.04)):  # two wheels a module, as PR2's
            robot.wheel(f"roll_{i}_{side}_wheel", (0, left, 0), parent=f"fork_{i}")
    if named:
        options["wheels"] = tuple(f"roll_{i}_{s}_wheel" for i in range(4) for s in "ab")
        options["steering"] = tuple(f"steer_{i}" for i in range(4))
    robot.caster("back", (-0.4, 0, 0.04))
    found = inferred(robot.arm(), **options)
    assert found.platform.type.value == "swerve"
    assert set(found.fields["steering"].value) == {f"steer_{i}" for i in range(4)}
    assert len(found.fields["wheels"].value) == 8
    assert found.fields["wheel_radius"].value == pytest.approx(0.1)
    assert locked(found, "casters") == {"back_swivel", "back_wheel"}
    assert [(one.joint, one.to) for one in found.couplings] == [("travel_curvature", "arm_1_joint")]


def carriage(x: float) -> Robot:
    robot = Robot().link("turret").joint("roll", "continuous", "base_link", "turret", (0, 0, 0.1))
    for side, y in (("r", -0.2), ("l", 0.2)):
        robot.wheel(f"wheel_{side}", (x, y, 0), parent="turret")
    return robot.arm()


@pytest.mark.parametrize(
    "asked", [{}, {"platform": "turret", "right_wheels": ("wheel_r",), "left_wheels": ("wheel_l",)}]
)
def test_a_carriage_under_a_turret(inferred, asked):
    found = inferred(carriage(-0.1), **asked)
    assert found.platform.type.value == "turret"
    values = {name: fact.value for name, fact in found.fields.items()}
    assert values == {
        "turret": "roll",
        "right_wheel": "wheel_r",
        "left_wheel": "wheel_l",
        "wheel_radius": pytest.approx(0.1),
    }
    assert not found.locks


def test_a_turret_over_the_middle_of_its_wheels_is_locked(inferred):
    found = inferred(carriage(0.0))
    assert found.platform.type.value == "differential"
    assert locked(found, "turns the driven wheels") == {"roll"}
    assert any("roll" in doubt for doubt in found.uncertain)


def test_no_wheels_ask_and_name_the_candidates(inferred):
    robot = (
        Robot()
        .link("spinner")
        .joint("lidar_spin", "continuous", "base_link", "spinner", (0, 0, 0.3))
    )
    with pytest.raises(Undecided) as caught:
        inferred(robot.arm())
    words = ("--right-wheel", "--left-wheel", "--platform", "fixed", "unicycle", "planar")
    for word in (*words, "lidar_spin"):
        assert word in str(caught.value)


def test_a_mecanum_base_without_wheel_joints_is_planar(inferred):
    robot = Robot()
    robot.xml.set("name", "mecanum_base")
    found = inferred(robot.arm())
    assert found.platform.type.value == "planar"
    assert any("planar" in doubt and "mecanum_base" in doubt for doubt in found.uncertain)
    assert found.fields["centre"].value == [0.0, 0.0]


@pytest.mark.parametrize("platform", ["unicycle", "planar", "fixed"])
def test_platforms_without_wheels(inferred, platform):
    found = inferred(differential().caster("back", (-0.2, 0, 0.04)).arm(), platform=platform)
    assert found.platform.own == set()
    assert "wheel_radius" not in found.fields
    assert {"wheel_right_joint", "wheel_left_joint", "back_swivel"} <= {
        joint for lock in found.locks for joint in lock.joints
    }


def test_unicycle_stands_on_the_ground_of_its_wheels(inferred):
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (-0.1, y, -0.02))
    found = inferred(robot.arm(), platform="unicycle")
    assert found.fields["axle"].value == pytest.approx([-0.1, 0.0])
    assert found.fields["height"].value == pytest.approx(0.12)


def test_virtual_joints_in_front_of_the_base_are_locked(inferred):
    robot = Robot(root="world", body=False).link("x", mass=0).link("y", mass=0)
    robot.link("base_link", collision=[box(0.5, 0.3, 0.1)])
    robot.joint("to_x", "prismatic", "world", "x", (0, 0, 0), axis="1 0 0", limits=(-9, 9))
    robot.joint("to_y", "prismatic", "x", "y", (0, 0, 0), axis="0 1 0", limits=(-9, 9))
    robot.joint("to_theta", "continuous", "y", "base_link", (0, 0, 0))
    robot.wheel("right_wheel", (0, -0.2, 0.1)).wheel("left_wheel", (0, 0.2, 0.1))
    found = inferred(robot.arm())
    assert found.platform.type.value == "differential"
    assert locked(found, "virtual") == {"to_x", "to_y", "to_theta"}
    assert any("to_theta" in doubt for doubt in found.uncertain)


def test_radius_of_spheres_and_of_visual_geometry(inferred):
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        shape = {"collision": [sphere(0.09)]} if side == "right" else {"visual": [Robot.tyre(0.09)]}
        robot.wheel(f"{side}_wheel", (0, y, 0.09), **shape)
    assert inferred(robot.arm()).fields["wheel_radius"].value == pytest.approx(0.09)


@pytest.mark.parametrize(
    "reference", ["package://maker/wheels/w.stl", "wheels/w.stl", "../elsewhere/w.stl"]
)
def test_radius_of_a_mesh_with_a_scale(inferred, tmp_path, reference):
    files = {
        "package://maker/wheels/w.stl": tmp_path / "packages" / "maker" / "wheels" / "w.stl",
        "wheels/w.stl": tmp_path / "wheels" / "w.stl",
        "../elsewhere/w.stl": tmp_path / ".." / "elsewhere" / "w.stl",
    }
    write_wheel_stl(files[reference], radius=84.0, width=40.0)
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.07), "z", visual=[mesh(reference, scale=0.001)])
    found = inferred(robot.arm(), packages=[tmp_path / "packages"])
    assert found.fields["wheel_radius"].value == pytest.approx(0.084, abs=1e-4)
    assert "visual mesh" in found.fields["wheel_radius"].why


def no_geometry(root="base_link"):
    robot = Robot(root=root, body=False)
    if root != "base_link":
        robot.link("base_link").joint("base_fixed", "fixed", root, "base_link", (0, 0, 0.02))
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.06), visual=[mesh("package://nowhere/w.stl")])
    return robot


def test_radius_from_the_footprint_where_meshes_are_missing(inferred):
    found = inferred(no_geometry("base_footprint").arm())
    assert found.fields["wheel_radius"].value == pytest.approx(0.08)
    assert "base_footprint" in found.fields["wheel_radius"].why


def test_a_body_that_is_called_footprint_stands_on_the_ground(inferred):
    robot = Robot(root="base_footprint").arm(parent="base_footprint")
    assert inferred(robot, platform="planar").fields["height"].value == pytest.approx(0.05)


def test_radius_is_asked_for_where_nothing_tells(inferred):
    with pytest.raises(
        Undecided, match=r"package://nowhere/w.stl is missing.*--wheel-radius.*--package-path"
    ):
        inferred(no_geometry().arm())
    found = inferred(no_geometry().arm(), wheel_radius=0.07)
    assert found.fields["wheel_radius"].value == 0.07


def test_radius_of_a_hub_is_not_that_of_the_wheel(inferred, tmp_path):
    """Some meshes are there, the tyre's is not."""
    write_wheel_stl(tmp_path / "hub.stl", radius=0.03)
    robot = Robot(body=False)
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.1), "z", visual=[mesh("hub.stl"), mesh("tyre.stl")])
    with pytest.raises(Undecided, match=r"tyre.stl is not there"):
        inferred(robot.arm())


def test_radius_from_a_caster_is_uncertain(inferred):
    robot = Robot()
    robot.link("ball_caster", collision=[sphere(0.02)]).joint(
        "ball_caster_fixed", "fixed", "base_link", "ball_caster", (0.1, 0, -0.05)
    )
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.03), collision=[box(0.1, 0.04, 0.1)])
    found = inferred(robot.arm())
    assert found.fields["wheel_radius"].value == pytest.approx(0.1)
    assert any("radius" in doubt for doubt in found.uncertain)


def test_radius_is_never_guessed_from_what_has_ground_clearance(inferred):
    robot = Robot()
    robot.link("tray", collision=[box(0.02, 0.02, 0.02)]).joint(
        "tray_fixed", "fixed", "base_link", "tray", (0.1, 0, -0.06)
    )
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"{side}_wheel", (0, y, 0.03), collision=[box(0.1, 0.04, 0.1)])
    with pytest.raises(Undecided, match="--wheel-radius"):
        inferred(robot.arm())


def test_sources_that_disagree_are_named(inferred):
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(
            f"{side}_wheel", (0, y, 0.1), collision=[Robot.tyre(0.1)], visual=[Robot.tyre(0.11)]
        )
    found = inferred(robot.arm())
    assert found.fields["wheel_radius"].value == pytest.approx(0.1)
    assert "visual cylinder of right_wheel_link says 0.11" in found.fields["wheel_radius"].why
    assert any("wheel_radius" in doubt for doubt in found.uncertain)


def test_two_sources_outvote_the_first(inferred):
    robot = Robot(root="base_footprint", body=False).link("base_link")
    robot.joint("base_fixed", "fixed", "base_footprint", "base_link", (0, 0, 0.1))
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(
            f"{side}_wheel",
            (0, y, 0),
            collision=[cylinder(0.05, rpy=(math.pi / 2, 0, 0))],
            visual=[Robot.tyre(0.1)],
        )
    assert inferred(robot.arm()).fields["wheel_radius"].value == pytest.approx(0.1)


def test_wheels_may_be_named(inferred):
    found = inferred(
        four_wheels().arm(), right_wheels=("rear_right_wheel",), left_wheels=("rear_left_wheel",)
    )
    assert found.platform.type.value == "differential"
    assert locked(found, "do not drive") == {"front_right_wheel", "front_left_wheel"}


_ONE = ("front_right_wheel",)
_REAR = {"right_wheels": ("rear_right_wheel",), "left_wheels": ("rear_left_wheel",)}
_BOTH = {
    f"{side}_wheels": tuple(f"{end}_{side}_wheel" for end in ("front", "rear"))
    for side in ("right", "left")
}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"right_wheels": ("nothing",), "left_wheels": ("x",)},
            "--right-wheel 'nothing' is no movable joint",
        ),
        ({"right_wheels": ("front_right_wheel",)}, "give as many of each"),
        ({"wheels": ("front_right_wheel", "front_left_wheel")}, "three wheels or more"),
        ({"platform": "car-like"}, "--steering"),
        ({"platform": "differential"}, "name them by --right-wheel and --left-wheel"),
        (
            {"wheels": _ONE, **_REAR},
            "--wheel is for --platform omnidirectional or swerve or multi-axle",
        ),
        ({"wheels": ("arm_2_joint",), "platform": "differential"}, "differential: --right-wheel"),
        ({"wheels": _ONE * 2}, "--wheel names 'front_right_wheel' twice"),
        ({"right_wheels": _ONE, "left_wheels": _ONE}, "both name 'front_right_wheel'"),
        ({"wheels": ("arm_1_joint",)}, "'arm_1_joint' turns about no horizontal axis"),
        ({"platform": "differential", **_BOTH}, "differential: give one --right-wheel"),
        (
            {"platform": "car-like", **_REAR},
            "car-like: name --steering; candidates: front_right_wh",
        ),
        (
            {"platform": "turret", **_REAR},
            "no joint about the vertical carries both rear_right_wheel",
        ),
        (
            {"platform": "turret", "right_wheels": (), "wheels": ()},
            "two driven wheels; found front_",
        ),
        (
            {"platform": "swerve", "wheels": _ONE},
            "found wheels: front_right_wheel; steering joints: n",
        ),
        ({"steering": _ONE * 2, **_REAR}, "--steering names 'front_right_wheel' twice"),
        ({"lock": ("nothing_*",)}, "--lock 'nothing_\\*' matches no movable joint"),
        ({"lock": ("front_*",)}, "--lock matches the platform's own front_right_wheel"),
    ],
)
def test_options_that_do_not_fit(inferred, options, message):
    with pytest.raises(Undecided, match=message):
        inferred(four_wheels().arm(), **options)


@pytest.mark.parametrize(
    ("build", "options", "message"),
    [
        (
            differential,
            {"platform": "turret"},
            "no joint about the vertical carries a pair of driven",
        ),
        (Robot, {"platform": "skid-steer"}, "no pair of driven wheels was found"),
        (lambda: single_file(), {}, r"joints that may be wheels: ahead, behind\)"),
        (
            lambda: differential().arm(length=4.5),
            {},
            "would reach 18.15 m from a platform of 0.5 m",
        ),
    ],
)
def test_robots_that_do_not_fit(inferred, build, options, message):
    robot = build()
    with pytest.raises(Undecided, match=message):
        inferred(
            robot if robot.xml.find("link[@name='arm_1_link']") is not None else robot.arm(),
            **options,
        )


def single_file():
    return Robot().wheel("ahead", (0.3, 0, 0.1)).wheel("behind", (-0.3, 0, 0.1))


def test_wheels_on_swivels_may_be_taken_as_mecanum_wheels(inferred):
    robot = Robot()
    for i, (x, y) in enumerate([(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)]):
        robot.caster(f"module_{i}", (x, y, 0.1), radius=0.1)
    found = inferred(robot.arm(), platform="omnidirectional")
    assert len(found.fields["wheels"].value) == 4
    (doubt,) = found.uncertain
    assert "swivel the wheels; they are locked and the wheels taken as mecanum wheels" in doubt


def test_a_radius_that_is_far_from_that_of_the_geometry_is_uncertain(inferred):
    near = inferred(differential().arm(), wheel_radius=0.105)
    assert near.uncertain == ()
    far = inferred(differential().arm(), wheel_radius=0.115)
    assert far.fields["wheel_radius"].value == 0.115
    assert any("--wheel-radius" in doubt and "0.1 m" in doubt for doubt in far.uncertain)


def pair(radii=(0.1, 0.1), heights=(0.1, 0.1), lean=0.0):
    robot = Robot()
    for side, y, radius, height in zip(("right", "left"), (-0.2, 0.2), radii, heights, strict=True):
        link = f"{side}_link"
        robot.link(link, collision=[robot.tyre(radius)])
        robot.joint(
            side, "continuous", "base_link", link, (0, y, height), (lean, 0, 0), axis="0 1 0"
        )
    return robot.arm()


@pytest.mark.parametrize(
    ("options", "why", "nameable"),
    [
        ({"radii": (0.1, 0.09)}, "radii differ \\(0.1 and 0.09 m\\)", True),
        ({"lean": 0.05}, "0.05 and 0.05 rad from horizontal \\(camber\\)", False),
        ({"heights": (0.1, 0.12)}, "heights differ by 0.02 m", False),
    ],
)
def test_why_the_nearest_pair_was_not_taken(inferred, options, why, nameable):
    with pytest.raises(Undecided, match=f"right and left, was not taken: .*{why}") as caught:
        inferred(pair(**options))
    assert ("name them by --right-wheel" in str(caught.value)) == nameable
    if nameable:
        found = inferred(pair(**options), right_wheels=("right",), left_wheels=("left",))
        assert found.platform.type.value == "differential"


def test_joints_that_carry_the_arm_are_no_candidates(inferred):
    robot = Robot().link("shoulder")
    robot.joint("roll", "continuous", "base_link", "shoulder", (0, 0, 0.3), axis="0 1 0")
    with pytest.raises(Undecided, match="has no joint that could be named") as caught:
        inferred(robot.arm(parent="shoulder"))
    assert "roll" not in str(caught.value)


def test_omnidirectional_is_proposed_only_where_it_can_be(inferred):
    robot = four_wheels()
    for side, y in (("right", -0.25), ("left", 0.25)):
        robot.wheel(f"middle_{side}_wheel", (0, y, 0.1))  # rollers there have no default direction
    found = inferred(robot.arm())
    assert found.platform.type.value == "skid-steer"
    assert not any("omnidirectional" in doubt for doubt in found.uncertain)


def test_two_steerable_wheels_are_not_proposed_as_omnidirectional(inferred):
    robot = Robot()
    for y in (-0.2, 0.2):
        robot.caster(f"module_{y}", (0, y, 0.1), radius=0.1)
    with pytest.raises(Undecided, match=r"swivel or steer.*--platform unicycle") as caught:
        inferred(robot.arm())
    assert "omnidirectional" not in str(caught.value)


def test_what_steers_without_a_yaw_of_the_arm_is_uncertain(inferred):
    robot = car()
    parent = "base_link"
    for i in range(3):
        robot.link(f"l{i}")
        at = (0.2, 0, 0.3)
        robot.joint(f"j{i}", "revolute", parent, f"l{i}", at, axis="0 1 0", limits=(-2, 2))
        parent = f"l{i}"
    found = inferred(robot)
    assert found.couplings == ()
    assert any("couplings" in doubt for doubt in found.uncertain)


@pytest.mark.parametrize(("rpy", "ratio"), [((0, 0, 0), 1.0), ((math.pi, 0, 0), -1.0)])
def test_an_arm_whose_yaw_axis_points_down(inferred, rpy, ratio):
    robot = car().link("mount")
    robot.joint("mounted", "fixed", "base_link", "mount", (0.15, 0, 0.5), rpy)
    found = inferred(robot.arm(parent="mount"))
    assert [(one.to, one.ratio) for one in found.couplings] == [("arm_1_joint", ratio)] * 2


@pytest.mark.parametrize(("length", "alone"), [(0.2, False), (0.5, False), (0.6, True)])
def test_an_arm_that_would_turn_far_leaves_the_circle_to_the_car(inferred, length, alone):
    """The share of its yaw that is steered: half, or little if the arm goes round within 45 degrees."""
    found = inferred(car().arm(tip="tool0", length=length))
    assert all((one.weight < 0.01 * 0.05) == alone for one in found.couplings)
    assert all((one.weight == 0.05) == (not alone) for one in found.couplings)


@pytest.mark.parametrize(
    ("build", "like"),
    [
        (differential, "differential"),
        (four_wheels, "skid-steer"),
        (four_wheels, "omnidirectional"),
        (car, "car-like"),
        (four_wheels, "unicycle"),
    ],
)
def test_a_type_of_the_users_is_found_by_its_fields(inferred, build, like):
    """As the type that has the same ones."""
    robot = build().arm(tip="tool0")
    known = inferred(robot, platform=like)
    found = inferred(robot, platform="mine", types={"mine": TYPES[like]})
    assert found.platform.type.value == "mine"
    assert found.fields == known.fields
    assert found.platform.own == known.platform.own
    # an order of the fields of its own
    fields = inferred(robot, platform="mine", types={"mine": TYPES[like][::-1]}).fields
    assert list(fields) == [name for name in TYPES[like][::-1] if name in known.fields]


def test_a_front_wheel_with_toe_in_does_not_roll(inferred):
    robot = car()
    robot.xml.find("joint[@name='front_left']/origin").set("rpy", "0 0 0.017")
    found = inferred(robot.arm())
    assert found.platform.type.value == "car-like"
    assert "front_wheels" not in found.fields
    assert locked(found, "do not drive") == {"front_right", "front_left"}
    assert any("front_right, front_left are not parallel" in doubt for doubt in found.uncertain)


def test_steering_about_another_axis_is_told(inferred):
    found = inferred(car(axis="0 1 0").arm())
    assert found.platform.type.value == "differential"
    assert any("right_steering" in d and "about the vertical" in d for d in found.uncertain)


def test_one_wheel_of_an_axle_in_the_air_is_told(inferred):
    """The casters are the only pair on the ground then."""
    robot = Robot()
    for side, y in (("right", -0.2), ("left", 0.2)):
        robot.wheel(f"big_{side}", (0.2, y, 0.1), collision=[Robot.tyre(0.02 if y < 0 else 0.1)])
        robot.wheel(f"small_{side}", (-0.2, y, 0.05), collision=[Robot.tyre(0.05)])
    (doubt,) = (one for one in inferred(robot.arm()).uncertain if "big_left" in one)
    assert "big_right ends above the ground" in doubt
