"""Every platform type against its identities, finite differences and textbook formulas."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from math import cos, sin, tan

import numpy as np
import pinocchio as pin
import pytest
from support.differences import derivative, jacobian, relative
from support.platforms import ANGLES, ARM, LENGTH, PLATFORMS, R, W, on
from support.states import random_states

import mobman as mm
from mobman.errors import SpecError, UsageError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian, extended_kinematics
from mobman.model.platforms.platform import platforms
from mobman.model.task_map import TaskMap

MODULES = ("swerve", "multi-axle")
_SIDES = ("right", "left")
DRIVING = [name for name in PLATFORMS if name != "fixed"]


@pytest.fixture(scope="module", params=PLATFORMS)
def robot(request):
    return mm.load_robot(on(request.param))


@pytest.fixture(scope="module")
def robots():
    return {name: mm.load_robot(on(name)) for name in PLATFORMS}


def _platform_states(robot, count=50):
    """x and x' that obeys the constraints; steering angles away from a right one."""
    random = np.random.default_rng(12)
    l, p = len(robot.platform.coordinates), robot.n_alpha
    for _ in range(count):
        x = random.uniform(-1.0, 1.0, l)
        x[:3] *= 4.0
        yield x, robot.platform.velocity_map(x) @ random.standard_normal(p)


def test_all_types_are_here():
    covered = {content["type"] for content in PLATFORMS.values()}
    assert covered | {"custom"} == set(platforms.names())


def test_constraints_and_velocities(robot):
    platform = robot.platform
    for x, _ in _platform_states(robot):
        a, n = platform.constraint_matrix(x), platform.velocity_map(x)
        assert a.shape == (robot.k, len(x))
        assert n.shape == (len(x), robot.n_alpha)
        assert np.abs(a @ n).max(initial=0.0) < 1e-12 * max(1.0, np.abs(n).max(initial=0.0))
        if len(x):
            assert np.linalg.matrix_rank(a) == robot.k
            assert np.linalg.matrix_rank(n) == robot.n_alpha


def test_rates_and_derivatives(robot):
    platform = robot.platform
    random = np.random.default_rng(13)
    for x, x_dot in _platform_states(robot, 20):
        multiplier = random.standard_normal(robot.k)

        def along(function, x=x, d=x_dot):
            return derivative(lambda s: function(x + s * d), 1e-3)

        assert relative(platform.velocity_map_rate(x, x_dot), along(platform.velocity_map)) < 1e-8
        rate = platform.constraint_matrix_rate(x, x_dot)
        assert relative(rate, along(platform.constraint_matrix)) < 1e-8
        if not len(x):
            continue
        hessian = jacobian(lambda p, m=multiplier: platform.constraint_matrix(p).T @ m, x, 1e-3)
        assert relative(platform.constraint_hessian(x, multiplier), hessian) < 1e-8
        rate = along(lambda p, m=multiplier: platform.constraint_hessian(p, m))
        assert relative(platform.constraint_hessian_rate(x, x_dot, multiplier), rate) < 1e-8


def test_commands_belong_to_the_velocities(robot):
    """N^T B'' = I: the power of the commands is their product with alpha."""
    for x, _ in _platform_states(robot):
        product = robot.platform.velocity_map(x).T @ robot.platform.actuation(x)
        assert np.allclose(product, np.eye(robot.n_alpha), atol=1e-12)


def test_extended_jacobian_and_its_rate(robot):
    """p' = J z and its rate along the motion, against finite differences of f and of J."""
    criterion = Posture.of(robot)
    for q, z in random_states(robot, 5):
        q = robot.q_rest + 0.3 * (q - robot.q_rest) / max(1.0, np.abs(q).max())
        now = extended_kinematics(robot, TaskMap(), criterion, q, z)
        along = ExtendedJacobian(robot, TaskMap(), criterion)

        def at(s, q=q, z=z, along=along, start=now.complement):
            # the path q(s) with q' = C z, to third order
            moved = q.copy()
            steps = max(1, round(abs(s) / 1e-3))
            for _ in range(steps):
                h = s / steps
                half = robot.velocity_map(moved + 0.5 * h * robot.velocity_map(moved) @ z) @ z
                moved = moved + h * half
            along.complement[:] = start
            along.at(moved, z)
            return along.f.copy(), along.J @ z

        h = 1e-4
        (f1, r1), (f0, r0) = at(h), at(-h)
        expected = np.concatenate([now.f_e, now.f_a])
        assert np.allclose(0.5 * (f1 + f0), expected, atol=1e-5)
        assert relative((f1 - f0) / (2 * h), now.J @ z) < 1e-5
        assert relative((r1 - r0) / (2 * h), now.J_dot_z) < 1e-4


def test_wheels_stand_on_the_ground(robot):
    q = robot.q_rest
    pin.forwardKinematics(robot.model, robot.data, q)
    for wheel in robot.platform.wheels:
        centre = robot.data.oMi[robot.model.getJointId(wheel.joint)].translation
        assert np.isclose(centre[2], wheel.radius)


def test_rolling_wheels_touch_the_ground_without_slipping(robots):
    """The lowest point of each wheel that has no rollers does not move along the wheel."""
    for name in ("differential", "car-like", "turret"):
        robot = robots[name]
        for q, z in random_states(robot, 20):
            if name == "car-like":  # the knuckles turn alike
                first, second = (
                    robot.joint_names.index(f"steering_{s}") for s in ("right", "left")
                )
                q[second] = q[first]
            q_dot = robot.velocity_map(q) @ z
            pin.computeJointJacobians(robot.model, robot.data, q)
            for wheel in robot.platform.wheels:
                index = robot.model.getJointId(wheel.joint)
                columns = pin.getJointJacobian(
                    robot.model, robot.data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
                )
                twist = columns @ q_dot
                contact = twist[:3] + np.cross(twist[3:], [0.0, 0.0, -wheel.radius])
                axis = columns[3:, robot.model.joints[index].idx_v]
                along = np.cross(axis, [0.0, 0.0, 1.0])
                assert abs(contact @ along) < 1e-10


def contacts(robot, q, z):
    """Velocities of the wheels' lowest points (m/s), shape (w, 3)."""
    q_dot = robot.velocity_map(q) @ z
    pin.computeJointJacobians(robot.model, robot.data, q)
    found = []
    for wheel in robot.platform.wheels:
        index = robot.model.getJointId(wheel.joint)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        twist = pin.getJointJacobian(robot.model, robot.data, index, frame) @ q_dot
        found.append(twist[:3] + np.cross(twist[3:], [0.0, 0.0, -wheel.radius]))
    return np.array(found)


def test_a_turret_on_its_carriage_moves_in_every_direction(robots):
    """The body's velocity is any: det of its rows of N is R^2 a / (2 W), up to its sign."""
    robot = robots["turret"]
    for q, _ in random_states(robot, 20):
        n = robot.platform.velocity_map(q[robot.platform_index])[:3]
        assert np.isclose(abs(np.linalg.det(n)), R**2 * 0.11 / (2.0 * W))


def test_a_turret_over_the_axle_is_refused():
    with pytest.raises(SpecError, match=r"platform.offset' is 0.0000 m"):
        mm.load_robot(on("turret", offset=0.0))


@pytest.mark.parametrize("name", MODULES)
def test_steered_wheels_touch_the_ground_without_slipping_at_all(robots, name):
    robot = robots[name]
    for q, z in random_states(robot, 50):
        q = robot.consistent(q)
        speeds = np.abs(robot.velocity_map(q) @ z).max()
        assert np.abs(contacts(robot, q, z)).max() < 1e-12 * max(1.0, speeds)


@pytest.mark.parametrize("name", MODULES)
def test_steering_stays_consistent_along_a_motion(robots, name):
    """q' = C z keeps the axles meeting in one point: the constraints of steering integrate."""
    robot = robots[name]
    for q, z in random_states(robot, 5):
        q = robot.consistent(0.3 * q)
        moved = q + 1e-5 * (robot.velocity_map(q) @ z)
        middle = robot.consistent(0.5 * (q + moved))
        moved = q + 1e-5 * (robot.velocity_map(middle) @ z)
        assert np.allclose(robot.consistent(moved), moved, rtol=0.0, atol=1e-12)


def test_swerve_refuses_a_centre_of_rotation_on_a_steering_axis(robots):
    robot = robots["swerve"]
    q = robot.q_rest.copy()
    # ahead, with the centre of rotation at the front left module: the one at (L/2, W)
    q[robot.joint_names.index("travel_direction")] = np.arctan2(-0.5 * LENGTH, W)
    q[robot.joint_names.index("travel_curvature")] = 1.0 / np.hypot(0.5 * LENGTH, W)
    with pytest.raises(UsageError, match=r"centre of rotation .* 'steering_front_left'"):
        robot.consistent(q)


def test_an_axle_may_be_fixed_and_wheels_may_roll_without_a_motor(robots):
    """Against Ackermann's formula, and B'' has no torque where no motor is."""
    robot = robots["multi-axle"]
    platform, kappa = robot.platform, 0.8
    x = np.zeros(len(platform.coordinates))
    x[platform.coordinates.index("travel_curvature")] = kappa
    x = platform.consistent(x)
    for place, ahead in ((1, 0.5), (3, -0.3)):
        for side, y in (("right", -W), ("left", W)):
            angle = x[platform.coordinates.index(f"steering_{place}_{side}")]
            assert np.isclose(angle, np.arctan2(ahead, 1.0 / kappa - y))
    n = platform.velocity_map(x)[[platform.coordinates.index(f"wheel_2_{s}") for s in _SIDES], 0]
    assert np.allclose(n, [(1.0 + kappa * W) / R, (1.0 - kappa * W) / R])
    idle = [platform.coordinates.index(f"wheel_1_{side}") for side in _SIDES]
    B = platform.actuation(x)
    assert not B[idle].any()
    assert B[[platform.coordinates.index(f"wheel_3_{side}") for side in _SIDES], 0].all()


def test_an_axle_in_between_is_steered_around_where_none_is_fixed():
    """Four-wheel steering: front and rear turn opposite ways."""
    body = PLATFORMS["multi-axle"]["body"] | {"axles": [0.4, -0.4], "steered": [1, 2]}
    with pytest.raises(SpecError, match=r"'platform.axle' is missing"):
        mm.load_robot(on("multi-axle", body=body, driven=[]))
    robot = mm.load_robot(on("multi-axle", body=body, driven=[], axle=0.0))
    q = robot.q_rest.copy()
    q[robot.joint_names.index("travel_curvature")] = 0.5
    q = robot.consistent(q)
    front, rear = (q[robot.joint_names.index(f"steering_{i}_left")] for i in (1, 2))
    assert front > 0.1
    assert np.isclose(front, -rear)
    random = np.random.default_rng(3)
    for _ in range(10):
        z = random.standard_normal(robot.nz)
        assert np.abs(contacts(robot, q, z)).max() < 1e-12 * np.abs(robot.velocity_map(q) @ z).max()


def test_several_axles_steer_the_platform_round_a_circle():
    """With the coupling that `mobman robots add` writes; without one nothing asks for a curvature."""
    content = on("multi-axle")
    content["criterion"] |= {
        "heading": 1e-9,
        "weights": {"travel_curvature": 1e-3},
        "couplings": [
            {"joint": "travel_curvature", "to": "shoulder_pan_joint", "ratio": 1.8, "weight": 0.05}
        ],
    }
    robot = mm.load_robot(content)
    record = mm.simulate(robot, "tsm", "circle", duration=20.0, dt=4e-3)
    assert record.ok
    assert np.linalg.norm(record.task_error[-500:], axis=1).max() < 1e-8
    assert abs(record.q[-1, robot.joint_names.index("base_theta")]) > 2.0 * np.pi


@pytest.mark.parametrize(
    ("body", "own", "words"),
    [
        ({"axles": [0.5, 0.1, 0.0], "steered": [1]}, {}, "not steered, are .* allowed: one axle"),
        ({"axles": [0.5, 0.0], "steered": [1]}, {"axle": 0.3}, "'platform.axle' is 0.3 m"),
        ({"axles": [0.5, 0.5], "steered": [1]}, {}, "steering_1_right' is on the line of the axle"),
        ({"axles": [0.5, 0.0], "steered": [3]}, {}, "'platform.body.steered' is .*1 to 2"),
        ({"axles": [0.5, 0.0], "steered": [1]}, {"driven": ["a"]}, "'platform.driven' names 'a'"),
    ],
)
def test_axles_that_cannot_be_are_refused(body, own, words):
    whole = PLATFORMS["multi-axle"]["body"] | body
    with pytest.raises(SpecError, match=words):
        mm.load_robot(on("multi-axle", **{"driven": [], "body": whole, **own}))


def test_a_start_whose_axles_do_not_meet_is_refused(robots):
    robot = robots["swerve"]
    q = robot.q_rest.copy()
    q[robot.joint_names.index("steering_rear_right")] = 0.2
    with pytest.raises(UsageError, match=r"steering_rear_right is 0.2; allowed .* 0 "):
        mm.simulate(robot, "tsm", "circle", duration=0.01, q0=q)
    with pytest.raises(SpecError, match=r"\[rest\]: steering_rear_right is 0.2"):
        mm.load_robot({**on("swerve"), "rest": {"steering_rear_right": 0.2}})


def test_inertia_is_positive_and_the_arm_is_the_arm(robot):
    alone = mm.load_robot(
        {**on("fixed"), "platform": {"type": "fixed"}, "mount": [{**ARM, "parent": "platform"}]}
    )
    for q, z in random_states(robot, 10):
        dynamics = robot.dynamics(q, z)
        assert np.linalg.eigvalsh(dynamics.M)[0] > 0.0
        arm = q[robot.arm_index]
        block = dynamics.M[robot.n_alpha :, robot.n_alpha :]
        assert np.allclose(block, alone.dynamics(arm, np.zeros(alone.nz)).M, atol=1e-10)


def test_fixed_arm_is_pinocchios_own(robots):
    robot = robots["fixed"]
    assert (robot.nq, robot.nz, robot.k) == (6, 6, 0)
    for q, z in random_states(robot, 10):
        now = robot.dynamics(q, z)
        upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
        assert np.allclose(now.M, upper + np.triu(upper, 1).T)
        bias = pin.nonLinearEffects(robot.model, robot.model.createData(), q, z)
        assert np.allclose(now.bias, bias)
        assert np.array_equal(now.B, np.eye(6))


def test_unicycle(robots):
    n = robots["unicycle"].platform.velocity_map(np.array([1.0, 2.0, 0.7]))
    a, c, s = 0.1, cos(0.7), sin(0.7)
    assert np.allclose(n, [[c, -a * s], [s, a * c], [0.0, 1.0]])


def test_skid_steer_turns_as_a_differential_platform_with_the_effective_track(robots):
    n = robots["skid-steer"].platform.velocity_map(np.array([0.0, 0.0, 0.3, 0, 0, 0, 0]))
    assert np.allclose(n[2], [R / (2 * 1.5 * W), -R / (2 * 1.5 * W)])
    # both wheels of a side turn alike
    assert np.allclose(n[3:], [[1, 0], [1, 0], [0, 1], [0, 1]])


def test_mecanum_wheels_turn_as_in_the_textbooks(robots):
    """phi' = (v_x -+ v_y -+ (l_x + l_y) omega)/R for wheels whose contact rollers form an O."""
    platform = robots["mecanum"].platform
    assert [wheel.joint for wheel in platform.wheels] == [
        "wheel_front_left",
        "wheel_front_right",
        "wheel_rear_left",
        "wheel_rear_right",
    ]
    reach = 0.5 * LENGTH + W
    expected = np.array([[1, -1, -reach], [1, 1, reach], [1, 1, -reach], [1, -1, reach]]) / R
    assert np.allclose(platform.velocity_map(np.zeros(7))[3:], expected)


def test_omni_wheels_turn_as_in_the_textbooks(robots):
    """Wheel at angle b of the circle: |phi'| R = -sin(b) v_x + cos(b) v_y + W omega."""
    n = robots["omni"].platform.velocity_map(np.zeros(6))[3:]
    expected = np.array([[-sin(b), cos(b), W] for b in ANGLES]) / R
    signs = np.sign(np.sum(n * expected, axis=1))
    assert np.allclose(n, signs[:, None] * expected)


def test_car_turns_as_a_bicycle(robots):
    platform = robots["car-like"].platform
    delta = 0.35
    x = np.array([0.0, 0.0, 0.8, delta, delta, 0.0, 0.0, 0.0, 0.0])
    n = platform.velocity_map(x)
    assert np.allclose(n[:3, 0], [R * cos(0.8), R * sin(0.8), R * tan(delta) / LENGTH])
    assert np.allclose(n[3:5], [[0, 1], [0, 1]])
    turn = tan(delta) / LENGTH
    assert np.allclose(n[5:7, 0], [1 + W * turn, 1 - W * turn])
    # the circle of the middle front wheel has radius L/sin(delta); the front wheels' mean is its rate
    assert np.isclose(n[7:, 0].mean(), 1 / cos(delta))


def test_steering_is_absent_from_the_first_order_task_map(robots):
    """De Luca, Oriolo and Giordano: the tip's velocity does not depend on the steering rate."""
    robot = robots["car-like"]
    for q, _ in random_states(robot, 10):
        column = (robot.tip_jacobian(q) @ robot.velocity_map(q))[:3, 1]
        assert np.array_equal(column, np.zeros(3))


TURNED = [
    *(
        "differential",
        "skid-steer",
        "mecanum",
        "car-like",
        "unicycle",
        "planar",
        "swerve",
        "turret",
    ),
    "multi-axle",
]


@pytest.mark.parametrize("name", TURNED)
def test_forward_may_be_any_direction_of_the_root_link(name, tmp_path):
    """A root link turned under its platform: the heading says so, and the robot is the same."""
    own = mm.load_robot(on(name))
    # the same wheels seen from a root link whose x axis points to the right: forward is its y axis
    turned = mm.load_robot(_turned(name, tmp_path))
    order = [own.joint_names.index(joint) for joint in turned.joint_names]
    for q, z in random_states(own, 5):
        m, pose = own.dynamics(q, z).M, own.tip_pose(q).homogeneous
        assert np.allclose(turned.dynamics(q[order], z).M, m, atol=1e-9)
        assert np.allclose(turned.tip_pose(q[order]).homogeneous, pose, atol=1e-9)


def _turned(name, folder):
    """The platform as a URDF below a root link that is turned by a quarter."""
    content = on(name)
    kind = platforms.get(content["platform"]["type"])
    parameters = {k: v for k, v in content["platform"].items() if k != "type"}
    robot = kind.describe(parameters, "test")
    ET.SubElement(robot, "link", name="root")
    joint = ET.SubElement(robot, "joint", name="turn", type="fixed")
    ET.SubElement(joint, "parent", link="root")
    ET.SubElement(joint, "child", link="platform")
    ET.SubElement(joint, "origin", xyz="0 0 0", rpy=f"0 0 {np.pi / 2!r}")
    (folder / "turned.urdf").write_text(ET.tostring(robot, encoding="unicode"))
    platform = {k: v for k, v in content["platform"].items() if k != "body"}
    platform["heading"] = np.pi / 2
    ends, hands = ("front", "rear"), ("right", "left")
    platform |= {
        "differential": {"right_wheel": "wheel_right", "left_wheel": "wheel_left"},
        "skid-steer": {f"{hand}_wheels": [f"wheel_{end}_{hand}" for end in ends] for hand in hands},
        "omnidirectional": {
            "wheels": [f"wheel_{end}_{hand}" for end in ends for hand in ("left", "right")]
        },
        "car-like": {
            "rear_right_wheel": "wheel_rear_right",
            "rear_left_wheel": "wheel_rear_left",
            "steering": ["steering_right", "steering_left"],
            "front_wheels": ["wheel_front_right", "wheel_front_left"],
        },
        "swerve": {
            f"{field}": [f"{what}_{end}_{hand}" for end in ends for hand in ("left", "right")]
            for field, what in (("steering", "steering"), ("wheels", "wheel"))
        },
        "multi-axle": {
            field: [f"{what}_{i}_{side}" for i in axles for side in _SIDES]
            for field, what, axles in (
                ("steering", "steering", (1, 3)),
                ("wheels", "wheel", (1, 2, 3)),
            )
        },
        "turret": {"turret": "turret", "right_wheel": "wheel_right", "left_wheel": "wheel_left"},
    }.get(platform["type"], {})
    return {**content, "platform": platform, "urdf": {"path": "turned.urdf"}, "folder": folder}


def test_limits_of_the_wheels_are_limits_of_alpha():
    body = {**PLATFORMS["mecanum"]["body"], "wheel_velocity": 10.0, "wheel_effort": 4.0}
    robot = mm.load_robot(on("mecanum", body=body))
    limits = robot.limits
    reach = 0.5 * LENGTH + W
    assert np.allclose(limits.velocity[:3], [10 * R, 10 * R, 10 * R / reach])
    # forces shared by four motors
    assert np.allclose(limits.torque[:3], [16 / R, 16 / R, 16 * reach / R])
    assert np.all(np.isinf(limits.upper[:3]))
    assert np.allclose(limits.velocity[3:], robot.model.velocityLimit[robot.arm_index])


@pytest.mark.parametrize("name", DRIVING)
def test_law_drives_every_platform(robots, name):
    record = mm.simulate(robots[name], "tsm", "circle", duration=2.0)
    assert record.status == "ok"
    assert record.metrics["constraint_residual"] < 1e-12
    error = np.linalg.norm(record.task_error, axis=1)
    assert error[-1] < 0.05 * error[0]
