"""Platforms described by their numbers with arms mounted on them, and the real youBot's URDF."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from support.variants import ROBOTS

import mobman as mm
from mobman.errors import SpecError
from mobman.robots.spec import read_spec
from mobman.robots.urdf.read import urdf_sources

SPECS = {path.stem: read_spec(path) for path in sorted(ROBOTS.glob("*.toml"))}
COMPOSED = [name for name, spec in SPECS.items() if spec.mount]
DRIVING = [name for name in COMPOSED if "wheel_radius" in SPECS[name].platform.parameters]

NEW = [*COMPOSED, "tiago_pro", "youbot_mecanum"]

UR5 = {"package": "example-robot-data", "path": "ur_description/urdf/ur5_robot.urdf"}
UR5_REST = {
    "shoulder_pan_joint": -0.2,
    "shoulder_lift_joint": -1.4,
    "elbow_joint": 1.7,
    "wrist_1_joint": -1.9,
    "wrist_2_joint": -1.57,
}


@pytest.fixture(scope="module", params=COMPOSED)
def composed(request):
    return mm.load_robot(request.param)


@pytest.fixture(scope="module", params=NEW)
def new(request):
    return mm.load_robot(request.param)


class Alone:
    """A mounted arm's URDF as Pinocchio reads it, without mobman."""

    def __init__(self, spec, index=0):
        self.mount = spec.mount[index]
        path = urdf_sources(spec).files[index].path
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.root = self.model.frames[1].name

    def move(self, angles):
        """To joint angles by name, without the prefix; 0 for the others."""
        model, tangent = self.model, np.zeros(self.model.nv)
        for name, angle in angles.items():
            tangent[model.joints[model.getJointId(name)].idx_v] = angle
        q = pin.integrate(model, pin.neutral(model), tangent)
        pin.framesForwardKinematics(model, self.data, q)

    def placement(self, link):
        """Of a link, in the frame of the root link."""
        return self.data.oMf[self.model.getFrameId(link, pin.FrameType.BODY)]

    def inertia(self):
        """Of all links, in the frame of the root link."""
        bodies = zip(self.data.oMi, self.model.inertias, strict=True)
        return sum((place.act(body) for place, body in bodies), pin.Inertia.Zero())

    def joints(self):
        return list(self.model.names)[1:]


@cache
def alone(name):
    return Alone(SPECS[name])


def placement(robot, link):
    """Of a link in the world, after :func:`move`."""
    return robot.data.oMf[robot.model.getFrameId(link, pin.FrameType.BODY)]


def move(robot, q):
    pin.framesForwardKinematics(robot.model, robot.data, q)


def mount_pose(mount):
    return pin.SE3(pin.rpy.rpyToMatrix(*mount.rpy), np.array(mount.xyz))


def body_of(robot):
    return robot.spec.platform.parameters["body"]


def platform_inertia(robot):
    """Of the box and the wheels at rest, in the frame of ``platform``, from the TOML's numbers."""
    body, parameters = body_of(robot), robot.spec.platform.parameters
    size, clearance = np.array(body["size"]), body.get("ground_clearance", 0.0)
    middle = np.array([*body.get("centre", (0.0, 0.0)), clearance + 0.5 * size[2]])
    moments = body.get("inertia") or box_moments(body["mass"], size)
    com = np.array(body.get("centre_of_mass", middle))
    total = pin.Inertia(body["mass"], com, np.diag(moments))
    if not robot.platform.wheels:
        return total
    R, m, width = parameters["wheel_radius"], body["wheel_mass"], body["wheel_width"]
    across, axle = m * (3.0 * R**2 + width**2) / 12.0, 0.5 * m * R**2
    wheel = pin.Inertia(m, np.zeros(3), np.diag([across, axle, across]))
    for centre in wheel_centres(robot):
        outward = np.arctan2(centre[1], centre[0]) - 0.5 * np.pi
        yaw = outward if parameters.get("kind") == "omni" else 0.0
        total += pin.SE3(pin.utils.rotate("z", yaw), centre).act(wheel)
    if (kind := robot.spec.platform.type) in ("car-like", "swerve"):
        m = body["knuckle_mass" if kind == "car-like" else "module_mass"]
        knuckle = pin.Inertia(m, np.zeros(3), np.diag(box_moments(m, np.array([0.4, 0.4, 1]) * R)))
        for centre in wheel_centres(robot)[2 if kind == "car-like" else 0 :]:
            total += pin.SE3(np.eye(3), centre).act(knuckle)
    return total


def box_moments(mass, size):
    x, y, z = np.square(size)
    return mass / 12.0 * np.array([y + z, x + z, x + y])


def wheel_centres(robot):
    """Where the TOML's numbers put the wheels' centres: right before left, front before rear (a car's
    rear before front)."""
    parameters, body = robot.spec.platform.parameters, body_of(robot)
    kind, R = parameters.get("kind", robot.spec.platform.type), parameters["wheel_radius"]
    if kind == "omni":
        c, angles = body["circle"], np.array(body["angles"])
        return np.column_stack([c * np.cos(angles), c * np.sin(angles), np.full(len(angles), R)])
    if kind == "car-like":
        L, W = parameters["wheelbase"], parameters["half_track"]
        return np.array([[x, y, R] for x in (0.0, L) for y in (-W, W)])
    W = body["half_track"] if kind in ("mecanum", "swerve") else parameters["half_track"]
    if "wheelbase" not in body:  # two wheels, on the axle
        return np.array([[0.0, y, R] for y in (-W, W)])
    L = body["wheelbase"]
    return np.array([[x, y, R] for x in (0.5 * L, -0.5 * L) for y in (-W, W)])


def nearest_first(points):
    """Points in an order that does not depend on the one they came in."""
    return points[np.lexsort(np.round(points, 6).T)]


def random_configurations(robot, count=10):
    """Anywhere on the ground, the arm within its limits (a turn, where it has none)."""
    random = np.random.default_rng(1)
    lower = np.maximum(robot.model.lowerPositionLimit, -np.pi)
    upper = np.minimum(robot.model.upperPositionLimit, np.pi)
    return random.uniform(lower, upper, size=(count, robot.nq))


def angles_of(robot, q, arm):
    """Of a mounted arm's joints in q, by their names in its URDF; locked ones at rest."""
    p = arm.mount.prefix
    moving = dict(zip(robot.joint_names, q, strict=True))
    return {name: moving.get(p + name, robot.spec.rest.get(p + name, 0.0)) for name in arm.joints()}


# Where things are ------------------------------------------------------------------------------


def test_arm_is_where_the_toml_says(composed):
    """On its parent, whatever the posture."""
    mount, root = composed.spec.mount[0], alone(composed.name).root
    for q in random_configurations(composed):
        move(composed, q)
        found = placement(composed, mount.parent).actInv(placement(composed, mount.prefix + root))
        assert np.allclose(found.homogeneous, mount_pose(mount).homogeneous, atol=1e-12)


def test_deck_is_the_top_of_the_box(composed):
    body = body_of(composed)
    move(composed, composed.q_rest)
    found = placement(composed, "platform").actInv(placement(composed, "deck"))
    height = body.get("ground_clearance", 0.0) + body["size"][2]
    assert np.allclose(found.translation, [*body.get("centre", (0, 0)), height], atol=1e-12)
    assert np.allclose(found.rotation, np.eye(3), atol=1e-12)
    assert np.isclose(placement(composed, "platform").translation[2], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", DRIVING)
def test_wheels_stand_on_the_ground_at_their_places(name):
    """Centres at the height R, at track and wheelbase, or on the circle."""
    robot = mm.load_robot(name)
    move(robot, robot.q_rest)
    radius = robot.spec.platform.parameters["wheel_radius"]
    ground = placement(robot, "platform")
    found = []
    for wheel in robot.platform.wheels:
        centre = robot.data.oMi[robot.model.getJointId(wheel.joint)].translation
        assert np.isclose(centre[2], radius, atol=1e-12)
        assert wheel.radius == radius
        found.append(ground.actInv(centre))
    assert np.allclose(
        nearest_first(np.array(found)), nearest_first(wheel_centres(robot)), atol=1e-12
    )


def test_nothing_of_the_robot_is_below_the_ground(new):
    move(new, new.q_rest)
    assert min(frame.translation[2] for frame in new.data.oMf) > -1e-9
    if body := new.spec.platform.parameters.get("body"):
        assert body.get("ground_clearance", 0.0) >= 0.0


def test_tip_at_rest_is_in_front_of_the_arms_base_and_above_the_ground(new):
    tip = new.tip_pose(new.q_rest).translation
    ahead = tip - new.arm_origin(new.q_rest)
    if new.name == "stretch":  # its telescope points to the right
        assert -ahead[1] > max(0.2, abs(ahead[0]))
    else:
        assert ahead[0] > (0.05 if new.name == "turtlebot3_omx" else 0.2)  # an arm of 0.38 m
        assert ahead[0] > abs(ahead[1])
    assert tip[2] > 0.1


def test_arm_at_rest_is_far_from_its_singular_postures(new):
    """The least singular value of the tip's Jacobian for the arm's joints, over the reach."""
    jacobian = new.tip_jacobian(new.q_rest)[:3][:, new.arm_index]
    tip = new.tip_pose(new.q_rest).translation
    reach = np.linalg.norm(tip - new.arm_origin(new.q_rest))
    assert np.linalg.svd(jacobian, compute_uv=False)[-1] > 0.25 * reach


# Masses and inertias ---------------------------------------------------------------------------


def test_inertia_is_the_platforms_and_the_arms(composed):
    """Mass, centre of mass and moments at rest, from the TOML's numbers and the arm's own URDF."""
    move(composed, composed.q_rest)
    expected = platform_inertia(composed)
    for index, mount in enumerate(composed.spec.mount):
        arm = Alone(composed.spec, index)
        arm.move(angles_of(composed, composed.q_rest, arm))
        parent = placement(composed, "platform").actInv(placement(composed, mount.parent))
        expected += (parent * mount_pose(mount)).act(arm.inertia())
    bodies = zip(composed.data.oMi, composed.model.inertias, strict=True)
    total = sum((place.act(body) for place, body in bodies), pin.Inertia.Zero())
    found = placement(composed, "platform").inverse().act(total)
    assert np.isclose(found.mass, expected.mass, rtol=1e-12)
    assert np.allclose(found.lever, expected.lever, atol=1e-9)
    assert np.allclose(found.inertia, expected.inertia, rtol=1e-9, atol=1e-9)


def test_arms_own_kinematics_are_unchanged(composed):
    """The tip from the arm's base, at random joint values, is that of the arm alone."""
    arm, mount = alone(composed.name), composed.spec.mount[0]
    for q in random_configurations(composed):
        arm.move(angles_of(composed, q, arm))
        move(composed, q)
        base = placement(composed, mount.prefix + arm.root)
        found = base.actInv(composed.tip_pose(q))
        expected = arm.placement(composed.tip.removeprefix(mount.prefix))
        assert np.allclose(found.homogeneous, expected.homogeneous, atol=1e-9)


def test_arms_limits_are_unchanged(composed):
    arm, mount = alone(composed.name), composed.spec.mount[0]
    for name in arm.joints():
        if not composed.model.existJointName(mount.prefix + name):
            continue  # locked
        there = arm.model.joints[arm.model.getJointId(name)]
        here = composed.model.joints[composed.model.getJointId(mount.prefix + name)]
        if there.nq == 1:  # two slots: without limits
            assert (
                composed.model.upperPositionLimit[here.idx_q]
                == (arm.model.upperPositionLimit[there.idx_q])
            )
        assert composed.model.effortLimit[here.idx_v] == arm.model.effortLimit[there.idx_v]


# Numbers that the makers publish ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "radius", "track", "wheelbase", "deck"),
    [
        ("husky_ur5", 0.1651, 0.5708, 0.512, 0.3837),
        ("husky_kinova", 0.1651, 0.5708, 0.512, 0.3837),
        ("jackal_z1", 0.098, 0.37559, 0.262, 0.2475),
        ("jackal_ur3", 0.098, 0.37559, 0.262, 0.2475),
        ("ridgeback_ur10", 0.0759, 0.551, 0.638, 0.3059),
        ("ridgeback_panda", 0.0759, 0.551, 0.638, 0.3059),
        ("hunter_ur10", 0.165, 0.605, 0.650, 0.38),
    ],
)
def test_sizes_are_the_makers(name, radius, track, wheelbase, deck):
    robot = mm.load_robot(name)
    move(robot, robot.q_rest)
    centres = np.array(
        [robot.data.oMi[robot.model.getJointId(w.joint)].translation for w in robot.platform.wheels]
    )
    assert {wheel.radius for wheel in robot.platform.wheels} == {radius}
    assert np.allclose(np.ptp(centres, axis=0), [wheelbase, track, 0.0], atol=1e-9)
    assert np.isclose(placement(robot, "deck").translation[2], deck, atol=1e-4)


@pytest.mark.parametrize(("name", "factor"), [("husky_ur5", 1.875), ("jackal_ur3", 1.5)])
def test_turning_on_the_spot_is_as_slow_as_the_makers_controller_says(name, factor):
    """wheel_separation_multiplier: rates -w, w of the sides turn it by 2 R w / (factor track)."""
    robot = mm.load_robot(name)
    z = np.zeros(robot.nz)
    z[:2] = 1.0, -1.0
    rate = robot.velocity(robot.q_rest, z).q_dot[robot.joint_names.index("base_theta")]
    parameters = robot.spec.platform.parameters
    expected = parameters["wheel_radius"] / (factor * parameters["half_track"])
    assert np.isclose(rate, expected, rtol=1e-12)


def test_lekiwis_wheels_turn_as_lerobot_says():
    """Wheels left, back, right: R phi' = -sin(a) v_x + cos(a) v_y + r omega at 60, 180, 300 degrees."""
    robot = mm.load_robot("lekiwi_so101")
    wheels = [robot.joint_names.index(wheel.joint) for wheel in robot.platform.wheels]
    angles = np.deg2rad([60.0, 180.0, 300.0])
    expected = np.column_stack([-np.sin(angles), np.cos(angles), np.full(3, 0.125)]) / 0.05
    found = robot.velocity_map(np.zeros(robot.nq))[np.ix_(wheels, [0, 1, 2])]
    signs = np.sign(found[:, 2])
    assert np.allclose(signs[:, None] * found, expected, atol=1e-12)


def test_mecanum_wheels_turn_as_the_standard_says():
    """Front left (v_x - v_y - (l_x + l_y) omega)/R and so on, as for rollers that form an X."""
    for name in ("ridgeback_ur10", "youbot_mecanum", "tiago_pro"):
        robot = mm.load_robot(name)
        move(robot, robot.q_rest)
        for wheel in robot.platform.wheels:
            place = robot.data.oMi[robot.model.getJointId(wheel.joint)].translation
            row = robot.velocity_map(robot.q_rest)[robot.joint_names.index(wheel.joint), :3]
            side, end = np.sign(place[1]), np.sign(place[0])
            arm = abs(place[0]) + abs(place[1])
            assert np.allclose(row * wheel.radius, [1.0, -side * end, -side * arm], atol=1e-5), (
                wheel.joint
            )


def test_hunters_steering_stays_within_its_limits():
    """And it does steer: the couplings move what the diagonal criterion would hold at rest."""
    robot = mm.load_robot("hunter_ur10")
    record = mm.simulate(robot, "tsm", "circle", duration=10.0, dt=5e-3)
    assert record.metrics["settling_time_1e-4"] < 5.0
    for name in ("steering_right", "steering_left"):
        angle = record.q[:, robot.joint_names.index(name)]
        limit = robot.model.upperPositionLimit[robot.joint_names.index(name)]
        assert limit == 0.461
        assert 1e-3 < np.abs(angle).max() < limit


# Two arms of one URDF --------------------------------------------------------------------------


def dual(right="right_", left="left_"):
    """Two UR5 on a Ridgeback, side by side, tilted outwards."""
    content = tomllib.loads((ROBOTS / "ridgeback_ur10.toml").read_text(encoding="utf-8"))
    mounts = [
        {**UR5, "prefix": prefix, "parent": "deck", "xyz": [0.1, y, 0.2], "rpy": [roll, 0.0, 0.3]}
        for prefix, y, roll in ((right, -0.25, 0.4), (left, 0.25, -0.4))
    ]
    rest = {prefix + name: angle for prefix in (right, left) for name, angle in UR5_REST.items()}
    return {
        **content,
        "name": "dual",
        "mount": mounts,
        "arm": {"tip": f"{right}tool0"},
        "rest": rest,
    }


def test_two_arms_of_one_urdf():
    """Every link and joint is there twice, under its prefix; each arm is where its mount says."""
    robot = mm.load_robot(dual())
    joints = [*UR5_REST, "wrist_3_joint"]
    assert [robot.joint_names[i] for i in robot.arm_index if "right_" in robot.joint_names[i]] == [
        f"right_{name}" for name in joints
    ]
    assert robot.n == 12
    arms = [Alone(robot.spec, i) for i in range(2)]
    for q in random_configurations(robot, 5):
        move(robot, q)
        for arm in arms:
            arm.move(angles_of(robot, q, arm))
            root = placement(robot, arm.mount.prefix + arm.root)
            at = placement(robot, "deck").actInv(root)
            assert np.allclose(at.homogeneous, mount_pose(arm.mount).homogeneous, atol=1e-12)
            tip = root.actInv(placement(robot, f"{arm.mount.prefix}tool0"))
            assert np.allclose(tip.homogeneous, arm.placement("tool0").homogeneous, atol=1e-9)


def test_the_other_arm_weighs_and_does_not_move_the_tip():
    robot, single = mm.load_robot(dual()), mm.load_robot("husky_ur5")
    left = [i for i, name in enumerate(robot.joint_names) if name.startswith("left_")]
    assert len(left) == 6
    assert not robot.tip_jacobian(robot.q_rest)[:, left].any()
    masses = dict(zip(robot.model.names, (i.mass for i in robot.model.inertias), strict=True))
    for name in (*UR5_REST, "wrist_3_joint"):
        own = single.model.inertias[single.model.getJointId(name)].mass
        assert masses[f"left_{name}"] == masses[f"right_{name}"] == own
    # the arms' own base links are part of the platform
    platform = body_of(robot)["mass"] + 2 * Alone(robot.spec).model.inertias[0].mass
    assert np.isclose(masses["base_theta"], platform)


def test_two_arms_of_one_urdf_need_prefixes():
    with pytest.raises(SpecError, match=r"'mount\[1\]\.prefix' is '', .*twice"):
        mm.load_robot(dual(right="", left=""))


def test_locked_joints_of_a_mount_are_those_of_its_own_urdf():
    """A pattern holds for the mount that has it, not for the other one."""
    content = dual()
    content["mount"][1]["lock"] = ["wrist_*"]
    names = mm.load_robot(content).joint_names
    assert not [name for name in names if name.startswith("left_wrist")]
    assert len([name for name in names if name.startswith("right_wrist")]) == 3


# The real youBot -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mecanum():
    return mm.load_robot("youbot_mecanum")


def test_youbots_masses(mecanum):
    """Base and four wheels, the fixed link of the arm, its five links and the gripper."""
    arm = {1: 1.390, 2: 1.318, 3: 0.821, 4: 0.769, 5: 0.687 + 0.219}
    masses = {
        name: mecanum.model.inertias[mecanum.model.getJointId(name)].mass
        for name in list(mecanum.model.names)[1:]
    }
    for i, mass in arm.items():
        assert np.isclose(masses[f"arm_joint_{i}"], mass)
    assert np.isclose(masses["base_theta"], 19.803 + 0.845)
    expected = 19.803 + 4 * 1.4 + 0.845 + sum(arm.values())
    assert np.isclose(pin.computeTotalMass(mecanum.model), expected)


def test_youbots_inertias_could_be_those_of_bodies(mecanum):
    """The largest principal moment is at most the sum of the others."""
    for body in list(mecanum.model.inertias)[1:]:
        if body.mass:
            moments = np.linalg.eigvalsh(body.inertia)
            assert moments[0] > 0.0
            assert moments[2] <= moments[0] + moments[1]


def test_youbots_arm_points_straight_up_at_zero(mecanum):
    """The lengths that KUKA gives: 0.147 to joint 2 with the mount, 0.155, 0.135, 0.218."""
    q = np.zeros(mecanum.nq)
    tip = mecanum.tip_pose(q)
    base = 0.0475 + 0.034 + 0.046
    height = base + 0.096 + 0.019 + 0.155 + 0.135 + 0.218
    assert np.allclose(tip.translation, [0.143 + 0.024 + 0.033 - 0.002, 0.0, height], atol=1e-12)
    assert np.allclose(tip.rotation, np.eye(3), atol=1e-12)
    axes = mecanum.tip_jacobian(q)[3:, mecanum.arm_index].T
    assert np.allclose(axes, [[0, 0, -1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 0, -1]], atol=1e-12)


def test_youbots_arm_reaches_ahead_when_stretched(mecanum):
    q = np.zeros(mecanum.nq)
    q[mecanum.joint_names.index("arm_joint_2")] = 0.5 * np.pi
    tip = mecanum.tip_pose(q).translation
    assert np.isclose(tip[0], 0.143 + 0.024 + 0.033 + 0.155 + 0.135 + 0.218, atol=1e-12)
    assert np.isclose(tip[2], 0.0475 + 0.034 + 0.046 + 0.096 + 0.019 + 0.002, atol=1e-12)


def test_youbots_wheels(mecanum):
    """As its driver has them: 0.47 by 0.30, radius 0.0475."""
    move(mecanum, mecanum.q_rest)
    found = {
        wheel.joint[-2:]: mecanum.data.oMi[mecanum.model.getJointId(wheel.joint)].translation
        for wheel in mecanum.platform.wheels
    }
    for name, x, y in (
        ("fl", 0.235, 0.15),
        ("fr", 0.235, -0.15),
        ("bl", -0.235, 0.15),
        ("br", -0.235, -0.15),
    ):
        assert np.allclose(found[name], [x, y, 0.0475], atol=1e-12)


def test_youbots_joint_limits_are_kukas(mecanum):
    degrees = {1: (-169, 169), 2: (-65, 90), 3: (-151, 146), 4: (-102.5, 102.5), 5: (-167.5, 167.5)}
    for i, limits in degrees.items():
        index = mecanum.joint_names.index(f"arm_joint_{i}")
        found = mecanum.model.lowerPositionLimit[index], mecanum.model.upperPositionLimit[index]
        assert np.allclose(np.rad2deg(found), limits, atol=0.01)


def test_tiago_pros_right_arm_does_the_task_and_the_left_one_is_its_mirror():
    robot = mm.load_robot("tiago_pro")
    assert robot.n == 15
    assert not [name for name in robot.joint_names if name.startswith(("head", "gripper"))]
    move(robot, robot.q_rest)
    right, left = (
        placement(robot, f"arm_{side}_tool_link").translation for side in ("right", "left")
    )
    assert np.allclose(right * [1.0, -1.0, 1.0], left, atol=5e-3)
    columns = robot.tip_jacobian(robot.q_rest)
    others = [i for i, name in enumerate(robot.joint_names) if name.startswith("arm_left")]
    assert not columns[:, others].any()
