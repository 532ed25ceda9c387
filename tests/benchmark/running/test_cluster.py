"""The same suite here and on a Dask cluster: the same bits, whatever happens to its workers."""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType

import pytest
from support.dask_cluster import dask_cluster, free_port
from support.suites import bits, run_suite, suite_of

import mobman as mm
from mobman.benchmark.runner import Again, Ended, Waiting
from mobman.benchmark.store import Store
from mobman.controllers.protocol import controllers
from mobman.errors import MobmanError

LAWS = ["pseudo-inverse", "tsm"]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Of two workers for all tests, of which the first ends one and the last the scheduler."""
    with dask_cluster(tmp_path_factory.mktemp("dask"), workers=2) as cluster:
        yield cluster


def test_everywhere_the_same_bits(tmp_path, cluster):
    suite = suite_of(LAWS, seeds=3, duration=0.05)
    run_suite(suite, tmp_path / "one", workers=1)
    expected = bits(tmp_path / "one", suite)
    assert len(expected) == 6
    run_suite(suite, tmp_path / "two", workers=2)
    assert bits(tmp_path / "two", suite) == expected
    with ThreadPoolExecutor(2) as pool:
        run_suite(suite, tmp_path / "threads", executor=pool)
    assert bits(tmp_path / "threads", suite) == expected

    victims = list(cluster.workers)

    def kill_one(event):
        if isinstance(event, Ended) and victims:
            victims.pop().kill()
            victims.clear()

    summary = run_suite(suite, tmp_path / "dask", dask=cluster.address, on_event=kill_one)
    assert not summary.failed
    assert sum(process.poll() is None for process in cluster.workers) == 1
    assert bits(tmp_path / "dask", suite) == expected
    # and by the executor that Dask makes of a client
    from distributed import Client

    with Client(cluster.address, set_as_default=False) as client:
        run_suite(suite, tmp_path / "client", executor=client.get_executor(pure=False))
    assert bits(tmp_path / "client", suite) == expected


@pytest.mark.slow  # it costs eight workers by default
def test_a_run_that_kills_workers_is_told_and_the_others_done(tmp_path, monkeypatch):
    mm.list_controllers()
    module = ModuleType("beside_a_script")  # which no worker could import
    exec(
        "import os, signal\n"
        "class Deadly:\n"
        "    def reset(self, robot, task, dt):\n        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    def step(self, t, q, z, z_dot):\n        return 0.0 * z\n"
        "class Still(Deadly):\n"
        "    def reset(self, robot, task, dt):\n        pass\n",
        module.__dict__,
    )
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(controllers._items, "deadly", module.Deadly)
    monkeypatch.setitem(controllers._items, "still", module.Still)
    suite = suite_of(["deadly", "still"], seeds=2)
    reasons, again = {}, []
    with dask_cluster(tmp_path, workers=1, allowed_failures=0) as cluster:

        def note(event):
            if isinstance(event, Waiting) and event.reason:
                cluster.add_worker()
            if isinstance(event, Again):
                again.append(event.run.law)
            if isinstance(event, Ended) and event.outcome.status == "failed":
                reasons[event.outcome.run.law] = event.outcome.message

        run_suite(suite, tmp_path / "r", dask=cluster.address, on_event=note)
    assert reasons == {
        "deadly": "the worker that had it died (out of memory, over its time limit, or killed); tried "
        "2 times"
    }
    assert again.count("deadly") == 2


def test_an_address_where_nothing_answers_is_told(tmp_path):
    with pytest.raises(MobmanError, match="no Dask scheduler answers at"):
        run_suite(suite_of(LAWS), tmp_path / "r", dask=f"tcp://127.0.0.1:{free_port()}")
    with pytest.raises(MobmanError, match="is not an address of a Dask scheduler"):
        run_suite(suite_of(LAWS), tmp_path / "r", dask="nothing://x y")


def test_another_version_there_is_told(tmp_path, cluster, monkeypatch):
    from mobman.benchmark import backends as module

    here = module.versions()
    monkeypatch.setattr(module, "versions", lambda: here | {"mobman": "9.9"})
    with pytest.raises(MobmanError, match=r"has mobman .*, here it is 9\.9; install the same"):
        run_suite(suite_of(LAWS), tmp_path / "r", dask=cluster.address)
    monkeypatch.setattr(module, "versions", lambda: here | {"numpy": "0.1"})
    with pytest.warns(UserWarning, match=r"has other versions: numpy 0\.1"):
        run_suite(suite_of(["pseudo-inverse"]), tmp_path / "r", dask=cluster.address)


def test_dask_that_is_missing_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MobmanError, match=r"pip install 'mobman\[dask\]'"):
        run_suite(suite_of(LAWS), tmp_path / "r", dask="tcp://127.0.0.1:1")


def test_a_scheduler_that_is_lost_ends_the_suite_clearly(tmp_path, cluster):
    suite = suite_of(LAWS, seeds=10)

    def kill(event):
        if isinstance(event, Ended):
            cluster.scheduler.kill()

    started = time.monotonic()
    with pytest.raises(MobmanError, match=r"lost the Dask scheduler at tcp.* runs were done"):
        run_suite(suite, tmp_path / "r", dask=cluster.address, on_event=kill)
    print("ended after", time.monotonic() - started)
    store = Store(tmp_path / "r")
    assert 1 <= sum(store.done(run) for run in suite.runs()) < 20
