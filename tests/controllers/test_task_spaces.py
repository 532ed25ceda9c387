"""The errors that laws drive to zero: values, rates, and axes that do not jump."""

from __future__ import annotations

import numpy as np
import pytest
from support.complements import aligned_kernel, stacked_jacobian
from support.differences import derivative, relative
from support.task_errors import errors_at

import mobman as mm
from mobman.controllers.task_errors import TaskSpace
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.task_map import TaskMap

ROWS = (0, 1, 2)


def _space(kind, robot, task):
    return TaskSpace(robot, task, None if kind == "tip" else Posture.of(robot))


@pytest.mark.parametrize("kind", ["tip", "extended"])
def test_rates_are_the_derivatives_along_the_motion(kind, robot):
    """e', and e'' = J z' + J' z - p_d'', along the motion and the task's own time."""
    task, random = mm.make_task("circle", robot), np.random.default_rng(90)
    for _ in range(5):
        q = robot.q_rest + 0.3 * random.standard_normal(robot.nq)
        z, z_dot = random.standard_normal((2, robot.nz))
        q_dot = robot.velocity_map(q) @ z
        space = _space(kind, robot, task)
        now = errors_at(space, 0.7, q, z)

        def at(s, q=q, z=z, d=q_dot, a=z_dot, space=space):
            # from the middle outwards and back: the axes are carried from call to call
            for part in (0.0, 0.5, 1.0):
                errors = errors_at(space, 0.7 + s, q + part * s * d, z + s * a)
            errors_at(space, 0.7, q, z)
            return errors

        h = 1e-3 / max(1.0, np.abs(q_dot[:3]).max())
        e_dot = derivative(lambda s, at=at: at(s).e, h)
        e_ddot = derivative(lambda s, at=at: at(s).e_dot, h)
        assert relative(now.e_dot, e_dot) < 1e-6
        assert relative(now.J @ z_dot + now.J_dot_z - now.p_ddot, e_ddot) < 1e-6
        p_dddot = derivative(lambda s, at=at: at(s).p_ddot, h)
        assert relative(now.p_dddot, p_dddot) < 1e-6


def test_sizes(robot):
    task, z = mm.make_task("circle", robot), np.zeros(robot.nz)
    for kind, p in (("tip", 3), ("extended", robot.nz)):
        space = _space(kind, robot, task)
        assert space.p == p
        errors = errors_at(space, 0.0, robot.q_rest, z)
        assert errors.J.shape == (p, robot.nz)
        assert {part.shape for part in errors if part.ndim == 1} == {(p,)}


def test_extended_errors_begin_with_the_tips(robot):
    task, random = mm.make_task("circle", robot), np.random.default_rng(91)
    q, z = robot.q_rest + 0.1, random.standard_normal(robot.nz)
    tip = errors_at(_space("tip", robot, task), 0.4, q, z)
    extended = errors_at(_space("extended", robot, task), 0.4, q, z)
    for whole, part in zip(extended, tip, strict=True):
        assert np.allclose(whole[:3], part, atol=1e-12)
    # p_d^a = 0
    assert not extended.p_ddot[3:].any()
    assert not extended.p_dddot[3:].any()


def test_axes_of_the_auxiliary_errors_are_carried_along(robot):
    """Over a long way in small steps; chosen anew at each, they would turn and jump."""
    task, criterion = mm.make_task("circle", robot), Posture.of(robot)
    space, z = _space("extended", robot, task), np.zeros(robot.nz)
    direction = np.random.default_rng(92).standard_normal(robot.nq)
    direction /= np.linalg.norm(direction)
    extended = ExtendedJacobian(robot, TaskMap(), criterion)
    extended.at(robot.q_rest, z)
    axes = extended.complement.copy()  # the first axes do not depend on who asks
    for distance in np.linspace(0.0, 1.0, 60):
        q = robot.q_rest + distance * direction
        axes = aligned_kernel(stacked_jacobian(robot, ROWS, q), axes)
        found = errors_at(space, 0.0, q, z).e[3:]
        assert np.allclose(found, axes @ criterion.gradient(q), atol=1e-10)
    fresh = errors_at(_space("extended", robot, task), 0.0, q, z).e[3:]
    assert np.isclose(np.linalg.norm(fresh), np.linalg.norm(found), atol=1e-10)
