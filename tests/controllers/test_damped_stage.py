"""The damped kinematic stage: the same law where J is regular, and a passage where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from support.errors import largest_after

import mobman as mm
from mobman.controllers.damped import Damping, damp
from mobman.errors import GainError
from mobman.model.criterion import Posture
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.task_map import TaskMap


def _run(robot, task, duration, parameters=(), **gains):
    robot = mm.load_robot(robot)
    task = mm.make_task(task, robot, **dict(parameters))
    return mm.simulate(robot, mm.make_controller("tsm", **gains), task, duration=duration)


def test_damping_changes_nothing_where_there_is_nothing_to_damp():
    bare, damped = (_run("youbot", "circle", 1.0, damping=d) for d in (0.0, 1e-3))
    assert np.allclose(bare.q, damped.q, atol=1e-9)
    assert np.allclose(bare.torque, damped.torque, atol=1e-5 * np.abs(bare.torque).max())


def test_damping_follows_the_least_eigenvalues(youbot):
    """R = threshold - lambda_min, for J J^T and for J_e J_e^T, against numpy's."""
    random, m = np.random.default_rng(1), 3
    p = nz = youbot.nz
    own = Damping.of(1.0, (0.5, 0.7), p, nz)
    base, other = (youbot.q_rest + random.uniform(-0.3, 0.3, youbot.nq) for _ in range(2))
    complement = None
    for share in np.linspace(0.0, 1.0, 40):  # the iteration goes on along a motion
        q = base + share * (other - base)
        found = extended_kinematics(
            youbot, TaskMap(), Posture.of(youbot), q, np.zeros(nz), complement
        )
        complement, J = found.complement, found.J
        JJ, drift, v_ref, z = J @ J.T, np.zeros(p), random.normal(size=nz), random.normal(size=nz)
        damp(1e-3, JJ, drift, own, v_ref, J, z, m)
    least = [np.linalg.eigvalsh(J @ J.T)[0], np.linalg.eigvalsh((J @ J.T)[:m, :m])[0]]
    assert np.allclose(own.least, least, rtol=1e-2)
    R = np.array([max(0.0, 0.7 - own.least[1])] * m + [max(0.0, 0.5 - own.least[0])] * (p - m))
    assert np.allclose(own.R, R)
    assert np.allclose(JJ, J @ J.T + np.diag(R))
    assert np.allclose(drift, J @ own.y)


def test_algorithmic_singularity_is_passed_with_the_tip_on_its_path():
    # where the last bits do not decide whether the bare law gets through, as they do on other robots
    bare, damped = (
        _run("tiago_dual", "algorithmic-singularity", 10.0, damping=d) for d in (0.0, 10.0)
    )
    assert bare.status == "singular"
    assert damped.status == "ok"
    assert largest_after(damped, 0.0) < 1e-2
    assert largest_after(damped, 9.5) < 1e-6


def test_null_space_law_has_no_damped_stage():
    with pytest.raises(GainError, match="has no damped stage"):
        mm.make_controller("tsm-null-space", damping=1.0)


def test_explicit_form_has_no_damped_stage():
    with pytest.raises(GainError, match="damping"):
        mm.make_controller("tsm", damping=1.0, discretization="explicit")
