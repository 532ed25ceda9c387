"""Placements: the same for all laws, within the limits, and drawn again where trouble is foreseen."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.errors import UsageError
from mobman.simulation.placements import placements
from mobman.simulation.singularity import predict_singularity
from mobman.tasks.circle import Circle
from mobman.tasks.paths import place_of


def test_a_number_has_the_same_placement_whatever_else_is_asked_for(tiago):
    some, one = placements(tiago, range(4), seed=1), placements(tiago, [3], seed=1)
    assert np.array_equal(some[3].q0, one[3].q0)
    assert some[3].task == one[3].task
    assert some[2].task != some[3].task != placements(tiago, [3], seed=2)[3].task
    assert np.array_equal(some[0].q0, tiago.q_rest)
    assert some[0].task == mm.make_task("circle", tiago)
    assert some[0].parameters == {}


@pytest.mark.parametrize(
    "name", ["youbot", "youbot_mecanum", "hunter_ur10", "fixed_panda", "hsr", "ranger_xarm7"]
)
def test_it_starts_near_the_path_within_the_limits(name):
    robot = mm.load_robot(name)
    q0, parameters, circle = placements(robot, [1])[1]
    assert np.all(robot.model.lowerPositionLimit <= q0)
    assert np.all(q0 <= robot.model.upperPositionLimit)
    assert np.array_equal(q0, robot.consistent(q0))
    place = place_of(robot, q0)
    away = np.linalg.norm(place.tip - circle.desired(0.0)[0])
    assert away == pytest.approx(parameters["gap"])
    default = 0.1 if place.drives else 0.2 * circle.radius
    assert 0.5 * default <= away <= 2.0 * default
    assert 0.5 * place.size <= circle.radius <= 1.5 * place.size
    assert 0.3 <= abs(circle.rate) <= 0.6


def test_what_is_given_is_not_drawn(tiago):
    found = placements(tiago, [1, 2], "ellipse", {"length": 0.4})
    assert [set(p.parameters) for p in found.values()] == [{"length", "rate"}] * 2
    assert {p.parameters["length"] for p in found.values()} == {0.4}
    assert not np.array_equal(found[1].q0, found[2].q0)


def test_a_car_gets_no_circle_beside_it(hunter):
    x, y, z = hunter.tip_pose(hunter.q_rest).translation
    beside = predict_singularity(hunter, Circle((x, y + 2.5, z), 0.5, 0.5), duration=30.0)
    rest = predict_singularity(hunter, mm.make_task("circle", hunter), duration=0.1).sigma_tip[0]
    assert beside.singular is not None or beside.sigma_tip.min() < 0.25 * rest
    for q0, _, circle in placements(hunter, [1, 2, 3]).values():
        ahead = predict_singularity(hunter, circle, duration=2.0 * circle.period, q0=q0)
        assert ahead.singular is None
        assert ahead.sigma_tip.min() >= 0.25 * rest


def test_a_task_that_leads_to_a_singularity_on_purpose_is_placed(youbot):
    depth = {"depth": 0.05}
    rest, found = placements(youbot, [0, 1], "kinematic-singularity", depth).values()
    assert predict_singularity(youbot, rest.task, duration=6.0).singular is not None
    assert found.task != rest.task


def test_where_none_can_be_followed_it_is_said(monkeypatch):
    """Each draw has a circle behind the robot's back; the one at rest is given."""
    scope = placements.__globals__
    drawn = scope["_drawn"]
    monkeypatch.setitem(scope, "_DRAWS", 3)
    monkeypatch.setitem(scope, "_drawn", lambda r, t, _, random: drawn(r, t, {"gap": 3.0}, random))
    with pytest.raises(UsageError, match="none of 3 random starts of the task 'circle'"):
        placements(mm.load_robot("fixed_panda"), [1])


def test_the_solution_that_is_predicted_is_on_the_path_with_the_arm_at_rest():
    robot = mm.load_robot("jackal_ur3")
    task = mm.make_task("circle", robot)
    ahead = predict_singularity(robot, task, duration=10.0)
    assert len(ahead.q) == len(ahead.t)
    tip = robot.tip_pose(ahead.q[-1]).translation
    assert np.linalg.norm(tip - task.desired(ahead.t[-1])[0]) < 1e-3
    assert np.abs(ahead.q[-1] - robot.q_rest)[robot.arm_index].max() < 1e-3
    assert ahead.stiffness == pytest.approx(ahead.stiffness[0], rel=1e-3)


def test_stiffness_is_that_of_the_criterion_along_motions_that_leave_the_tip(youbot):
    """F along a curve in the null space of j has the second derivative d^T N (H + D) N^T d."""
    task = mm.make_task("circle", youbot)
    found = predict_singularity(youbot, task, duration=0.05).stiffness[0]
    weights, rest = youbot.criterion_weights, youbot.q_rest
    step, least = 1e-3, np.inf
    J = youbot.tip_jacobian(rest)[:3] @ youbot.velocity_map(rest)
    for z in np.linalg.svd(J)[2][3:]:
        energies = []
        for sign in (-1.0, 1.0):
            q = rest.copy()
            for _ in range(200):  # F's gradient is 0 at rest
                C = youbot.velocity_map(q)
                own = youbot.tip_jacobian(q)[:3] @ C
                q = q + sign * step / 200 * (C @ (z - np.linalg.pinv(own) @ own @ z))
            energies.append(0.5 * (q - rest) @ (weights * (q - rest)))
        least = min(least, sum(energies) / step**2)
    assert found <= least * (1.0 + 1e-2)  # the least over all directions
    assert found > 0.0


def test_a_fold_is_predicted():
    """With the paper's weights the wheels' angles drag the arm along until it folds."""
    robot = mm.load_robot("tiago_dual")
    task = mm.make_task("circle", robot)

    def left():
        sigma = predict_singularity(robot, task, duration=80.0).sigma_tip
        return sigma.min() / sigma[0]

    assert left() > 0.9
    for i, name in enumerate(robot.joint_names):
        robot.criterion_weights[i] = 0.001 if name.startswith("base_") else 0.05
    assert left() < 0.1


@pytest.fixture(scope="module")
def hunter():
    return mm.load_robot("hunter_ur10")


@pytest.mark.slow
@pytest.mark.parametrize("law", ["tsm", "tsm-null-space"])
def test_placements_hold_for_two_minutes(robot, law):
    placed = placements(robot, [1])[1]
    record = mm.simulate(robot, law, placed.task, q0=placed.q0, duration=120.0)
    assert record.status == "ok", record.message
    assert np.linalg.norm(record.task_error[-1]) < 1e-6
