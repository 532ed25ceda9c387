"""Kinematic singularities are reported as what they are."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.errors import SingularityError
from mobman.model.cholesky import Cholesky
from mobman.model.extended_jacobian import (
    auxiliary_coordinates,
    extended_kinematics,
    orthonormal_complement,
)
from mobman.model.task_map import TaskMap
from mobman.tasks.criteria.posture import Posture


@pytest.fixture
def upright(youbot):
    """The youBot's arm straight up: no motor moves the tip vertically."""
    q = youbot.q_rest.copy()
    q[youbot.joint_names.index("y_2")] = -np.pi / 2
    q[youbot.joint_names.index("y_3")] = 0.0
    return q


def test_j_without_full_rank_has_no_complement_of_the_right_size():
    with pytest.raises(SingularityError, match="kinematic singularity"):
        orthonormal_complement(np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]]))


def test_straight_arm_is_a_kinematic_singularity(youbot, upright):
    with pytest.raises(SingularityError, match="kinematic singularity"):
        extended_kinematics(youbot, TaskMap(), Posture.of(youbot), upright, np.zeros(youbot.nz))
    with pytest.raises(SingularityError, match="kinematic singularity"):
        auxiliary_coordinates(youbot, TaskMap(), Posture.of(youbot), upright)


def test_planar_task_does_not_mind_the_straight_arm(youbot, upright):
    found = extended_kinematics(
        youbot, TaskMap((0, 1)), Posture.of(youbot), upright, np.zeros(youbot.nz)
    )
    assert np.all(np.isfinite(found.J))


def test_cholesky_solves():
    random = np.random.default_rng(0)
    root = random.standard_normal((6, 6))
    matrix, right = root @ root.T + np.eye(6), random.standard_normal((6, 2))
    factor = Cholesky(matrix)
    assert np.allclose(matrix @ factor.solve(right), right, atol=1e-11)
    assert np.allclose(matrix @ factor.solve(right[:, 0]), right[:, 0], atol=1e-11)


def test_cholesky_reads_the_lower_triangle():
    matrix = np.array([[4.0, 99.0], [1.0, 3.0]])
    assert np.allclose(Cholesky(matrix).solve(np.array([5.0, 4.0])), [1.0, 1.0])


@pytest.mark.parametrize("last", [0.0, -1.0])
def test_cholesky_refuses_what_is_not_positive_definite(last):
    with pytest.raises(SingularityError, match="M is not positive definite"):
        Cholesky(np.diag([1.0, last]), "M")
