"""Model predictive control: its prediction, its program, limits, preview and period."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import mobman as mm
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import GainError

DT = 1e-3
# a robot a platform type, and every width of a task
CASES = [
    ("youbot", "circle"),
    ("hunter_ur10", "circle"),
    ("youbot_mecanum", "circle"),
    ("husky_ur5", "circle"),
    ("ridgeback_panda", "pose-circle"),
    ("ranger_xarm7", "circle"),
    ("fixed_panda", "pointing-circle"),
    ("tiago", "pose-circle"),
]


class Stay:
    """A point that the tip has to come to."""

    def __init__(self, point):
        self.point = point

    def desired(self, t):
        return self.point, np.zeros(3), np.zeros(3), np.zeros(3)


@pytest.mark.parametrize(("name", "task"), CASES)
def test_gradient_of_the_task_by_q(name, task):
    robot, random = mm.load_robot(name), np.random.default_rng(4)
    space = TaskSpace(robot, mm.make_task(task, robot))
    q = robot.q_rest + 0.1 * random.standard_normal(robot.nq)
    space.at(0.0, q, np.zeros(robot.nz))
    gradient, J, C = space.gradient(), space.J.copy(), robot.velocity_map(q)
    assert np.allclose(gradient @ C, J, atol=1e-12)
    direction, step, values = random.standard_normal(robot.nq), 1e-6, []
    for sign in (1.0, -1.0):
        space.at(0.0, q + sign * step * direction, np.zeros(robot.nz))
        values.append(space.f.copy())
    assert np.allclose((values[0] - values[1]) / (2.0 * step), gradient @ direction, atol=1e-7)


def _started(robot, task, **gains):
    """The law after its first tick, in motion."""
    law, random = mm.make_controller("mpc", **gains), np.random.default_rng(5)
    law.reset(robot, mm.make_task(task, robot) if isinstance(task, str) else task, DT)
    z = 0.2 * random.standard_normal(robot.nz)
    law.step(0.0, robot.q_rest, z, np.zeros(robot.nz))
    return law


@pytest.mark.parametrize(("name", "task"), CASES)
def test_derivatives_of_the_prediction(name, task):
    """By all accelerations, against differences: the middles of the intervals are linearised in q with
    the slope at their start, so that there is an error of the second order."""
    robot, random = mm.load_robot(name), np.random.default_rng(6)
    law = _started(robot, task)
    law._U = 0.3 * random.standard_normal(law._U.shape)
    nodes, direction, ends = law._predicted(), random.standard_normal(law._U.shape), []
    for sign in (1.0, -1.0):
        law._U += sign * 1e-6 * direction
        ends.append(law._predicted())
        law._U -= sign * 1e-6 * direction
    for node, one, other in zip(nodes, *ends, strict=True):
        for by, more, less in ((node.z_by_U, one.z, other.z), (node.q_by_U, one.q, other.q)):
            found, exact = by @ direction.ravel(), (more - less) / 2e-6
            assert np.abs(found - exact).max() <= 0.02 * np.abs(exact).max() + 1e-6


@pytest.mark.parametrize(("name", "task"), CASES)
def test_prediction_is_the_motion(name, task):
    """q' = C z and z' = u, integrated in small steps."""
    robot = mm.load_robot(name)
    law = _started(robot, task)
    nodes, q, now, start = law._predicted(), robot.q_rest.copy(), law._z_r.copy(), 0.0
    for end, U in zip(law._ends, law._U, strict=True):
        steps = 200
        dt = (end - start) / steps
        for _ in range(steps):
            middle = now + 0.5 * dt * law._root * U
            q_middle = q + 0.5 * dt * robot.velocity_map(q) @ middle
            q, now = q + dt * robot.velocity_map(q_middle) @ middle, now + dt * law._root * U
        start = end
    assert np.allclose(now, nodes[-1].z, atol=1e-12)
    moved = np.abs(q - robot.q_rest).max()
    assert np.abs(q - nodes[-1].q).max() < 0.02 * moved


@pytest.mark.parametrize(("name", "task"), CASES)
def test_cost_falls_to_its_least(name, task):
    """Iterations at one state: the cost falls, and from the end every other motion costs more."""
    robot, random = mm.load_robot(name), np.random.default_rng(7)
    law = _started(robot, task, torque_limits=1e9)
    costs = []
    for _ in range(12):
        step = law._improvement()
        costs.append(law.cost[0])
        law._U = law._U + step
    assert costs[-1] <= costs[0] * (1.0 + 1e-9)
    assert np.abs(step).max() < 1e-3 * np.abs(law._U).max()
    least, U = law.cost[0], law._U
    for _ in range(5):
        law._U = U + 0.05 * np.abs(U).max() * random.standard_normal(U.shape)
        law._improvement()
        assert law.cost[0] > least


@pytest.mark.parametrize("name", ["youbot", "tiago_no_hand", "ridgeback_panda"])
def test_cost_falls_along_the_motion(name):
    robot = mm.load_robot(name)
    point = np.array(robot.tip_pose(robot.q_rest).translation) + np.array([0.3, 0.2, 0.05])
    record = mm.simulate(robot, "mpc", Stay(point), duration=2.0)
    assert record.ok
    cost = record.signals["mpc/cost"][::500, 0]
    assert (np.diff(cost) < 0.0).all()
    assert cost[-1] < 0.05 * cost[0]
    errors = np.linalg.norm(record.task_error, axis=1)
    assert errors[-1] < 0.02 * errors[0]


@pytest.mark.parametrize("name", ["hsr", "tiago_no_hand", "turtlebot3_omx"])
def test_limits_hold(name):
    record = mm.simulate(name, "mpc", "circle", duration=1.5, scenario="real-limits")
    assert record.ok
    ratios = [record.metrics[f"{part}_limit_ratio"] for part in ("torque", "velocity")]
    assert max(ratios) > 0.99
    assert ratios[0] <= 1.0
    assert ratios[1] < 1.0 + 1e-3
    assert record.metrics["position_limit_excess"] < 1e-3


def test_it_looks_ahead(youbot):
    """What comes in 0.3 s changes its torque now, and nobody else's."""
    start = np.array(youbot.tip_pose(youbot.q_rest).translation)

    class Later(Stay):
        def desired(self, t):
            point = self.point if t < 0.3 else self.point + np.array([0.05, 0.0, 0.0])
            return point, np.zeros(3), np.zeros(3), np.zeros(3)

    state = (0.0, youbot.q_rest, np.zeros(youbot.nz), np.zeros(youbot.nz))
    for law, changed in (("mpc", True), ("whole-body-qp", False)):
        torques = []
        for task in (Stay(start), Later(start)):
            controller = mm.make_controller(law)
            controller.reset(youbot, task, DT)
            torques.append(controller.step(*state))
        assert (np.abs(torques[0] - torques[1]).max() > 1e-6) == changed
        assert ("preview" in controllers.get(law).uses) == changed


def test_it_asks_nothing_of_a_task_after_its_end(youbot):
    start, asked = np.array(youbot.tip_pose(youbot.q_rest).translation), []

    class Short(Stay):
        duration = 0.1

        def desired(self, t):
            asked.append(t)
            return super().desired(t)

    assert mm.simulate(youbot, "mpc", Short(start), duration=0.1).ok
    assert max(asked) == pytest.approx(0.1)


@pytest.mark.parametrize(("dt", "ticks"), [(1e-3, 20), (0.01, 2), (0.05, 1)])
def test_period(dt, ticks, youbot):
    law, solved = mm.make_controller("mpc"), []
    own = law.solve
    law.solve = lambda *given: solved.append(tick) or own(*given)
    law.reset(youbot, mm.make_task("circle", youbot), dt)
    for tick in range(41):
        law.step(tick * dt, youbot.q_rest, np.zeros(youbot.nz), np.zeros(youbot.nz))
    assert solved == list(range(0, 41, ticks))


def test_gains_that_are_refused():
    for gains, told in (
        ({"intervals": 1}, "whole number from 2 to 50"),
        ({"intervals": 2.5}, "whole number from 2 to 50"),
        ({"horizon": 0.02}, "must be above period"),
    ):
        with pytest.raises(GainError, match=told):
            mm.make_controller("mpc", **gains)


def test_without_its_solver_the_law_is_listed_and_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    assert "mpc" in mm.list_controllers()
    with pytest.raises(mm.MobmanError, match=r"needs daqp.*pip install 'mobman\[mpc\]'"):
        mm.make_controller("mpc")
