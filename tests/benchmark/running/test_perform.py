"""What a worker does, without a worker."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.suites import suite_of

from mobman.benchmark.runner import jobs_of
from mobman.benchmark.running.loaded_robots import _KEPT, _robots, forget_robots, robot_of
from mobman.benchmark.running.perform import perform
from mobman.benchmark.running.time_limit import TimeLimitError, within
from mobman.benchmark.running.worker_processes import WorkerProcesses
from mobman.robots.catalogue import find_spec
from mobman.simulation.record import load_record
from mobman.simulation.run_spec import fingerprint


@pytest.fixture
def jobs():
    suite = suite_of(["tsm", "pseudo-inverse", "extended-jacobian"], duration=0.02)
    return jobs_of(suite.runs(), 60.0, pickle.dumps)


def state(result, folder):
    assert result.content is not None, result.message
    path = folder / "run.h5"
    path.write_bytes(result.content)
    record = load_record(path)
    return np.hstack([record.q, record.z, record.torque, record.task_error])


def test_a_robot_that_was_used_before_gives_the_same_bits(jobs, tmp_path):
    fresh = []
    for job in jobs:
        forget_robots()
        fresh.append(state(perform(job), tmp_path))
    for order in (jobs, jobs[::-1], jobs):
        for job in order:
            assert np.array_equal(state(perform(job), tmp_path), fresh[jobs.index(job)])
    assert len(_robots) == 1


def test_metrics_come_back_without_the_file_where_it_is_not_asked_for(jobs):
    whole, short = perform(jobs[0]), perform(replace(jobs[0], with_file=False))
    assert whole.content is not None
    assert short.content is None
    assert (short.status, short.end) == ("ok", pytest.approx(0.02))
    timed = {name for name in short.metrics if "time" in name}
    for name in short.metrics.keys() - timed:
        np.testing.assert_equal(short.metrics[name], whole.metrics[name])
    assert short.seconds > 0.0


def test_a_failed_run_leaves_no_robot_behind(jobs):
    robot = robot_of(jobs[0])
    assert robot_of(jobs[1]) is robot
    broken = replace(jobs[0], run=replace(jobs[0].run, duration=-1.0))
    assert perform(broken).status == "failed"
    assert robot_of(jobs[0]) is not robot


def test_robots_are_kept_by_what_they_are_and_not_all(jobs):
    job = jobs[0]
    assert job.run.robot_sha256 == fingerprint(find_spec("youbot"))
    other = replace(job, run=replace(job.run, robot_sha256="of another file"))
    with pytest.raises(Exception, match="its URDF is not what it was"):
        robot_of(other)
    forget_robots()
    _robots.update({str(number): None for number in range(_KEPT)})
    robot_of(job)
    assert list(_robots)[-1] == job.run.robot_sha256
    assert len(_robots) == _KEPT
    forget_robots()


def test_a_job_is_small_and_opens_once(jobs):
    sent = [pickle.dumps(job) for job in jobs]
    assert max(map(len, sent)) < 20_000
    first, second = (pickle.loads(sent[0]) for _ in range(2))
    assert first.robot.open() is second.robot.open()
    assert first.robot.open() == find_spec("youbot")


def test_another_version_is_refused(jobs):
    result = perform(replace(jobs[0], run=replace(jobs[0].run, version="0.0")))
    assert result.status == "failed"
    assert "the suite was started with 0.0" in result.message


def spin(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(1e-3)


def swallow(times):
    """What does not heed so many exceptions, and then goes on for ever."""
    for _ in range(times):
        with contextlib.suppress(TimeLimitError):
            spin(60.0)
    spin(60.0)


def test_a_limit_meets_its_own_thread_only():
    met = []

    def work(seconds, limit):
        try:
            within(limit, spin, seconds, fatal=False)
            met.append((limit, False))
        except TimeLimitError:
            met.append((limit, True))

    threads = [
        threading.Thread(target=work, args=args) for args in [(60.0, 0.1), (0.3, 30.0), (60.0, 0.2)]
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(met) == [(0.1, True), (0.2, True), (30.0, False)]


@pytest.mark.parametrize("seconds", [1e10, float("inf")])
def test_a_limit_may_be_as_long_as_one_likes(seconds):
    assert within(seconds, abs, -1, fatal=True) == 1
    with pytest.raises(TimeLimitError):  # others still strike
        within(0.05, spin, 60.0, fatal=False)


def test_a_limit_that_was_lost_strikes_again():
    with pytest.raises(TimeLimitError):
        within(0.05, swallow, 2, fatal=False)


def test_a_limit_that_is_swallowed_does_not_hit_later_work():
    def swallow_once():
        try:
            spin(60.0)
        except TimeLimitError:
            return "swallowed"

    assert within(0.05, swallow_once, fatal=False) == "swallowed"
    later = 0
    for _ in range(400):  # beyond the time of the next strike
        time.sleep(1e-3)
        later += 1
    assert later == 400


def test_a_worker_in_which_a_limit_struck_is_replaced():
    with WorkerProcesses(1) as processes:
        first = processes.submit(os.getpid).result()
        assert processes.submit(os.getpid).result() == first
        with pytest.raises(TimeLimitError):
            processes.submit(partial(within, 0.05, spin, 60.0, fatal=True)).result()
        assert processes.submit(os.getpid).result() != first


STRUCK = """
import random
import sys
import threading

import mobman as mm
from mobman.benchmark.running.preload import preload
from mobman.benchmark.running.time_limit import TimeLimitError, within

def run():
    return mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.005)

preload()
expected = run().metrics["task_error_max"]
random.seed(1)
struck = 0

def work(limit):
    global struck
    try:
        within(limit, run, fatal=False)
    except TimeLimitError:
        struck += 1

for _ in range(60):
    thread = threading.Thread(target=work, args=(random.uniform(0.0, 0.05),))
    thread.start()
    thread.join()
assert run().metrics["task_error_max"] == expected
print(struck)
"""


def test_wherever_limits_strike_the_process_goes_on():
    done = subprocess.run(
        [sys.executable, "-c", STRUCK], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) > 5


IMPORTED = """
import pickle
import sys

from mobman.benchmark.runner import jobs_of
from mobman.benchmark.running.perform import perform
from mobman.benchmark.running.preload import preload
from mobman.benchmark.suite import Suite
from mobman.controllers.protocol import controllers
from mobman.simulation.scenario import list_scenarios
from mobman.tasks.task import tasks

suite = Suite.model_validate({
    "schema": 1, "name": "all", "duration": 0.004,
    "controllers": {law: {"law": law} for law in controllers.names()},
    "groups": [
        {"robots": ["youbot", "tiago"], "tasks": ["circle"]},
        {"robots": ["youbot"], "tasks": ["circle"], "scenarios": list_scenarios(),
         "controllers": ["tsm"]},
        {"robots": ["youbot"], "tasks": tasks.names(), "controllers": ["tsm"]},
    ],
})
for job in pickle.loads(pickle.dumps(jobs_of(suite.runs(), 600.0, pickle.dumps))):
    first = "runs" not in globals()
    if first:
        preload()
        before, runs = set(sys.modules), 0
    result = perform(job)
    assert result.content is not None, result.message
    runs += 1
assert runs > 30
print(*sorted(set(sys.modules) - before))
"""


def test_no_run_imports_anything():
    """Where a limit strikes within an import, the library may be lost to the process."""
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "\n")
