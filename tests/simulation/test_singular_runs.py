"""Runs that end at a singularity are told from loops that are unstable, and both are predicted."""

from __future__ import annotations

import numpy as np
import pytest
from support.variants import description

import mobman as mm
from mobman.checks.checks import run_checks
from mobman.controllers.gains import CriterionGains
from mobman.errors import SingularityError
from mobman.model.extended_jacobian import extended_kinematics
from mobman.model.task_map import TaskMap
from mobman.simulation.singularity import nearest_limit, predict_singularity


def _sigmas(robot, task, q):
    criterion = CriterionGains().criterion(robot, task)
    J = extended_kinematics(robot, TaskMap(), criterion, q, np.zeros(robot.nz)).J
    return {name: np.linalg.svd(part)[1][-1] for name, part in (("J", J), ("J_e", J[:3]))}


@pytest.fixture(scope="module")
def folded():
    """The solution of the extended task ends on this path, while the tip could go on."""
    robot = mm.load_robot("tiago_no_hand")
    task = mm.make_task("algorithmic-singularity", robot)
    return robot, task, mm.simulate(robot, "extended-jacobian", task, duration=6.0)


def test_fold_is_a_singularity_with_its_matrix_time_and_joint(folded):
    robot, task, record = folded
    assert record.status == "singular"
    found = record.singularity
    assert found["matrix"] == "J"
    tick = int(np.searchsorted(record.t, found["time"] - 1e-9))
    assert record.t[tick] == found["time"] < record.t[-1]
    # from then on below the bound, and not before; the tip's own rows are in good order
    assert _sigmas(robot, task, record.q[tick])["J"] < found["bound"]
    assert _sigmas(robot, task, record.q[tick - 1])["J"] >= found["bound"]
    assert _sigmas(robot, task, record.q[tick])["J_e"] > 10.0 * found["bound"]
    limits = robot.limits
    margins = dict(
        zip(
            robot.joint_names,
            np.minimum(record.q[tick] - limits.lower, limits.upper - record.q[tick]),
            strict=True,
        )
    )
    arm = [robot.joint_names[i] for i in robot.arm_index]
    assert margins[found["joint"]] == found["margin"] == min(margins[name] for name in arm)
    assert "sigma_min(J) = " in record.message
    assert f"{found['joint']} is " in record.message


def test_fold_is_predicted(folded):
    robot, task, record = folded
    found = predict_singularity(robot, task, duration=6.0)
    assert found.singular is not None
    assert found.singular.matrix == "J"
    assert abs(found.singular.time - record.t[-1]) < 0.5
    assert found.singular.joint == record.singularity["joint"]
    assert found.sigma[0] == pytest.approx(_sigmas(robot, task, robot.q_rest)["J"], rel=1e-6)


def test_what_is_known_of_a_singularity_is_in_the_file(folded, tmp_path):
    _, _, record = folded
    assert mm.load_record(record.save(tmp_path / "run.h5")).singularity == record.singularity
    fine = mm.simulate("youbot", "extended-jacobian", "circle", duration=0.02)
    assert fine.singularity == {}
    assert mm.load_record(fine.save(tmp_path / "fine.h5")).singularity == {}


def test_point_out_of_reach_is_a_singularity_of_the_tips_jacobian():
    robot = mm.load_robot("youbot")
    task = mm.make_task("kinematic-singularity", robot, depth=0.05)
    record = mm.simulate(robot, "pseudo-inverse", task, duration=6.0)
    assert record.status == "singular"
    assert record.singularity["matrix"] == "J_e"
    found = predict_singularity(robot, task, duration=6.0).singular
    assert found is not None
    assert found.matrix == "J_e"
    assert abs(found.time - record.t[-1]) < 0.5


@pytest.mark.parametrize(
    ("gains", "delay"),
    [
        ({"discretization": "explicit"}, 0.0),
        ({"metric_scale": 2.5}, 0.0),
        ({"metric_scale": 1.3}, 2e-3),
    ],
)
def test_unstable_loop_is_no_singularity(gains, delay):
    actuation = [{"type": "delay", "delay": delay}] if delay else []
    record = mm.simulate(
        "tiago_no_hand",
        mm.make_controller("tsm", **gains),
        "circle",
        duration=4.0,
        scenario=mm.Scenario(name="late", actuation=actuation),
    )
    assert record.status == "diverged"
    assert record.singularity == {}
    assert "sigma_min" not in record.message


@pytest.mark.parametrize("name", ["youbot", "husky_ur5", "ridgeback_panda"])
def test_nothing_is_predicted_where_nothing_happens(name):
    robot = mm.load_robot(name)
    task = mm.make_task("circle", robot)
    found = predict_singularity(robot, task, duration=12.0)
    assert found.singular is None
    assert found.t[-1] > 11.8
    assert np.all(found.sigma > found.jacobians.bounds["J"])
    # f_a = 0 and the tip on its circle: what a law's run has, too
    record = mm.simulate(robot, "extended-jacobian", "circle", duration=6.0)
    own = _sigmas(robot, task, record.q[-1])["J"]
    assert np.interp(6.0, found.t, found.sigma) == pytest.approx(own, rel=0.05)


def test_joint_nearest_to_its_limits_may_be_beyond(youbot):
    q = youbot.q_rest.copy()
    i = youbot.joint_names.index("y_3")
    q[i] = youbot.limits.upper[i] + 0.25
    assert nearest_limit(youbot, q) == ("y_3", pytest.approx(-0.25))


def test_check_tells_of_a_fold_on_the_default_task():
    """Weights of wheel angles as the paper's, on a robot whose arm then gives way."""
    content = description("jackal_z1", criterion__wheels=0.05, criterion__weights={})
    (finding,) = run_checks(mm.load_robot(content), only=["fold"])
    assert finding.status == "warning"
    assert "become singular at t = " in finding.found
    assert "[criterion]" in finding.fix


class _Rests:
    """A law that does nothing, with a criterion whose derivatives end on the way."""

    def __init__(self, calls):
        self.left = calls
        self.criterion = self

    def reset(self, robot, task, dt):
        self.rests = np.zeros(robot.nz)
        self.weights = np.ones(robot.nq)

    def step(self, t, q, z, z_dot):
        return self.rests

    def value(self, q):
        return 0.0

    def gradient(self, q):
        self.left -= 1
        if self.left < 0:
            raise SingularityError("the criterion ends here", "J")
        return np.zeros_like(q)

    def hessian(self, q):
        return np.eye(len(q))

    def hessian_rate(self, q, q_dot):
        return np.zeros((len(q), len(q)))


def test_criterion_that_ends_takes_its_error_along_and_nothing_else():
    record = mm.simulate("youbot", _Rests(5), "circle", duration=0.02)
    assert record.status == "ok"
    known = np.isfinite(record.auxiliary_error).all(axis=1)
    assert known[:3].all()
    assert not known[6:].any()
