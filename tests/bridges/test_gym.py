"""The Gymnasium environment, and policies as controllers."""

from __future__ import annotations

import importlib
import re
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import mobman as mm
from mobman.benchmark.runner import run_suite
from mobman.benchmark.suite import Suite
from mobman.bridges.policy import PolicyController
from mobman.controllers.protocol import controllers

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from mobman.bridges.gym import TrackingEnv  # noqa: E402

DT = 0.01


def policy(observation):
    """Some smooth function of all that is seen, in the action's precision."""
    nz = 8
    waves = np.sin(np.arange(nz)[:, None] + np.arange(len(observation)))
    return np.tanh(waves @ np.tanh(observation)).astype(np.float32)


def episode(env, act, **reset):
    """Observations, rewards and the last ends and info of an episode."""
    observation, info = env.reset(**reset)
    seen, rewards = [observation], []
    while True:
        observation, reward, terminated, truncated, info = env.step(act(observation))
        seen.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            return np.array(seen), np.array(rewards), terminated, truncated, info


@pytest.mark.parametrize(
    ("robot", "task", "actions"),
    [
        ("jackal_ur3", "pointing-circle", "acceleration"),
        ("hunter_ur10", "pose-circle", "torque"),
    ],
)
def test_passes_gymnasiums_check(robot, task, actions):
    name = "mobman.bridges.gym:mobman/Tracking-v0"
    env = gymnasium.make(name, robot=robot, task=task, actions=actions, duration=0.1)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
    # errors have no bounds, which the check takes for a slip
    assert all("infinity" in str(one.message) for one in found)
    assert env.action_space.shape == (env.unwrapped.loop.robot.nz,)


@pytest.mark.parametrize(
    ("actions", "scenario"),
    [("acceleration", "noisy"), ("torque", "contact"), ("acceleration", "uncertain-kinematics")],
)
def test_is_the_simulation_bit_for_bit(actions, scenario):
    if scenario == "contact":
        pytest.importorskip("mujoco")
    env = TrackingEnv("jackal_ur3", "circle", scenario, actions=actions, duration=0.1, dt=DT)
    seen, rewards, terminated, truncated, info = episode(env, policy, seed=5)
    record = mm.simulate(
        *("jackal_ur3", PolicyController(policy, actions), "circle"),
        scenario=scenario,
        duration=0.1,
        dt=DT,
        seed=info["seed"],
    )
    samples = env.loop.samples
    n = len(record.t)
    assert np.array_equal(samples.q[:n], record.q)
    assert np.array_equal(samples.torque[: n - 1], record.torque[:-1])
    assert (truncated, terminated) == (record.ok, not record.ok)
    assert np.array_equal(info["task_error"], record.task_error[len(seen) - 1])
    distance = np.linalg.norm(record.task_error[1 : len(seen), :3], axis=1)
    expected = DT / (1.0 + distance / 0.1)
    assert rewards[: len(expected)] == pytest.approx(expected)
    assert sum(rewards) <= 0.1


def test_observation_is_what_it_says():
    env = TrackingEnv("jackal_ur3", duration=0.1)
    seen, *_ = episode(env, policy, seed=1)
    robot, loop = env.loop.robot, env.loop
    entries = dict(zip(env.names, seen[-1], strict=True))
    q, z = loop.samples.q[10], loop.samples.z[10]
    p_d, p_d_rate, *_ = loop.task.desired(0.1)
    tip = robot.tip_pose(q).translation
    velocity = robot.tip_jacobian(q)[:3] @ robot.velocity_map(q) @ z
    for i, axis in enumerate("xyz"):
        assert entries[f"e/{axis}"] == pytest.approx(tip[i] - p_d[i], abs=1e-12)
        assert entries[f"e'/{axis}"] == pytest.approx(velocity[i] - p_d_rate[i], abs=1e-12)
    limits = robot.limits
    for i, name in enumerate(robot.joint_names):
        assert entries[f"q/{name}"] == q[i]
        inside = min(q[i] - limits.lower[i], limits.upper[i] - q[i])
        assert entries.get(f"margin/q/{name}", np.inf) == inside
    for i, name in enumerate(robot.velocity_names):
        assert entries[f"z/{name}"] == z[i]
        assert entries[f"margin/z/{name}"] == limits.velocity[i] - abs(z[i])
    assert len(env.names) == len(set(env.names)) == env.observation_space.shape[0]


def test_what_an_action_of_one_is():
    robot = mm.load_robot("youbot")  # its wheels have no limits
    task = mm.make_task("circle", robot)
    law = PolicyController(lambda _: np.ones(robot.nz), "torque")
    law.reset(robot, task, DT)
    limited = np.isfinite(robot.limits.torque)
    assert np.array_equal(law.scale[limited], robot.limits.torque[limited])
    still, rest = (
        robot.dynamics(robot.q_rest, np.zeros(robot.nz)),
        robot.motor_inertia(robot.q_rest),
    )
    free = np.abs(np.linalg.solve(still.B, still.bias)) + 10.0 * rest
    assert law.scale[~limited] == pytest.approx(free[~limited])
    law = PolicyController(lambda _: np.ones(robot.nz), "acceleration")
    law.reset(robot, task, DT)
    velocity = np.where(np.isfinite(robot.limits.velocity), robot.limits.velocity, 1.0)
    assert np.array_equal(law.scale, velocity / 0.5)
    z = np.full(robot.nz, 0.1)
    v = law.step(0.0, robot.q_rest, z, z)
    M, bias, B = robot.dynamics(robot.q_rest, z)
    assert np.linalg.solve(M, B @ v - bias) == pytest.approx(law.scale)
    assert np.array_equal(law.torque(np.full(5, 7.0), robot.q_rest, z), v)


def test_seed_draws_placement_and_noise_again():
    env = TrackingEnv("youbot", "circle", "noisy", duration=0.05, numbers=[1000, 1001, 1002])

    def zero(_):
        return np.zeros(5, dtype=np.float32)

    first, second = (episode(env, zero, seed=7), episode(env, zero))
    again, then = (episode(env, zero, seed=7), episode(env, zero))
    assert np.array_equal(first[0], again[0])
    assert np.array_equal(second[0], then[0])
    assert not np.array_equal(first[0][0], second[0][0])
    other = episode(env, zero, seed=8)
    assert not np.array_equal(first[0][0], other[0][0])
    assert {run[-1]["placement"] for run in (first, second, other)} <= {1000, 1001, 1002}


def test_a_run_that_diverges_terminates_and_earns_nothing_more():
    env = TrackingEnv("tiago_no_hand", actions="torque", duration=1.0)
    _, rewards, terminated, truncated, info = episode(env, lambda _: np.ones(10), seed=0)
    assert terminated
    assert not truncated
    assert info["status"] == "diverged"
    assert "above" in info["message"]
    assert rewards[-1] == 0.0
    with pytest.raises(mm.MobmanError, match="call reset first"):
        env.step(np.ones(10))


REFUSED = [
    np.ones(4),
    np.full(5, np.nan),
    [0.0, 0.0, np.inf, 0.0, 0.0],
    np.full(5, 1j),
    np.ma.masked_equal([0.0, 1.0, 0.0, 0.0, 0.0], 1.0),
    [True] * 5,
    ["0"] * 5,
    (np.zeros(5), None),
    "left",
    None,
]


def test_a_refused_action_leaves_the_episode_as_it_was():
    env, same = TrackingEnv("youbot", duration=0.05), TrackingEnv("youbot", duration=0.05)
    env.reset(seed=0)
    same.reset(seed=0)
    for action in REFUSED:
        with pytest.raises(mm.MobmanError, match="needed: 5 finite numbers"):
            env.step(action)
    for last in (False, False, False, False, True):
        # a tuple is an action like another
        seen, reward, terminated, truncated, info = env.step((0.5,) * 5)
        expected, reward_of_same, *_ = same.step(np.full(5, 0.5))
        assert np.array_equal(seen, expected)
        assert reward == reward_of_same > 0.0
        assert (terminated, truncated, info["status"]) == (False, last, "ok")


def test_a_policy_may_return_a_tuple_of_numbers_or_a_pair():
    robot = mm.load_robot("youbot")
    torques = []
    for action in (np.full(5, 0.5), (0.5,) * 5, (np.full(5, 0.5), None)):
        law = PolicyController(lambda _, action=action: action)
        law.reset(robot, mm.make_task("circle", robot), DT)
        torques.append(law.step(0.0, robot.q_rest, np.zeros(5), np.zeros(5)))
    assert np.array_equal(torques[0], torques[1])
    assert np.array_equal(torques[0], torques[2])


def test_what_a_policy_uses():
    assert set(PolicyController(policy).uses) == {"M", "bias", "limits"}
    assert set(PolicyController(policy, "torque").uses) == {"limits"}

    class More(PolicyController):
        uses = ("preview",)

    assert More(policy, "torque").uses == ("preview",)


def test_numbers_of_placements_may_be_of_numpy():
    env = TrackingEnv("youbot", duration=0.05, numbers=np.arange(1000, 1002))
    _, info = env.reset(seed=0)
    assert info["placement"] in (1000, 1001)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"numbers": []}, "numbers"),
        ({"numbers": [-1]}, "numbers"),
        ({"numbers": 3}, "numbers = 3: expected a list"),
        ({"numbers": [0.5]}, "numbers"),
        ({"numbers": [True]}, "numbers"),
        ({"render_mode": "human"}, "render_mode = 'human': allowed: None"),
        ({"actions": "force"}, "acceleration, torque"),
        ({"duration": -1.0}, "duration"),
        ({"robot": "yuobot"}, "did you mean 'youbot'"),
        ({"task_options": 5}, "task options = 5: expected a dictionary"),
    ],
)
def test_wrong_arguments_are_refused(arguments, message):
    with pytest.raises(mm.MobmanError, match=message):
        TrackingEnv(**arguments)


class Learned(PolicyController):
    """A policy by a name, as a suite asks for it."""

    def __init__(self):
        super().__init__(lambda seen: (policy(seen), None))  # as stable-baselines3's predict


def test_a_policy_is_a_controller_in_a_suite(tmp_path, monkeypatch):
    monkeypatch.setitem(controllers._items, "learned", Learned)  # for this test alone
    suite = Suite.model_validate(
        {
            "schema": 1,
            "name": "small",
            "duration": 0.1,
            "dt": DT,
            "controllers": {"learned": {"law": "learned"}, "p": {"law": "pseudo-inverse"}},
            "groups": [{"robots": ["jackal_ur3"], "tasks": ["circle"]}],
        }
    )
    with ThreadPoolExecutor(1) as pool:
        run_suite(suite, tmp_path, executor=pool, report=False)
    frame = mm.load_results(tmp_path)
    env = TrackingEnv("jackal_ur3", duration=0.1, dt=DT)
    *_, info = episode(env, policy, seed=0)
    found = frame[frame["controller"] == "learned"]
    assert found["task_error_final"].item() == np.linalg.norm(info["task_error"])


def test_without_gymnasium_there_is_one_clear_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "mobman.bridges.gym")
    with pytest.raises(mm.MobmanError, match=re.escape("pip install 'mobman[gym]'")):
        importlib.import_module("mobman.bridges.gym")


@pytest.mark.parametrize("policy", [5, None])
def test_what_is_no_policy_is_refused(policy):
    with pytest.raises(mm.MobmanError, match=f"policy = {policy}: expected a function"):
        PolicyController(policy)
