"""The checks on every platform type: nothing wrong with sound ones, and what only some types have."""

from __future__ import annotations

import math

import pytest
from support.variants import description

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.tasks.circle import Circle
from mobman.tasks.task import tasks

TYPES = [
    *("unicycle", "planar", "differential", "skid-steer", "car-like", "mecanum", "omni", "swerve"),
    *("turret", "fixed"),
]


def by_check(findings):
    return {item.check: item for item in findings}


@pytest.mark.parametrize("platform", TYPES)
def test_sound_robot_has_nothing_wrong(on_platform, platform):
    # a run on the others is one of tests/model/test_platform_types.py
    driven = platform in ("differential", "omni", "fixed")
    findings = run_checks(on_platform(platform), simulation=driven)
    allowed = {
        "car-like": {"limits", "criterion"},  # whose knuckles have no effort limits
        "swerve": {"limits", "criterion"},  # nor do its modules, which are held at rest too
        "turret": {"limits", "inertias"},  # nor does its turret, drawn in 0.16 litres
        "fixed": {"reach"},  # which may be too small for the circle
    }.get(platform, set())
    assert {item.check for item in findings if item.status != "ok"} <= allowed, findings
    assert all(item.status != "wrong" for item in findings), findings


def test_what_a_fixed_base_has_not_does_not_apply(on_platform):
    found = by_check(run_checks(on_platform("fixed"), simulation=False))
    for check in ("constraints", "ground", "wheel-radius", "meshes"):
        assert found[check].status == "ok"
        assert found[check].found.startswith("does not apply: ")
    for check in ("derivatives", "gravity", "inertias", "limits", "singularities"):
        assert not found[check].found.startswith("does not apply")


@pytest.fixture
def wide_circle(monkeypatch):
    """The task 'circle' is 1 m wide wherever the base may stand."""

    def wide(robot, q0):
        x, y, z = robot.tip_pose(q0).translation
        return Circle((x + 0.1, y + 0.5, z), 0.5, 0.5, -0.5 * math.pi)

    tasks.names()  # the package's own come first
    monkeypatch.setitem(tasks._items, "circle", wide)


@pytest.mark.usefixtures("wide_circle")
def test_arm_that_does_not_reach_the_circle_drives_a_smaller_one(on_platform):
    found = by_check(run_checks(on_platform("fixed"), only=["reach", "closed-loop"]))
    assert found["reach"].status == "warning"
    assert "points of the task 'circle' are out of reach" in found["reach"].found
    assert found["closed-loop"].status == "ok"
    assert "times as large" in found["closed-loop"].found


@pytest.mark.usefixtures("wide_circle")
def test_base_that_drives_reaches_the_same_circle(on_platform):
    found = by_check(run_checks(on_platform("differential"), only=["reach", "closed-loop"]))
    assert found["reach"].status == "ok"
    assert "times as large" not in found["closed-loop"].found


@pytest.fixture
def high_circle(monkeypatch):
    """The task 'circle' is out of every arm's reach, wherever the base may stand."""

    def high(robot, q0):
        x, y, z = robot.tip_pose(q0).translation
        return Circle((x, y, z + 6.0), 0.5, 0.5, -0.5 * math.pi)

    tasks.names()
    monkeypatch.setitem(tasks._items, "circle", high)


@pytest.mark.usefixtures("high_circle")
def test_base_that_drives_does_not_claim_what_it_cannot_know(on_platform):
    found = by_check(run_checks(on_platform("differential"), only=["reach", "closed-loop"]))
    assert found["reach"].status == "warning"
    assert "points of the task 'circle' were not found within reach" in found["reach"].found
    # a tenth of it is within reach: 0.6 m higher
    assert found["closed-loop"].status == "warning"


def test_run_on_a_small_circle_is_no_success_of_a_base_that_drives(on_platform, monkeypatch):
    from mobman.checks import closed_loop
    from mobman.checks.closed_loop import circle

    monkeypatch.setattr(
        closed_loop,
        "is_within_reach",
        lambda subject, path: path.radius < 0.3 * circle(subject).radius,
    )
    for platform, status in (("differential", "warning"), ("fixed", "ok")):
        found = by_check(run_checks(on_platform(platform), only=["closed-loop"]))
        assert found["closed-loop"].status == status, found
        assert "0.25 times as large" in found["closed-loop"].found


def test_car_without_couplings_never_steers(on_platform):
    car = on_platform("car-like")
    (finding,) = run_checks(car, only=["criterion"])
    assert finding.status == "warning"
    for word in ("the steering is held at rest", "'steering_right'", "'steering_left'"):
        assert word in finding.found
    assert "couple them to 'a1'" in finding.fix
    assert "docs/platforms.md#car-like" in finding.fix
    each_other = {"joint": "steering_left", "to": "steering_right", "ratio": 1.0, "weight": 0.02}
    for couplings, status in (
        ([each_other], "warning"),
        ([{**each_other, "to": "a1"}], "ok"),
    ):
        coupled = on_platform("car-like", criterion={"couplings": couplings})
        assert [item.status for item in run_checks(coupled, only=["criterion"])] == [status]


def test_steering_of_a_platform_of_ones_own_is_found_by_what_it_does(custom):
    (finding,) = run_checks(custom(TRICYCLE, lock="phi_2"), only=["criterion"])
    assert finding.status == "warning"
    assert "'phi_1'" in finding.found


@pytest.mark.parametrize("platform", ["differential", "mecanum", "fixed"])
def test_stretched_arm_is_singular(on_platform, platform):
    """A platform may move the tip where the arm cannot, but not up and down."""
    for bend, status in ((0.0, "wrong"), (0.005, "warning"), (0.5, "ok")):
        up = {"a2": 0.0, "a3": bend, "a4": 0.0, "a5": 0.0}
        found = run_checks(on_platform(platform, rest=up), only=["singularities"])
        assert [item.status for item in found] == [status], found
        assert status == "ok" or "[rest]" in found[0].fix


def test_arm_that_is_stretched_forward_is_singular_by_itself(on_platform):
    ahead = {"a2": 0.5 * math.pi, "a3": 0.0, "a4": 0.0, "a5": 0.0}
    (finding,) = run_checks(on_platform("differential", rest=ahead), only=["singularities"])
    assert finding.status == "warning"
    assert "the arm is singular at rest" in finding.found


def test_too_few_joints_for_the_tip(on_platform):
    found = by_check(run_checks(on_platform("fixed", joints=2)))
    for check in ("singularities", "closed-loop"):
        assert found[check].found.startswith("does not apply: 2 degrees of freedom")
    assert found["derivatives"].status == "ok"


@pytest.mark.parametrize("kind", ["unicycle", "planar"])
def test_platform_without_wheels_that_is_put_into_the_ground(on_platform, kind):
    body = {"mass": 40.0, "size": (0.6, 0.4, 0.2), "ground_clearance": 0.05}
    platform = {"type": kind, "body": body, "height": -0.15}
    (finding,) = run_checks(on_platform(platform), only=["ground"])
    assert finding.status == "wrong"
    assert "-100 mm" in finding.found
    assert "platform.height" in finding.fix


def test_steering_that_reaches_the_singularity(on_platform):
    platform = {
        "type": "car-like",
        "wheel_radius": 0.1,
        "half_track": 0.25,
        "wheelbase": 0.5,
        "body": {
            "mass": 40.0,
            "size": (0.6, 0.4, 0.2),
            "ground_clearance": 0.05,
            "wheel_mass": 1.5,
            "wheel_width": 0.05,
            "steering_limit": 1.5705,
            "knuckle_mass": 0.5,
        },
    }
    findings = run_checks(on_platform(platform), only=["limits"])
    steering = [item for item in findings if "steering joint" in item.found]
    assert len(steering) == 2
    assert all(item.status == "warning" and "singular" in item.found for item in steering)
    assert not any(
        "singular" in item.found for item in run_checks(on_platform("car-like"), only=["limits"])
    )


CUSTOM = """
import numpy as np

class Cart:
    coordinates = ("base_x", "base_y", "base_theta")
    velocity_names = ("v", "omega")
    root_offset = np.zeros(3)

    def constraint_matrix(self, x):
        return np.array([[np.sin(x[2]), -np.cos(x[2]), 0.0]])

    def velocity_map(self, x):
        return np.array([[np.cos(x[2]), 0.0], [np.sin(x[2]), 0.0], [0.0, 1.0]])
"""
SLIPPING = CUSTOM.replace(
    "return np.array([[np.cos(x[2]), 0.0]",
    "x = np.maximum(x, [-9.0, -9.0, 0.0])\n        return np.array([[np.cos(x[2]), 0.0]",
)
TRICYCLE = """
import numpy as np

class Cart:
    coordinates = ("base_x", "base_y", "base_theta", "phi_1")
    velocity_names = ("v", "delta_dot")
    root_offset = np.zeros(3)

    def constraint_matrix(self, x):
        t, d = x[2], x[3]
        rear = [np.sin(t), -np.cos(t), 0.0, 0.0]
        front = [np.sin(t + d), -np.cos(t + d), -np.cos(d), 0.0]
        return np.array([rear, front])

    def velocity_map(self, x):
        t, d = x[2], x[3]
        drive = [np.cos(t) * np.cos(d), np.sin(t) * np.cos(d), np.sin(d), 0.0]
        return np.array([drive, [0.0, 0.0, 0.0, 1.0]]).T
"""
WRONG_RATE = (
    CUSTOM
    + """
    def velocity_map_rate(self, x, x_dot):
        return np.zeros((3, 2))
"""
)


@pytest.fixture
def custom(tmp_path):
    """The youBot's body with its wheels held, on a platform of the user's own."""

    def make(text, lock="phi_*"):
        (tmp_path / "cart.py").write_text(text, encoding="utf-8")
        content = description(
            urdf__path=str(description()["folder"] / "youbot.urdf"), urdf__lock=[lock]
        )
        content["platform"] = {"type": "custom", "definition": "cart.py:Cart"}
        return mm.load_robot({**content, "folder": tmp_path})

    return make


def test_sound_custom_platform(custom):
    findings = run_checks(custom(CUSTOM))
    assert [item for item in findings if item.status == "wrong"] == []
    assert by_check(findings)["wheel-radius"].found.startswith("does not apply")


def test_custom_platform_that_breaks_its_constraints(custom):
    findings = run_checks(custom(SLIPPING), only=["constraints"])
    assert [item.status for item in findings] == ["wrong"]
    assert "A N is not 0" in findings[0].found
    assert "[platform]" in findings[0].fix


def test_custom_platform_with_a_wrong_rate(custom):
    (finding,) = run_checks(custom(WRONG_RATE), only=["derivatives"])
    assert finding.status == "wrong"
    assert "C' by" in finding.found
    assert "'custom'" in finding.fix
