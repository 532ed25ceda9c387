"""What simulate takes, what it refuses, and what it writes down of it."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from support.runs import Torque
from support.variants import ROBOTS, description

import mobman as mm
from mobman.errors import SpecError, UnknownNameError, UsageError


def _still(**options):
    given = {"duration": 0.01, **options}
    return mm.simulate("youbot", Torque(lambda t: np.zeros(5)), "paper", **given)


@pytest.mark.parametrize(
    ("arguments", "kind", "nearest"),
    [
        (("yubot", "tsm", "paper"), "robot", "youbot"),
        (("youbot", "tsmm", "paper"), "controller", "tsm"),
        (("youbot", "tsm", "papr"), "task", "paper"),
    ],
)
def test_misspelt_names(arguments, kind, nearest):
    with pytest.raises(UnknownNameError, match=f"unknown {kind} .*did you mean '{nearest}'"):
        mm.simulate(*arguments, duration=0.1)


@pytest.mark.parametrize("option", ["scenario", "plant"])
def test_misspelt_scenario_or_plant(option):
    with pytest.raises(
        UnknownNameError, match=f"unknown {option} 'hevier'; did you mean 'heavier'"
    ):
        _still(**{option: "hevier"})


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("option", ["duration", "dt"])
def test_times_must_be_positive_numbers(option, value):
    with pytest.raises(UsageError, match=rf"{option} = .*must be a number above 0"):
        _still(**{option: value})


@pytest.mark.parametrize("value", [5e-324, 1e300, 1e308, 10**400])
@pytest.mark.parametrize("option", ["duration", "dt", "observe_every"])
def test_times_must_be_of_a_size(option, value):
    with pytest.raises(UsageError, match=rf"{option} = .*from 1e-30 to 1e\+15 s"):
        _still(**{option: value})


@pytest.mark.parametrize(
    ("duration", "dt", "reason"),
    [
        (1e5, 1e-3, r"1e\+08 ticks; allowed: 1 to 1e\+07"),
        (1e6, 1e-30, r"1e\+36 ticks; allowed: 1 to 1e\+07"),
        (1e15, 1e14, r"duration = 1e\+15 s; allowed: up to 1e\+06 s"),
    ],
)
def test_runs_that_are_too_long_are_refused(duration, dt, reason):
    with pytest.raises(UsageError, match=reason):
        _still(duration=duration, dt=dt)


def test_run_must_last_a_period():
    with pytest.raises(UsageError, match=r"duration = 0\.01 s at dt = 0\.1 s is 0\.1 ticks"):
        _still(dt=0.1)


@pytest.mark.parametrize(
    ("q0", "reason"),
    [
        (np.zeros(7), r"has shape \(7,\); needed: \(8,\)"),
        (np.zeros((8, 1)), r"has shape \(8, 1\); needed: \(8,\)"),
        (np.full(8, np.nan), r"= \[nan, .*; needed: 8 finite numbers"),
        (np.full(8, 1e300), r"= \[1e\+300, .*must be 0, or of a size from 1e-30 to 1e\+15"),
        ("rest", "= 'rest'; needed: 8 numbers"),
    ],
)
def test_start_must_fit_the_robot(q0, reason):
    with pytest.raises(UsageError, match=f"q0 {reason}.*'youbot': the order is base_x, base_y"):
        _still(q0=q0)


@pytest.mark.parametrize("option", ["scenario", "plant"])
def test_what_is_no_scenario_and_no_plant_is_refused(option):
    with pytest.raises(UsageError, match=option):
        _still(**{option: 3})


def test_plant_with_other_joints_is_refused(tiago):
    with pytest.raises(
        UsageError, match="the plant 'tiago_no_hand' has other joints than 'youbot'"
    ):
        _still(plant=tiago)


def test_robot_may_be_a_file():
    file = ROBOTS / "youbot.toml"
    controller = Torque(lambda t: np.zeros(5))
    for robot in (file, str(file)):
        assert mm.simulate(robot, controller, "paper", duration=0.01).robot == "youbot"


def test_robot_file_that_is_not_there(tmp_path):
    with pytest.raises(SpecError, match="cannot read the robot file"):
        mm.simulate(tmp_path / "none.toml", "tsm", "paper", duration=0.01)


@pytest.mark.parametrize(
    ("duration", "dt", "ticks"), [(0.01, 1e-3, 10), (0.1, 0.025, 4), (0.3, 0.1, 3)]
)
def test_samples_are_at_the_ticks(duration, dt, ticks):
    record = _still(duration=duration, dt=dt)
    assert np.allclose(record.t, np.arange(ticks + 1) * dt)
    assert record.q.shape == (ticks + 1, 8)
    assert record.z.shape == record.torque.shape == (ticks + 1, 5)
    assert record.tip_position.shape == record.tip_desired.shape == record.task_error.shape
    assert record.auxiliary_error.shape == (ticks + 1, 2)


def test_start_is_at_rest_where_asked():
    q0 = mm.load_robot("youbot").q_rest + 0.1
    record = _still(q0=q0)
    assert np.array_equal(record.q[0], q0)
    assert not record.z[0].any()
    assert np.array_equal(_still().q[0], mm.load_robot("youbot").q_rest)


def test_circle_is_laid_at_the_start_asked_for(youbot):
    q0 = youbot.q_rest.copy()
    q0[0] += 5.0
    record = mm.simulate(youbot, Torque(lambda t: np.zeros(5)), "circle", duration=0.01, q0=q0)
    assert np.isclose(np.linalg.norm(record.task_error[0]), 0.1)


def test_errors_are_what_they_are_called(youbot):
    record = _still(duration=0.05)
    for q, tip in zip(record.q, record.tip_position, strict=True):
        assert np.allclose(youbot.tip_pose(q).translation, tip, atol=1e-12)
    assert np.array_equal(record.task_error, record.tip_position - record.tip_desired)
    for t, desired in zip(record.t, record.tip_desired, strict=True):
        assert np.allclose(desired, [2 + math.cos(t), 3 + math.sin(t), 0.35])


def test_torque_is_held_between_ticks(youbot):
    """Ten ticks of 10 ms with steps of 1 ms between them: as integrated with the held torque."""
    from mobman.simulation.integrator import RungeKutta
    from mobman.simulation.plant import Plant

    def torque(t):
        return np.array([0.3, -0.1, 0.2, 1.0, -0.5]) * math.sin(40.0 * t)

    record = mm.simulate(youbot, Torque(torque), "paper", duration=0.1, dt=0.01)
    plant = Plant(youbot)
    integrator = RungeKutta(plant, youbot.q_rest, np.zeros(5), 1e-3)
    for tick in range(10):
        plant.v[:] = torque(tick * 0.01)
        for step in range(10):
            t = tick * 0.01 + step * 1e-3
            integrator.evaluate(t)
            integrator.step(t)
    assert np.allclose(record.q[-1], plant.now.q, atol=1e-12)
    assert np.allclose(record.z[-1], plant.now.z, atol=1e-12)


def test_motion_is_that_of_the_full_model(youbot):
    """The plant against Pinocchio's own forward dynamics with the constraints as multipliers."""
    model, data = youbot.model, youbot.model.createData()
    torque = np.array([0.4, -0.3, 0.2, 0.5, -0.2])
    record = mm.simulate(youbot, Torque(lambda t: torque), "paper", duration=0.2)

    def slope(q, q_dot):
        inertia, bias = pin.crba(model, data, q), pin.nonLinearEffects(model, data, q, q_dot)
        a = youbot.constraint_matrix(q)
        right = -youbot.constraint_matrix_rate(q, q_dot) @ q_dot
        system = np.block([[inertia, a.T], [a, np.zeros((3, 3))]])
        force = youbot.actuation(q) @ torque - bias
        return np.linalg.solve(system, np.concatenate((force, right)))[:8]

    q, q_dot, h = youbot.q_rest.copy(), np.zeros(8), 1e-3
    for _ in range(200):
        k1 = slope(q, q_dot)
        k2 = slope(q + h / 2 * q_dot, q_dot + h / 2 * k1)
        k3 = slope(q + h / 2 * q_dot + h**2 / 4 * k1, q_dot + h / 2 * k2)
        k4 = slope(q + h * q_dot + h**2 / 2 * k2, q_dot + h * k3)
        q = q + h * q_dot + h**2 / 6 * (k1 + k2 + k3)
        q_dot = q_dot + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert np.allclose(record.q[-1], q, atol=1e-8)
    assert np.abs(record.q[-1] - youbot.q_rest).max() > 0.05


def test_progress_goes_from_nothing_to_all():
    done = []
    _still(duration=0.5, progress=done.append)
    assert done[0] == 0.0
    assert done[-1] == 1.0
    assert done == sorted(done)
    assert 50 < len(done) < 200


def test_record_says_how_to_repeat_the_run(youbot):
    record = mm.simulate(
        "youbot", mm.make_controller("tsm", a=0.2), "circle", duration=0.02, dt=2e-3,
        scenario="disturbed", plant="lighter", seed=7,
    )  # fmt: skip
    assert (record.robot, record.controller, record.task) == ("youbot", "tsm", "circle")
    assert (record.scenario, record.seed) == ("disturbed", 7)
    spec = record.spec
    assert (spec["duration"], spec["dt"], spec["seed"]) == (0.02, 2e-3, 7)
    assert (spec["controller"], spec["task"], spec["plant"]) == ("tsm", "circle", "lighter")
    assert spec["q0"] == youbot.q_rest.tolist()
    assert spec["robot"]["platform"]["wheel_radius"] == 0.05
    assert spec["scenario"]["name"] == "disturbed"
    assert record.settings["a"] == 0.2
    assert isinstance(record.settings["A"], float)
    assert record.urdf_sha256 == youbot.urdf.sha256()
    assert record.joint_names == youbot.joint_names
    assert record.velocity_names == youbot.velocity_names
    assert {"mobman", "python", "numpy", "pin"} <= set(record.versions)
    assert record.versions["numpy"] == np.__version__
    assert record.created.endswith("+00:00")


def test_robot_without_redundancy_runs_under_every_law():
    """l + n = m + k: the extended task is the tip's alone."""
    robot = mm.load_robot(description(urdf__lock=["y_1", "y_3"]))
    assert robot.nz == 3
    for law in mm.list_controllers():
        record = mm.simulate(robot, law, "circle", duration=0.05)
        assert record.auxiliary_error.shape == (51, 0), law
