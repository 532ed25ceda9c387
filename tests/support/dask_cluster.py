"""A Dask cluster on this machine: a scheduler and workers, each a process of its own."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field

_ALLOWED = "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES"


def free_port():
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@dataclass
class DaskCluster:
    """The processes, and where the scheduler is."""

    address: str
    scheduler: subprocess.Popen
    folder: os.PathLike
    workers: list[subprocess.Popen] = field(default_factory=list)

    def add_worker(self):
        command = ["dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        self.workers.append(_start([*command, "--local-directory", str(self.folder)]))


@contextmanager
def dask_cluster(folder, workers, allowed_failures=3):
    """A cluster, ended with the block; its workers start meanwhile.

    Args:
        folder: For the workers' files.
        workers: How many.
        allowed_failures: Deaths of workers that the scheduler puts up with for a task.
    """
    port = free_port()
    command = ["dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    cluster = DaskCluster(
        f"tcp://127.0.0.1:{port}", _start(command, {_ALLOWED: str(allowed_failures)}), folder
    )
    try:
        for _ in range(workers):
            cluster.add_worker()
        _wait_for(port, cluster.scheduler)
        yield cluster
    finally:
        for process in (*cluster.workers, cluster.scheduler):
            process.kill()
            process.wait()


def _start(command, environment=None):
    module, *arguments = command
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **(environment or {})},
    )


def _wait_for(port, process):
    for _ in range(600):
        assert process.poll() is None, "the scheduler did not start"
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the scheduler does not listen")
