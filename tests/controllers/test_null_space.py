"""``tsm-null-space``: its metric, and that it holds where the simplified law diverges."""

from __future__ import annotations

import numpy as np
import pytest
from support.states import random_states

import mobman as mm
from mobman.model.metric import base_metric


def test_the_metric_does_not_depend_on_the_choice_of_alpha(youbot):
    """C Omega C^T is of q', which wheel rates and the alpha of (5) describe alike."""
    fields = youbot.spec.model_dump(by_alias=True)
    fields["folder"] = youbot.spec.folder
    fields["platform"] |= {"alpha": "wheel-rates", **youbot.spec.platform.parameters}
    metrics = []
    for alpha in ("wheel-rates", "paper"):
        fields["platform"]["alpha"] = alpha
        robot = mm.load_robot(fields)
        C = robot.velocity_map(robot.q_rest)
        metrics.append(C @ np.diag(base_metric(robot)) @ C.T)
    assert np.allclose(*metrics, rtol=1e-12, atol=1e-12)


def test_the_metric_does_not_depend_on_where_the_robot_stands(robot):
    q, _ = next(random_states(robot, seed=3))
    at_rest, here = (robot.velocity_map(x)[:, : robot.n_alpha] for x in (robot.q_rest, q))
    omega = base_metric(robot)
    assert omega.shape == (robot.nz,)
    assert np.all(omega[robot.n_alpha :] == 1.0)
    if robot.platform.base_joints:
        index = [robot.joint_names.index(name) for name in robot.platform.base_joints]
        # the speed that an alpha gives the base depends on how the wheels are steered
        steers = robot.spec.platform.type in ("car-like", "swerve")
        for columns in (at_rest,) if steers else (at_rest, here):
            twist = columns[index] * np.array([[1.0], [1.0], [0.3]])
            speed = np.linalg.norm(twist, axis=0)
            moves = speed > 0.0  # a rate of steering moves nothing by itself
            assert moves.any()
            assert np.allclose(omega[: robot.n_alpha][moves], (0.3 * speed[moves]) ** -2)


def test_it_holds_where_the_simplified_law_diverges():
    record = mm.simulate("jackal_z1", "tsm-simplified", "circle", duration=4.0)
    assert record.status != "ok"
    record = mm.simulate("jackal_z1", "tsm-null-space", "circle", duration=4.0)
    assert record.status == "ok", record.message
    assert np.linalg.norm(record.task_error[-1]) < 1e-9


@pytest.mark.slow
def test_it_holds_on_every_robot(robot):
    record = mm.simulate(robot, "tsm-null-space", "circle", duration=15.0)
    assert record.status == "ok", record.message
    limit = 1e-8 if robot.spec.platform.type == "car-like" else 1e-9
    assert np.linalg.norm(record.task_error[-1]) < limit
