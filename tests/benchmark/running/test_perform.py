"""What a worker does, without a worker."""

from __future__ import annotations

import pickle
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from support.suites import suite_of

from mobman.benchmark.fingerprint import fingerprint
from mobman.benchmark.runner import _jobs
from mobman.benchmark.running.loaded_robots import _KEPT, _robots, forget_robots, robot_of
from mobman.benchmark.running.perform import perform
from mobman.benchmark.running.time_limit import TimeLimitError, time_limit
from mobman.robots.catalogue import find_spec
from mobman.simulation.record import load_record


@pytest.fixture
def jobs():
    suite = suite_of(["tsm", "pseudo-inverse", "extended-jacobian"], duration=0.02)
    return _jobs(suite.runs(), 60.0, pickle.dumps)


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
    result = perform(replace(jobs[0], version="0.0"))
    assert result.status == "failed"
    assert "the suite was started with 0.0" in result.message


def test_a_limit_meets_its_own_thread_only():
    met = []

    def work(seconds, limit):
        try:
            with time_limit(limit, fatal=False):
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    time.sleep(1e-3)
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


def test_a_limit_that_is_swallowed_does_not_hit_later_work():
    swallowed = []
    with time_limit(0.05, fatal=False):
        try:
            while True:
                time.sleep(1e-3)
        except BaseException as error:
            swallowed.append(type(error))
    later = 0
    for _ in range(20):
        time.sleep(1e-3)
        later += 1
    assert swallowed == [TimeLimitError]
    assert later == 20
