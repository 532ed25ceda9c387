"""The quadratic program of whole-body-qp: its solution is the best one, and within the limits."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.optimize import nnls

import mobman as mm
from mobman.controllers.redundancy import JointBounds
from mobman.controllers.task_errors import TaskSpace
from mobman.model.criterion import Posture
from mobman.model.metric import base_metric, unit_stiffness

DT = 1e-3
# a robot a platform type, and every width of a task
CASES = [
    ("youbot", "circle"),
    ("hunter_ur10", "circle"),
    ("ridgeback_panda", "pose-circle"),
    ("ranger_xarm7", "circle"),
    ("fixed_panda", "pointing-circle"),
    ("tiago", "pose-circle"),
]


def _problem(robot, task, gains, q, z, limits):
    """Gradient of the cost at z', and (normal, value, bound) of all hard and soft bounds."""
    space = TaskSpace(robot, task)
    space.at(0.0, q, z)
    m, J = space.p, space.J
    e, e_dot = space.f - space.p_d[0, :m], J @ z - space.p_d[1, :m]
    wanted = space.p_d[2, :m] - gains.K_v * e_dot - gains.K_p * e - space.J_dot_z
    omega = base_metric(robot)
    criterion = Posture.of(robot)
    M, bias, B = robot.dynamics(q, z)
    C, q_dot, C_dot_z = robot.velocity(q, z)
    descent = gains.k_0 * unit_stiffness(robot, criterion) * omega * (C.T @ criterion.gradient(q))
    z_dot_0 = -gains.k_d * (z + descent)

    def gradient(z_dot):
        return J.T @ (J @ z_dot - wanted) + gains.rho * (z_dot - z_dot_0) / omega

    inverse = np.linalg.inv(B)
    bounds = JointBounds(robot, gains.kappa)
    least, largest = bounds.of(q, q_dot)
    hard = (inverse @ M, inverse @ bias, -limits, limits)
    soft = (C[bounds.joints], C_dot_z[bounds.joints], least, largest)
    return gradient, hard, soft


@pytest.mark.parametrize("tight", [False, True])
@pytest.mark.parametrize(("name", "task"), CASES)
def test_solution_is_the_best_one(name, task, tight):
    """The gradient of the cost is a combination, with factors >= 0, of the normals of active bounds."""
    robot, random = mm.load_robot(name), np.random.default_rng(3)
    task = mm.make_task(task, robot)
    M, bias, B = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    limits = np.full(robot.nz, np.inf)
    if tight:
        limits = (
            1.05 * np.abs(np.linalg.solve(B, bias)) + 0.05 * np.abs(np.linalg.solve(B, M)).max()
        )
    law = mm.make_controller("whole-body-qp", torque_limits=[x if tight else None for x in limits])
    active = 0
    for _ in range(4):
        law.reset(robot, task, DT)
        q = robot.consistent(robot.q_rest + 0.1 * random.standard_normal(robot.nq))
        z = 0.1 * random.standard_normal(robot.nz)
        v = law.step(0.0, q, z, np.zeros(robot.nz))
        gradient, hard, soft = _problem(robot, task, law.gains, q, z, limits)
        M, bias, B = robot.dynamics(q, z)
        z_dot = np.linalg.solve(M, B @ v - bias)
        assert (np.abs(v) <= limits).all()
        normals = []
        for A, drift, lower, upper in (hard, soft):
            value, scale = A @ z_dot + drift, 1e-6 * (1.0 + np.abs(A).sum(axis=1))
            normals += [*(A[value >= upper - scale]), *(-A[value <= lower + scale])]
        active += len(normals)
        g = gradient(z_dot)
        size = 1.0 + np.abs(gradient(np.zeros(robot.nz))).max()
        if not normals:
            assert np.abs(g).max() < 1e-7 * size
            continue
        unit = np.array([normal / np.linalg.norm(normal) for normal in normals])
        _, left = nnls(unit.T, -g)
        assert left < 1e-4 * size
    assert active > 0 or not tight


@pytest.mark.parametrize(
    ("name", "metric"), [("tiago_no_hand", "torque_limit_ratio"), ("hsr", "velocity_limit_ratio")]
)
def test_limits_hold_and_are_used(name, metric):
    """On robots whose motors, or wheels, are too weak for the start of the default circle."""
    record = mm.simulate(name, "whole-body-qp", "circle", duration=2.0, scenario="real-limits")
    assert record.ok
    assert record.metrics["torque_limit_ratio"] <= 1.0
    assert record.metrics["velocity_limit_ratio"] < 1.0 + 1e-3
    assert record.metrics["position_limit_excess"] < 1e-3
    assert record.metrics[metric] > 0.99
    assert record.metrics["task_error_final"] < 1e-3
    free = mm.simulate(name, "task-priority", "circle", duration=0.5)
    assert free.metrics[metric] > 1.3


@pytest.mark.parametrize(("name", "task"), CASES)
def test_there_is_always_a_torque(name, task):
    """Also beyond all limits, with motors that can hold nothing."""
    robot = mm.load_robot(name)
    task, limit = mm.make_task(task, robot), 1e-3
    law = mm.make_controller("whole-body-qp", torque_limits=limit)
    q = robot.q_rest.copy()
    for i in robot.arm_index[:2]:
        if np.isfinite(robot.limits.upper[i]):
            q[i] = robot.limits.upper[i] + 0.02
    q = robot.consistent(q)
    for z in (np.zeros(robot.nz), np.full(robot.nz, 20.0)):
        law.reset(robot, task, DT)
        v = law.step(0.0, q, z, np.zeros(robot.nz))
        assert np.isfinite(v).all()
        assert np.abs(v).max() <= limit


def test_joint_stops_before_its_limit():
    """A secondary task that pulls beyond it: exponential approach, and no overshoot."""
    robot = mm.load_robot("ridgeback_panda")
    joint = robot.joint_names.index("panda_joint1")
    limit = robot.limits.upper[joint]
    q0 = robot.q_rest.copy()
    q0[joint] = limit - 0.1
    robot.q_rest[joint] = limit + 0.5  # where the criterion wants it
    law = mm.make_controller("whole-body-qp", k_0=20.0)  # so that it is there by then
    record = mm.simulate(robot, law, "circle", duration=2.5, q0=q0)
    assert record.ok
    assert record.q[:, joint].max() < limit + 1e-5  # soft
    assert record.q[-1, joint] > limit - 0.02
    assert record.metrics["task_error_final"] < 1e-3


class Planar:
    """A point of the plane in motion."""

    def desired(self, t):
        return np.array([0.9 + 0.1 * t, 0.1]), np.array([0.1, 0.0]), np.zeros(2), np.zeros(2)


@pytest.mark.parametrize("law", ["whole-body-qp", "mpc"])
def test_robot_without_limits_in_the_plane(law, youbot):
    """No bound at all is a program, too."""
    model, none = youbot.model.copy(), np.zeros(youbot.nq)
    model.velocityLimit, model.effortLimit = none, none
    model.lowerPositionLimit, model.upperPositionLimit = none - 1e9, none + 1e9
    free = youbot.with_model(model)
    assert np.isinf(free.limits.torque).all()
    record = mm.simulate(free, law, Planar(), duration=1.0)
    assert record.ok
    errors = np.linalg.norm(record.task_error, axis=1)
    assert errors[-1] < 0.1 * errors[0]


def test_without_its_solver_the_law_is_listed_and_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    assert "whole-body-qp" in mm.list_controllers()
    with pytest.raises(mm.MobmanError, match=r"needs daqp.*pip install 'mobman\[qp\]'"):
        mm.make_controller("whole-body-qp")
