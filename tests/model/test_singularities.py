"""Kinematic singularities are reported as what they are."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.errors import SingularityError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import (
    auxiliary_coordinates,
    extended_kinematics,
    orthonormal_complement,
)
from mobman.model.task_map import TaskMap


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
