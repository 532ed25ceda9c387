"""``mobman robots bounds``: w_1 to w_9, a and A hold, checked without their terms."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from support.command_line import mobman
from support.platforms import ARM, on

import mobman as mm
from mobman.controllers import tsm
from mobman.controllers.bounds import FLOOR, PAPER, SPREAD, computed_bounds
from mobman.errors import SingularityError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.tasks.task import task_map_of

STEP = 1e-5
ROBOTS = ("youbot", "lekiwi_so101", "hunter_ur10")


@cache
def bounds_of(name):
    robot = mm.load_robot(name)
    return computed_bounds(robot, mm.make_task("circle", robot))


@pytest.fixture(params=ROBOTS)
def computed(request):
    return mm.load_robot(request.param), bounds_of(request.param).values


def states(robot, number):
    """Random ones of the region, drawn otherwise than the bounds' own."""
    random = np.random.default_rng(99)
    for _ in range(number):
        q = robot.q_rest.copy()
        q[robot.arm_index] += random.uniform(-SPREAD, SPREAD, robot.n)
        q[:] = np.clip(q, robot.model.lowerPositionLimit, robot.model.upperPositionLimit)
        q[robot.joint_names.index("base_theta")] = random.uniform(-np.pi, np.pi)
        yield q, random


def equations(robot, q, z):
    """M, h and B of (17) from Pinocchio's own algorithms, C and C' by differences."""
    C = robot.velocity_map(q)
    ahead, behind = (robot.velocity_map(q + sign * STEP * C @ z) for sign in (1.0, -1.0))
    acceleration = (ahead - behind) @ z / (2.0 * STEP)
    data = robot.model.createData()
    h = C.T @ pin.rnea(robot.model, data, q, C @ z, acceleration)
    M = np.stack(
        [C.T @ pin.rnea(robot.model, data, q, C @ z, acceleration + column) - h for column in C.T],
        axis=1,
    )
    return M, h, C.T @ robot.actuation(q)


def test_chi_bounds_the_left_side_of_53(computed):
    """|B' v - M z'' terms + M x + M' S/2| <= chi, its rates by differences along a motion."""
    robot, w = computed
    ratios = []
    for q, random in states(robot, 40):
        z, z_dot, v, x, S = random.standard_normal((5, robot.nz)) * 10.0 ** random.uniform(
            -1, 1, (5, 1)
        )
        at = []
        for step in (-STEP, STEP):
            moved = q + step * robot.velocity_map(q) @ z
            at.append(equations(robot, moved, z + step * z_dot))
        M_dot, h_dot, B_dot = ((b - a) / (2.0 * STEP) for a, b in zip(*at, strict=True))
        M = equations(robot, q, z)[0]
        left = B_dot @ v - M_dot @ z_dot - h_dot + M @ x + M_dot @ S / 2.0
        norm = np.linalg.norm
        chi = (
            w["w_3"] * norm(v) * norm(z)
            + w["w_4"] * norm(z) ** 3
            + w["w_5"] * norm(z)
            + w["w_7"] * norm(x)
            + w["w_8"] * norm(z) * norm(S)
            + w["w_9"] * norm(z) * norm(z_dot)
        )
        ratios.append(norm(left) / chi)
    assert max(ratios) <= 1.0 + 1e-6
    assert max(ratios) > 0.01  # it is no empty bound


def test_a_and_A_lie_below_the_eigenvalues_and_w_1_w_2_above_J(computed):
    robot, w = computed
    task = mm.make_task("circle", robot)
    extended = ExtendedJacobian(robot, task_map_of(task), Posture.of(robot))
    for q, _ in states(robot, 40):
        extended.at(q, np.zeros(robot.nz))
        J = extended.J
        B = equations(robot, q, np.zeros(robot.nz))[2]
        assert 0.0 < w["a"] <= np.linalg.eigvalsh(J @ J.T)[0]
        assert 0.0 < w["A"] <= np.linalg.eigvalsh(B @ B.T)[0]
        assert np.linalg.norm(J) <= w["w_1"] + w["w_2"] * np.linalg.norm(q - robot.q_rest)


def test_w_7_is_the_largest_inertia_and_its_margin(youbot):
    w_7 = bounds_of("youbot").values["w_7"]
    rest = np.zeros(youbot.nz)
    largest = max(
        np.linalg.eigvalsh(equations(youbot, q, rest)[0])[-1] for q, _ in states(youbot, 300)
    )
    assert 1.1 * largest <= w_7 <= 1.12 * largest


def test_a_constant_B_needs_no_w_3(computed):
    robot, w = computed
    B = [equations(robot, q, np.zeros(robot.nz))[2] for q, _ in states(robot, 5)]
    constant = max(np.abs(one - B[0]).max() for one in B) < 1e-9
    assert (w["w_3"] == 0.0) == constant


def test_the_command_as_json_and_as_text(monkeypatch):
    given = []

    def known(robot, task):
        given.append((robot.name, task.name))
        return bounds_of("youbot")

    monkeypatch.setattr("mobman.controllers.bounds.computed_bounds", known)
    done = mobman("robots", "bounds", "youbot", "--json")
    assert done.returncode == 0, done.stderr
    content = json.loads(done.stdout)
    assert content["paper"] == PAPER
    assert given == [("youbot", "circle")]
    assert {name: content[name] for name in PAPER} == bounds_of("youbot").values
    gains = mm.make_controller("tsm").settings()
    assert all(gains[name] == PAPER[name] for name in PAPER if name.startswith("w_"))
    text = mobman("robots", "bounds", "youbot")
    assert text.returncode == 0, text.stderr
    row = next(line.split() for line in text.stdout.splitlines() if line.startswith("w_7"))
    assert row[1:3] == ["6", f"{content['w_7']:.3g}"]
    assert "95% confidence" in text.stdout
    assert ("No a > 0" in text.stdout) != bounds_of("youbot").regular


def test_where_J_is_singular_it_is_said(monkeypatch):
    """The search finds it; the samples alone do not."""
    bounds = bounds_of("lekiwi_so101")
    assert not bounds.regular
    assert bounds.found["a"] < FLOOR < bounds.sampled["a"]
    assert bounds.values["a"] == pytest.approx(bounds.sampled["a"] / 10.0)
    monkeypatch.setattr("mobman.controllers.bounds.computed_bounds", lambda robot, task: bounds)
    assert "No a > 0 holds" in mobman("robots", "bounds", "lekiwi_so101").stdout


def test_an_unknown_robot_is_status_2():
    done = mobman("robots", "bounds", "youbott")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "youbot" in done.stderr


def test_they_are_of_the_laws_criterion(monkeypatch):
    """J has its second rows from F: with the paper's weights, which the task has, and with a gain."""
    asked, robot = [], mm.load_robot("youbot")
    found = bounds_of("youbot")
    monkeypatch.setattr(tsm, "computed_bounds", lambda *given: asked.append(given) or found)
    for task, gains in (("paper", {}), ("circle", {"K_F": 0.3})):
        law = mm.make_controller("tsm", bounds="computed", **gains)
        law.reset(robot, mm.make_task(task, robot), 1e-3)
        assert asked[-1][2] is law.criterion
    assert np.all(asked[-1][2].weights == 0.3)
    lighter = computed_bounds(robot, mm.make_task("circle", robot), asked[-1][2]).values
    assert lighter["w_1"] != found.values["w_1"]
    assert lighter["w_7"] == found.values["w_7"]


@pytest.mark.parametrize("law", ["tsm", "tsm-null-space", "tsm-inverse-actuation"])
def test_a_law_takes_them(law, monkeypatch):
    """``tsm`` all of them, the others those of matrices that they have."""
    made: dict[str, float] = {"w_1": 4.0, "w_2": 0.0, "w_3": 0.5, "w_4": 7.0, "w_5": 8.0}
    made |= {"w_6": 1.0, "w_7": 9.0, "w_8": 2.0, "w_9": 3.0, "a": 1e-4, "A": 0.5}
    found = bounds_of("youbot")._replace(values=made)
    monkeypatch.setattr(tsm, "computed_bounds", lambda *_: found)
    explicit = {"discretization": "explicit"}  # inside the unit ball the implicit form needs none
    given, computed = (
        mm.simulate(
            "youbot",
            mm.make_controller(law, bounds=bounds, **explicit),
            "circle",
            duration=2e-3,
        )
        for bounds in ("given", "computed")
    )
    others = {"tsm": set(), "tsm-null-space": {"w_1", "w_2", "a"}, "tsm-inverse-actuation": {"A"}}
    for name, value in made.items():
        expected = given.settings[name] if name in others[law] else value
        assert computed.settings[name] == expected, name
    assert not np.array_equal(given.torque, computed.torque)


def test_a_robot_whose_tip_stays_in_a_plane_has_none():
    """Parallel axes: J is singular wherever it is looked at."""
    arm = {**ARM, "lock": ["shoulder_pan_joint", "wrist_2_joint", "wrist_3_joint"]}
    content = {**on("fixed"), "platform": {"type": "fixed"}, "mount": [], "rest": {}}
    urdf = {key: arm[key] for key in ("package", "path", "lock")}
    robot = mm.load_robot({**content, "urdf": urdf})
    with pytest.raises(SingularityError, match="'ur5_on_fixed': J exists at none of the sampled"):
        computed_bounds(robot, mm.make_task("circle", robot))
