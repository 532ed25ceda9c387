"""The closed form of the extended Jacobian against derivatives of f itself, on every robot."""

from __future__ import annotations

import numpy as np
import pytest
from support.complements import aligned_kernel, kernel, stacked_jacobian
from support.differences import derivative, relative
from support.states import random_states

from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import auxiliary_coordinates, extended_kinematics
from mobman.model.task_map import TaskMap

# j j^T is nearly singular at some random configurations, where f_a bends sharply.
_STEP = 1e-3


@pytest.fixture(params=[(0, 1, 2), (0, 1)], ids=["position", "planar"])
def task_map(request):
    return TaskMap(request.param)


class Bowl:
    """A criterion with a Hessian that varies: F = sum of w_i (q_i^2/2 + q_i^4/12)."""

    def __init__(self, weights):
        self.weights = weights

    def value(self, q):
        return float(self.weights @ (q**2 / 2 + q**4 / 12))

    def gradient(self, q):
        return self.weights * (q + q**3 / 3)

    def hessian(self, q):
        return np.diag(self.weights * (1 + q**2))

    def hessian_rate(self, q, q_dot):
        return np.diag(self.weights * 2 * q * q_dot)


def _f(robot, task_map, criterion, q, reference):
    """f = (f_e, f_a) of (13), with the axes of f_a nearest to ``reference``."""
    complement = aligned_kernel(stacked_jacobian(robot, task_map.rows, q), reference)
    tip = np.array(robot.tip_pose(q).translation)[list(task_map.rows)]
    return np.concatenate((tip, complement @ criterion.gradient(q)))


SOME = pytest.mark.parametrize("number", [4, pytest.param(25, marks=pytest.mark.slow)])


@SOME
@pytest.mark.parametrize("kind", ["posture", "bowl"])
def test_extended_jacobian_is_the_derivative_of_f(robot, task_map, kind, number):
    criterion = _criterion(robot, kind)
    for q, z in random_states(robot, number, seed=21):
        found = extended_kinematics(robot, task_map, criterion, q, z)
        c = robot.velocity_map(q)
        columns = [
            derivative(
                lambda s, d=direction, q=q, n=found.complement: _f(
                    robot, task_map, criterion, q + s * d, n
                ),
                h=_STEP / max(1.0, np.abs(direction).max()),
            )
            for direction in c.T
        ]
        assert relative(found.J, np.array(columns).T) < 1e-6
        assert (
            relative(
                np.concatenate((found.f_e, found.f_a)),
                _f(robot, task_map, criterion, q, found.complement),
            )
            < 1e-10
        )


@SOME
@pytest.mark.parametrize("kind", ["posture", "bowl"])
def test_rate_of_the_extended_jacobian(robot, task_map, kind, number):
    """J' z at constant z, J being carried along the motion from its axes at s = 0."""
    criterion = _criterion(robot, kind)
    for q, z in random_states(robot, number, seed=22):
        found = extended_kinematics(robot, task_map, criterion, q, z)
        q_dot = robot.velocity_map(q) @ z

        def p_dot(s, q=q, z=z, d=q_dot, n=found.complement):
            here = q + s * d
            near = aligned_kernel(stacked_jacobian(robot, task_map.rows, here), n)
            return extended_kinematics(robot, task_map, criterion, here, z, near).J @ z

        expected = derivative(p_dot, h=_STEP / max(1.0, np.abs(q_dot[:3]).max()))
        assert relative(found.J_dot_z, expected) < 1e-6


def test_complement_spans_the_kernel_of_j(robot, task_map):
    for q, z in random_states(robot, 20):
        n = extended_kinematics(robot, task_map, Posture.of(robot), q, z).complement
        assert np.abs(n @ n.T - np.eye(robot.nz - task_map.m)).max() < 1e-12
        assert np.abs(stacked_jacobian(robot, task_map.rows, q) @ n.T).max() < 1e-12


@pytest.mark.parametrize("distance", [1e-9, 1e-4, 1e-2, 0.3])
def test_complement_is_carried_to_the_nearest_one(robot, distance):
    """From a tick before (where an iteration finds it) and from farther away (where an SVD does)."""
    task_map, criterion = TaskMap(), Posture.of(robot)
    random = np.random.default_rng(23)
    for q, z in random_states(robot, 10):
        step = random.standard_normal(robot.nq)
        start = kernel(stacked_jacobian(robot, task_map.rows, q))
        there = q + distance * step / np.linalg.norm(step)
        found = extended_kinematics(robot, task_map, criterion, there, z, start).complement
        expected = aligned_kernel(stacked_jacobian(robot, task_map.rows, there), start)
        assert np.abs(found - expected).max() < 1e-10


def test_a_complement_of_which_nothing_is_left_is_replaced(youbot):
    """Axes across ker j have no nearest ones in it: any of them are taken."""
    q = youbot.q_rest
    j = stacked_jacobian(youbot, (0, 1, 2), q)
    rows = len(q) - len(j)
    across = np.linalg.qr(j.T)[0].T[:rows]
    criterion, z = Posture.of(youbot), np.zeros(youbot.nz)
    found = extended_kinematics(youbot, TaskMap(), criterion, q, z, across).complement
    assert np.abs(j @ found.T).max() < 1e-12
    assert np.allclose(found @ found.T, np.eye(rows))


def test_what_matters_does_not_depend_on_the_axes(robot):
    """|f_a|, |J' z| of its rows and the singular values of J are the same in any axes."""
    task_map, criterion = TaskMap(), Posture.of(robot)
    random = np.random.default_rng(24)
    for q, z in random_states(robot, 10):
        one = extended_kinematics(robot, task_map, criterion, q, z)
        turn = np.linalg.qr(random.standard_normal((robot.nz - 3, robot.nz - 3)))[0]
        other = extended_kinematics(robot, task_map, criterion, q, z, turn @ one.complement)
        assert relative(other.f_a, turn @ one.f_a) < 1e-10
        assert relative(other.J_dot_z[3:], turn @ one.J_dot_z[3:]) < 1e-9
        singular = [np.linalg.svd(k.J, compute_uv=False) for k in (one, other)]
        assert relative(singular[0], singular[1]) < 1e-10


def test_auxiliary_coordinates_alone(robot):
    criterion = Posture.of(robot)
    for q, z in random_states(robot, 10):
        whole = extended_kinematics(robot, TaskMap(), criterion, q, z)
        f_a, complement = auxiliary_coordinates(robot, TaskMap(), criterion, q, whole.complement)
        assert np.allclose(f_a, whole.f_a, atol=1e-12)
        assert np.allclose(complement, whole.complement, atol=1e-12)
        fresh, _ = auxiliary_coordinates(robot, TaskMap(), criterion, q)
        assert np.isclose(np.linalg.norm(fresh), np.linalg.norm(f_a), atol=1e-12)


def test_auxiliary_coordinates_vanish_at_the_constrained_minimum(youbot):
    """At the rest posture dF/dq = 0; elsewhere it is not."""
    criterion = Posture.of(youbot)
    assert not auxiliary_coordinates(youbot, TaskMap(), criterion, youbot.q_rest)[0].any()
    moved = youbot.q_rest + 0.1
    assert np.linalg.norm(auxiliary_coordinates(youbot, TaskMap(), criterion, moved)[0]) > 1e-4


def _criterion(robot, kind):
    return Posture.of(robot) if kind == "posture" else Bowl(robot.criterion_weights)
