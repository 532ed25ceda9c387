"""A run's bits are its own, whatever else runs on the same robot object."""

from __future__ import annotations

import gc
import pickle
import sys
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy

import numpy as np
import pytest
from support.runs import hand_made_run
from threadpoolctl import threadpool_limits

import mobman as mm
from mobman.simulation.metrics import metrics

DURATION = 0.03
RUNS = [
    ("tsm", "circle", "disturbed"),
    ("extended-jacobian", "line", "nominal"),
    ("pseudo-inverse", "circle", "payload"),
    ("tsm-inverse-actuation", "circle", "slipping"),
]


def _bits(robot, law, task, scenario):
    # with "auto" these laws would look at hundreds of states first
    gains = {"a": 0.2, "A": 0.2} if law.startswith("tsm") else {}
    law = mm.make_controller(law, **gains)
    record = mm.simulate(robot, law, task, duration=DURATION, scenario=scenario, seed=3)
    found = [(name, value) for name, value in record.metrics.items() if "compute" not in name]
    return record.state_sha256, repr(found)


@pytest.fixture
def hasty():
    """Threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("hasty")
def test_runs_in_threads_on_one_robot(youbot):
    alone = [_bits(youbot, *run) for run in RUNS]
    with ThreadPoolExecutor(len(RUNS)) as pool:
        beside = list(pool.map(lambda run: _bits(youbot, *run), 4 * RUNS))
    assert beside == 4 * alone


class _Interrupted:
    """A task within which something else happens, in the middle of every fifth evaluation."""

    def __init__(self, task, happens):
        self._task, self._happens, self._calls = task, happens, 0

    def desired(self, t):
        self._calls += 1
        if self._calls % 5 == 0:
            self._happens()
        return self._task.desired(t)


@pytest.mark.parametrize("law", ["tsm", "pseudo-inverse"])
def test_run_within_another_on_one_robot(youbot, law):
    task = mm.make_task("line", youbot)

    def something_else():
        mm.simulate(youbot, "extended-jacobian", "circle", duration=2e-3)
        youbot.dynamics(youbot.q_rest + 0.3, np.full(youbot.nz, 0.2))

    alone = _bits(youbot, law, _Interrupted(task, lambda: None), "nominal")
    assert _bits(youbot, law, _Interrupted(task, something_else), "nominal") == alone


@pytest.mark.usefixtures("hasty")
def test_methods_of_one_robot_in_threads(youbot):
    draw = np.random.default_rng(1)
    states = [(draw.normal(size=youbot.nq), draw.normal(size=youbot.nz)) for _ in range(8)]

    def everything(state):
        q, z = state
        parts = []
        for _ in range(40):
            found = (
                *youbot.dynamics(q, z),
                *youbot.tip_kinematics(q, z),
                *youbot.velocity(q, z),
                youbot.tip_pose(q).homogeneous,
                youbot.tip_jacobian(q),
                youbot.reduced_inertia(q),
                np.array(youbot.energy(q, z)),
            )
            parts.append(b"".join(part.tobytes() for part in found))
        assert len(set(parts)) == 1
        return parts[0]

    alone = [everything(state) for state in states]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(everything, states)) == alone


@pytest.mark.parametrize("copied", [deepcopy, lambda robot: pickle.loads(pickle.dumps(robot))])
def test_copy_of_a_robot_runs_like_it(youbot, copied):
    youbot.dynamics(youbot.q_rest, np.zeros(youbot.nz))  # it has what its methods work with
    assert _bits(copied(youbot), *RUNS[0]) == _bits(youbot, *RUNS[0])


def test_robot_that_threads_used_is_not_kept(youbot):
    robot = youbot.with_model(youbot.model)
    state = robot.q_rest, np.zeros(robot.nz)
    robot.dynamics(*state)
    used, end, robots = threading.Event(), threading.Event(), [robot]

    def use():
        robots.pop().dynamics(*state)
        used.set()
        end.wait()

    thread = threading.Thread(target=use)
    thread.start()
    used.wait()
    gone = weakref.ref(robot)
    del robot
    gc.collect()
    kept = gone()
    end.set()
    thread.join()
    assert kept is None


def test_torque_energy_does_not_depend_on_threads_of_blas(youbot):
    torque = np.random.default_rng(2).normal(size=(30_001, youbot.nz))
    run = hand_made_run(youbot, torque=torque)
    found = set()
    for threads in (1, 2):
        with threadpool_limits(limits=threads):
            found.add(metrics.get("torque_energy").function(run))
    assert len(found) == 1
