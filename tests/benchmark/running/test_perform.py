"""What a worker does, without a worker."""

from __future__ import annotations

import os
import pickle
from dataclasses import replace

import numpy as np
import pytest
from support.suites import suite_of

from mobman.benchmark.work import _KEPT, _robots, jobs_of, packed, perform, robot_of
from mobman.benchmark.workers import Workers
from mobman.robots.catalogue import find_spec
from mobman.simulation.record import load_record
from mobman.simulation.run_spec import fingerprint


@pytest.fixture
def jobs():
    suite = suite_of(["tsm", "pseudo-inverse", "extended-jacobian"], duration=0.02)
    return jobs_of(suite.runs(), 60.0)


def state(result, folder):
    assert result.content is not None, result.message
    path = folder / "run.h5"
    path.write_bytes(result.content)
    record = load_record(path)
    return np.hstack([record.q, record.z, record.torque, record.task_error])


def test_a_robot_that_was_used_before_gives_the_same_bits(jobs, tmp_path):
    fresh = []
    for job in jobs:
        _robots.clear()
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
    _robots.clear()
    _robots.update({str(number): None for number in range(_KEPT)})
    robot_of(job)
    assert list(_robots)[-1] == job.run.robot_sha256
    assert len(_robots) == _KEPT
    _robots.clear()


def test_a_job_is_small(jobs):
    sent = [packed(job, pickle.dumps) for job in jobs]
    assert max(map(len, sent)) < 20_000
    assert pickle.loads(sent[0]) == jobs[0]


def test_a_process_serves_until_it_is_lost():
    workers = Workers(1, 60.0)
    first = workers.submit(os.getpid).result()
    assert workers.submit(os.getpid).result() == first
    assert workers.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    with pytest.raises(Exception, match="ended with exit status 3"):
        workers.submit(os._exit, 3).result()
    assert workers.submit(os.getpid).result() != first
    workers.shutdown()


def test_another_version_is_refused(jobs):
    result = perform(replace(jobs[0], run=replace(jobs[0].run, version="0.0")))
    assert result.status == "failed"
    assert "the suite was started with 0.0" in result.message
