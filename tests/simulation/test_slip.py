"""Platforms that slip: where they go, what the constraints say, and what does not change."""

from __future__ import annotations

import numpy as np
import pytest
from support.runs import Torque

import mobman as mm
from mobman.simulation.scenario import Scenario

RATIO, ANGLE, DRIFT = 0.2, 0.1, 0.05
TASK = "circle"


def _run(robot, *slip, duration=0.1):
    """A fixed torque that drives and turns; the motion z is the same in every one of them."""
    torque = np.zeros(robot.nz)
    torque[: robot.n_alpha] = np.linspace(1.0, 2.0, robot.n_alpha) if robot.n_alpha else 0.0
    torque *= 5.0 * robot.motor_inertia(robot.q_rest)
    scenario = Scenario(name="s", slip=list(slip))
    return mm.simulate(robot, Torque(lambda t: torque), TASK, duration=duration, scenario=scenario)


def _pose(robot, record):
    return record.q[:, [robot.joint_names.index(name) for name in robot.platform.base_joints]]


def _rolling(robot, record):
    """The pose's part of C z at every tick, with the record's heading."""
    rows = [robot.joint_names.index(name) for name in robot.platform.base_joints]
    return np.array(
        [(robot.velocity_map(q) @ z)[rows] for q, z in zip(record.q, record.z, strict=True)]
    )


def _integral(rates, t):
    """Simpson's rule from the start to the end; an even number of ticks."""
    h = t[1] - t[0]
    return (
        h / 3.0 * (rates[0] + 4.0 * rates[1:-1:2].sum(0) + 2.0 * rates[2:-1:2].sum(0) + rates[-1])
    )


LONGITUDINAL = {"type": "longitudinal", "ratio": RATIO}
SLIPS = {
    "longitudinal": (LONGITUDINAL, lambda rate, theta: -RATIO * rate),
    "angle": (
        {"type": "lateral", "angle": ANGLE},
        lambda rate, theta: (
            np.tan(ANGLE)
            * (np.cos(theta) * rate[0] + np.sin(theta) * rate[1])
            * np.array([-np.sin(theta), np.cos(theta), 0.0])
        ),
    ),
    "drift": (
        {"type": "lateral", "velocity": DRIFT},
        lambda rate, theta: DRIFT * np.array([-np.sin(theta), np.cos(theta), 0.0]),
    ),
}


@pytest.mark.parametrize("kind", SLIPS)
def test_platform_moves_by_rolling_and_slip(driving_robot, kind):
    """Displacement = integral of C z + slip; A x' = A slip is what the metric shows."""
    robot, (piece, formula) = driving_robot, SLIPS[kind]
    constrained = robot.k > len(robot.followers)
    record = _run(robot, piece, duration=0.02)
    rolling, pose = _rolling(robot, record), _pose(robot, record)
    slipping = np.array([formula(rate, p[2]) for rate, p in zip(rolling, pose, strict=True)])
    moved = _integral(rolling + slipping, record.t)
    assert np.allclose(pose[-1] - pose[0], moved, atol=1e-9)
    rows = [robot.joint_names.index(name) for name in robot.platform.base_joints]
    residual = 0.0
    if not constrained:  # a base without wheels has no rows for slip to violate
        assert record.metrics["constraint_residual"] < 1e-12
        return
    for q, slip in zip(record.q, slipping, strict=True):
        q_dot = np.zeros(robot.nq)
        q_dot[rows] = slip
        residual = max(residual, np.abs(robot.constraint_matrix(q) @ q_dot).max())
    assert np.isclose(record.metrics["constraint_residual"], residual, rtol=1e-9, atol=1e-12)
    assert residual > 1e-6


def test_shares_of_a_path_that_is_slipped(youbot):
    """The heading turns by 1 - ratio of what the wheels turn it."""
    rolls, slips = _run(youbot), _run(youbot, LONGITUDINAL)
    turned = _pose(youbot, rolls)[:, 2] - _pose(youbot, rolls)[0, 2]
    assert abs(turned[-1]) > 1e-4
    slipped = _pose(youbot, slips)[:, 2] - _pose(youbot, slips)[0, 2]
    assert np.allclose(slipped, (1.0 - RATIO) * turned, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", SLIPS)
def test_slip_moves_the_platform_and_nothing_else(driving_robot, kind):
    """Neither z, wheels and arm, nor the energy depend on where a platform is on a floor."""
    rolls, slips = (
        _run(driving_robot, duration=0.05),
        _run(driving_robot, SLIPS[kind][0], duration=0.05),
    )
    assert np.allclose(slips.z, rolls.z, rtol=1e-7, atol=1e-8)
    base = [driving_robot.joint_names.index(name) for name in driving_robot.platform.base_joints]
    others = np.setdiff1d(np.arange(driving_robot.nq), base)
    assert np.allclose(slips.q[:, others], rolls.q[:, others], atol=1e-8)
    assert slips.metrics["energy_residual"] < 1e-6
    assert rolls.metrics["constraint_residual"] < 1e-12


def test_slips_add_up(youbot):
    both = _run(youbot, LONGITUDINAL, SLIPS["drift"][0], duration=0.02)
    rolling, pose = _rolling(youbot, both), _pose(youbot, both)
    slipping = np.array([
        SLIPS["longitudinal"][1](r, p[2]) + SLIPS["drift"][1](r, p[2])
        for r, p in zip(rolling, pose, strict=True)
    ])  # fmt: skip
    moved = _integral(rolling + slipping, both.t)
    assert np.allclose(pose[-1] - pose[0], moved, atol=1e-9)


@pytest.mark.parametrize(
    "slip",
    [
        {"type": "longitudinal", "ratio": 0.0},
        {"type": "lateral", "angle": 0.0},
        {"type": "lateral", "velocity": 0.0},
    ],
)
def test_no_slip_is_none_bit_for_bit(youbot, slip):
    none, other = _run(youbot, slip), _run(youbot)
    assert np.array_equal(none.q, other.q)
    assert none.metrics["constraint_residual"] == other.metrics["constraint_residual"]


def test_robot_that_does_not_drive_does_not_slip(fixed_robot):
    slips, stands = _run(fixed_robot, LONGITUDINAL, SLIPS["drift"][0]), _run(fixed_robot)
    assert np.array_equal(slips.q, stands.q)
    assert slips.metrics["constraint_residual"] == 0.0
