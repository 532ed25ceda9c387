"""Robots on the ground: their MuJoCo models, and what friction, slopes, bumps and ice do to them."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from support.command_line import mobman
from support.platforms import PLATFORMS, on
from support.runs import Torque
from support.swept import swept
from support.variants import ROLLING, description, youbot_urdf

import mobman as mm
from mobman.errors import SpecError, UsageError
from mobman.simulation import rerun
from mobman.simulation.contact import ContactPlant, MuJoCo
from mobman.simulation.integrator import RungeKutta
from mobman.simulation.plant import Plant
from mobman.simulation.traction import traction

mujoco = pytest.importorskip("mujoco")

ONE_OF_EACH = [
    *("tiago_no_hand", "jackal_z1", "hunter_ur10", "youbot_mecanum", "lekiwi_so101"),
    *("ranger_xarm7", "hsr", "kmr_iiwa", "fixed_panda"),
]
H = 2.5e-4


def _contact(**plant):
    return mm.Scenario(
        name="c", acceleration="backward-difference", plant={"type": "mujoco", **plant}
    )


def _standing(robot, **given):
    plant = ContactPlant(MuJoCo(**given), robot)
    state = plant.own_state(robot.q_rest, H)
    plant.look()
    return plant, state


def _accelerating(robot, z_dot):
    """The torque that gives the ideal plant so much z' at rest."""
    dynamics = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    return np.linalg.solve(dynamics.B, dynamics.M @ z_dot + dynamics.bias)


def _go(robot, state, plant, torque, seconds):
    for step in range(round(seconds / H)):
        plant.v[:] = torque
        state.evaluate(step * H)
        state.step(step * H)
    if state is plant:
        plant.look()
    return plant.now.z.copy()


def _ideal(robot, torque, seconds):
    plant = Plant(robot)
    return _go(
        robot, RungeKutta(plant, robot.q_rest, np.zeros(robot.nz), H), plant, torque, seconds
    )


def _places(robot, state):
    """The coordinates of q that MuJoCo has, and where: an upright base's are those of the free joint."""
    pairs = dict(zip(state._own, state._dof, strict=True))
    if state._pose:
        first = state._base_dof
        pairs |= dict(zip(state._pose, (first, first + 1, first + 5), strict=True))
    rows = sorted(pairs)
    return rows, [pairs[i] for i in rows]


def _put(robot, state, q, q_dot):
    """An upright base anywhere, at any planar velocity."""
    data, model = state._data, state._model
    rows, dofs = _places(robot, state)
    data.qpos[state._at] = q[state._own]
    data.qvel[:] = 0.0
    data.qvel[dofs] = q_dot[rows]
    if state._pose:
        x, y, theta = q[state._pose]
        at = state._base_at
        data.qpos[at : at + 7] = x, y, 0.0, np.cos(theta / 2), 0.0, 0.0, np.sin(theta / 2)
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    return rows, dofs


@pytest.mark.parametrize("name", swept())
def test_inertia_and_bias_are_those_of_the_robot(name):
    robot = mm.load_robot(name)
    _, state = _standing(robot)
    random = np.random.default_rng(3)
    q = robot.q_rest + random.uniform(-1.0, 1.0, robot.nq)
    q_dot = random.uniform(-1.0, 1.0, robot.nq)
    rows, dofs = _put(robot, state, q, q_dot)
    model, data = state._model, state._data
    own = np.zeros((model.nv, model.nv))
    unit = np.eye(model.nv)
    for i in range(model.nv):
        mujoco.mj_mulM(model, data, own[i], unit[i])
    other = robot.model.createData()
    still = q_dot.copy()
    still[[i for i in range(robot.nq) if i not in rows]] = 0.0
    upper = np.triu(pin.crba(robot.model, other, q))
    inertia = (upper + np.triu(upper, 1).T)[np.ix_(rows, rows)]
    bias = pin.nonLinearEffects(robot.model, other, q, still)[rows]
    np.testing.assert_allclose(own[np.ix_(dofs, dofs)], inertia, atol=1e-9 * inertia.max())
    np.testing.assert_allclose(data.qfrc_bias[dofs], bias, atol=1e-9 * np.abs(bias).max())


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_gentle_motion_is_that_of_the_ideal_plant(name):
    """Which all constraints, gears, shares of the motors and directions of rollers have a part in."""
    robot = mm.load_robot(name)
    z_dot = np.random.default_rng(1).uniform(-0.2, 0.2, robot.nz)
    torque = _accelerating(robot, z_dot)
    expected = _ideal(robot, torque, 0.2)
    plant, state = _standing(robot, deflection=1e-5)
    found = _go(robot, state, plant, torque, 0.2)
    assert np.abs(found - expected).max() < 0.1 * np.abs(expected).max()
    assert np.abs(plant.recorded.slip).max(initial=0.0) < 1e-3
    assert np.abs(plant.recorded.lift).max(initial=0.0) == 0.0


def test_harder_ground_is_nearer_to_the_ideal_plant(tiago):
    robot = tiago
    torque = _accelerating(robot, np.random.default_rng(1).uniform(-0.2, 0.2, robot.nz))
    expected = _ideal(robot, torque, 0.1)
    away = []
    for deflection, creep in ((1e-3, 1e-3), (1e-4, 1e-4), (1e-5, 1e-5)):
        plant, state = _standing(robot, deflection=deflection, creep=creep)
        away.append(np.abs(_go(robot, state, plant, torque, 0.1) - expected).max())
    assert away[0] > 2.0 * away[1] > 4.0 * away[2]


def test_tyres_carry_the_robot_at_their_deflection(tiago):
    plant, _ = _standing(tiago, deflection=2e-4)
    weight = 9.81 * pin.computeTotalMass(tiago.model)
    centre = pin.centerOfMass(tiago.model, tiago.model.createData(), tiago.q_rest)
    # the platform leans on the support ahead, as far from the axle as a wheel from the middle
    ahead = centre[0] - tiago.q_rest[tiago.platform_index[0]]
    on_wheels = weight * (1.0 - ahead / tiago.platform.half_track)
    assert plant.recorded.normal.sum() == pytest.approx(on_wheels, rel=0.02)
    # the mean load of a wheel is the weight over 1 + 1 + 0.2 + 0.2
    assert plant.recorded.base[0] == pytest.approx(-2e-4 * 2.4 * on_wheels / 2 / weight, rel=0.02)


def test_wheels_on_ice_turn_and_drive_nowhere(tiago):
    robot = tiago
    z_dot = np.zeros(robot.nz)
    z_dot[:2] = 20.0
    torque = _accelerating(robot, z_dot)
    plant, state = _standing(robot, friction=0.0)
    _go(robot, state, plant, torque, 0.05)
    x = robot.platform_index[0]
    wheels = robot.platform_index[3:]
    assert abs(plant.now.q[x] - robot.q_rest[x]) < 1e-3
    radius = robot.platform.radius
    rolling = radius * np.abs(plant.q_dot[wheels])
    np.testing.assert_allclose(plant.recorded.slip, rolling, rtol=0.1)
    assert rolling.min() > 1.0 * radius


def test_a_patch_of_ice_takes_the_grip_where_it_is(tiago):
    robot = tiago
    patch = {"ahead": 0.0, "left": 0.2, "radius": 0.1, "friction": 0.0}
    plant, state = _standing(robot, patches=[patch])
    z_dot = np.zeros(robot.nz)
    z_dot[:2] = 5.0
    _go(robot, state, plant, _accelerating(robot, z_dot), 0.05)
    right, left = plant.recorded.friction
    assert left < 1e-3 * plant.recorded.normal[1]
    assert right > 1.0
    assert plant.recorded.slip[1] > 100.0 * plant.recorded.slip[0]


def test_a_slope_pulls_downhill(tiago):
    robot, slope = tiago, 0.1
    torque = _accelerating(robot, np.zeros(robot.nz))
    plant, state = _standing(robot, slope=slope, deflection=1e-5)
    found = _go(robot, state, plant, torque, 0.05)
    tilted = robot.model.copy()
    tilted.gravity.linear = 9.81 * np.array([-np.sin(slope), 0.0, -np.cos(slope)])
    expected = _ideal(robot.with_model(tilted), torque, 0.05)
    assert expected[0] < -0.05
    np.testing.assert_allclose(found[:2], expected[:2], rtol=0.05)


def test_a_bump_lifts_the_wheels_that_cross_it(tiago):
    robot = tiago
    z_dot = np.zeros(robot.nz)
    z_dot[:2] = 10.0
    torque = _accelerating(robot, z_dot)
    radius = robot.platform.radius
    bump = {"ahead": 0.1, "height": 0.003, "width": 0.1}
    plant, state = _standing(robot, bumps=[bump])
    wheel = state._geoms[0]
    heights = []
    for _ in range(round(0.6 / H)):
        plant.v[:] = torque
        state.step(0.0)
        heights.append(state._data.geom_xpos[wheel][2] - radius)
    assert 0.0025 < max(heights) < 0.0035
    assert abs(heights[0]) < 2e-4


def test_runs_are_the_same_to_the_last_bit(tiago, tmp_path):
    one = mm.simulate(tiago, "time-delay", "circle", duration=0.05, scenario="contact")
    path = tmp_path / "run.h5"
    one.save(path)
    assert one.ok
    assert not rerun.verify(path).differences
    assert {"contact/slip", "contact/normal", "contact/lift", "contact/tip"} <= set(one.signals)
    # the tip sinks and tilts with the platform, of which the law knows nothing
    away = np.abs(one.signals["contact/tip"] - one.tip_position).max()
    assert 1e-5 < away < 1e-2


def test_metrics_of_the_ground_are_those_of_its_signals(tiago):
    record = mm.simulate(tiago, "pseudo-inverse", "circle", duration=0.05, scenario="contact")
    found, signals = record.metrics, record.signals
    slip = signals["contact/slip"]
    assert found["slip_max"] == slip.max() > 0.0
    assert found["slip_way"] == pytest.approx(1e-3 * slip.sum(axis=0).max(), rel=1e-12)
    ratio = signals["contact/friction"] / signals["contact/normal"]
    assert found["grip_used"] == ratio.max()
    assert 0.001 < found["grip_used"] < 0.8
    assert found["wheel_lift"] == 0.0
    steady = record.t >= 0.7 * 0.05 - 1e-9
    away = np.linalg.norm((signals["contact/tip"] - record.tip_desired)[steady], axis=1)
    assert found["true_error_max"] == pytest.approx(away.max(), rel=1e-12)
    ideal = mm.simulate(tiago, "time-delay", "circle", duration=0.01).metrics
    assert not {"slip_max", "grip_used", "true_error_max"} & set(ideal)


def test_traction_is_the_acceleration_at_which_wheels_slip(tiago):
    robot = tiago
    limit = traction(robot, MuJoCo(friction=0.3))
    assert limit.grip < limit.tipping
    assert traction(robot, MuJoCo(friction=0.6)).grip == pytest.approx(2.0 * limit.grip, rel=1e-9)
    x, _, _, *wheels = robot.platform_index
    ways = []
    for share in (0.7, 1.5):
        z_dot = np.zeros(robot.nz)
        z_dot[:2] = share * limit.grip / robot.platform.radius
        plant, state = _standing(robot, friction=0.3)
        _go(robot, state, plant, _accelerating(robot, z_dot), 0.1)
        way = plant.now.q - robot.q_rest
        ways.append(robot.platform.radius * way[wheels].mean() - way[x])
    # on the way of 1 cm, and 2 cm
    assert abs(ways[0]) < 1e-4
    assert ways[1] > 1e-3
    with pytest.raises(SpecError, match="no driven wheels"):
        traction(mm.load_robot("kmr_iiwa"))


@pytest.mark.parametrize("name", ["tiago_no_hand", "ranger_xarm7"])
def test_friction_over_load_is_what_momentum_asks_for(name, monkeypatch):
    """Of MuJoCo's contacts, against momentum of the ideal plant's motion, where wheels hold."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "benchmarks")
    from ground import grip_asked

    ideal, found = (
        mm.simulate(name, "pseudo-inverse", "circle", duration=0.2, scenario=one)
        for one in ("nominal", "contact")
    )
    asked = grip_asked(mm.load_robot(name), ideal)
    used = (found.signals["contact/friction"] / found.signals["contact/normal"]).max(axis=1)
    ticks = slice(50, 150)  # the start shakes the tyres
    assert asked[ticks].max() > 0.03
    assert used[ticks] == pytest.approx(asked[ticks], rel=0.05, abs=2e-3)


def test_caps_by_traction_keep_a_start_far_away_on_the_wheels(tiago):
    far = mm.Scenario(**{**mm.load_scenario("contact").model_dump(), "name": "far"})
    far = far.model_copy(update={"start_offset": 4.0})
    caps = {"v_max": 1.0, "a_max": traction(tiago).a_max()}
    capped, free = (
        mm.simulate(tiago, mm.make_controller("tsm", **gains), "circle", duration=0.6, scenario=far)
        for gains in (caps, {})
    )
    assert capped.ok
    assert capped.metrics["wheel_lift"] == 0.0
    assert capped.metrics["grip_used"] < 0.8
    assert not free.ok or np.max(free.signals["contact/lift"]) > 0.01


def test_friction_and_stops_act_on_the_ground_too(tiago):
    robot = tiago
    sticky = mm.Scenario(
        name="s",
        friction=[{"type": "viscous", "acceleration": 20.0}],
        plant={"type": "mujoco"},
    )
    free, braked = (
        mm.simulate(robot, "computed-torque-integral", "circle", duration=0.1, scenario=one)
        for one in (_contact(), sticky)
    )
    assert np.abs(braked.torque[-1] - free.torque[-1]).max() > 1e-3


@pytest.mark.parametrize("name", ["ranger_xarm7", "youbot_mecanum", "kmr_iiwa", "fixed_panda"])
@pytest.mark.parametrize("size", [1e4, 1e12])
def test_torques_beyond_all_bounds_end_the_run_as_diverged(
    name, size, capfd, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    robot = mm.load_robot(name)
    wild = Torque(lambda t: size * np.linspace(-1.0, 1.0, robot.nz))
    record = mm.simulate(robot, wild, "circle", duration=0.2, scenario="contact")
    assert record.status == "diverged"
    assert np.isfinite(record.q).all()
    # MuJoCo warns in a file of its own, and on the terminal
    assert not list(tmp_path.iterdir())
    assert "WARNING" not in "".join(capfd.readouterr())


def test_slip_by_construction_is_refused(tiago):
    both = mm.Scenario(
        name="b", slip=[{"type": "longitudinal", "ratio": 0.1}], plant={"type": "mujoco"}
    )
    with pytest.raises(SpecError, match=r"'slip'.*ideal"):
        mm.simulate(tiago, "time-delay", "circle", duration=0.01, scenario=both)


def test_missing_mujoco_is_named_with_what_installs_it(tiago, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "mujoco" else find(name, *a)
    )
    with pytest.raises(UsageError, match=r"pip install 'mobman\[mujoco\]'"):
        mm.simulate(tiago, "time-delay", "circle", duration=0.01, scenario="contact")


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        ({"type": "mujoco", "friction": -0.1}, "friction"),
        ({"type": "mujoco", "impedance": 1.0}, "impedance"),
        ({"type": "mujoco", "bumps": [{"ahead": 1.0, "height": 0.0}]}, "height"),
        ({"type": "bullet"}, "'mujoco'"),
        ("mujocko", "'ideal'"),
    ],
)
def test_wrong_fields_are_named(plant, message):
    with pytest.raises(SpecError, match=message):
        mm.Scenario(name="w", plant=plant)


def test_a_robot_that_cannot_stand_says_why():
    body = {**PLATFORMS["mecanum"]["body"], "centre_of_mass": [3.0, 0.0, 0.3]}
    robot = mm.load_robot(on("mecanum", body=body))
    with pytest.raises(SpecError, match=r"'ur5_on_omnidirectional' falls over where it starts"):
        mm.simulate(robot, "time-delay", "circle", duration=0.01, scenario=_contact())


def test_a_platform_in_python_that_names_no_wheels_says_so(tmp_path):
    (tmp_path / "own.py").write_text(ROLLING, encoding="utf-8")
    (tmp_path / "youbot.urdf").write_text(youbot_urdf(), encoding="utf-8")
    content = description("youbot", urdf__path="youbot.urdf")
    platform = {"type": "custom", "definition": "own.py:Body"}
    robot = mm.load_robot({**content, "folder": tmp_path, "platform": platform})
    with pytest.raises(SpecError, match=r"names no wheels, .* in the platform's 'wheels'"):
        mm.simulate(robot, "time-delay", "circle", duration=0.01, scenario=_contact())


def test_a_plant_of_its_usual_kind_leaves_no_trace():
    assert "plant" not in mm.Scenario(name="s").model_dump()
    assert mm.Scenario(**mm.load_scenario("contact").model_dump()).plant.type == "mujoco"


@pytest.mark.parametrize("name", swept())
def test_every_robot_stands_and_drives_for_two_seconds(name):
    record = mm.simulate(
        name, "tsm-null-space", "circle", duration=2.0, dt=2e-3, scenario="contact"
    )
    assert record.ok, record.message
    away = np.linalg.norm(record.task_error, axis=1)
    assert away[-1] < 0.1 * away[0]  # it has driven to its path, and follows it


def test_a_run_tells_its_slip_in_a_line():
    done = mobman("run", "youbot", "--scenario", "contact", "--duration", "0.02")
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.strip().startswith("ground")]
    assert "slip at most" in line
