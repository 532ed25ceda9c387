"""Ctrl-C, SIGTERM and SIGKILL: what was done is kept, nothing goes on by itself, and it resumes."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time

import psutil
import pytest
from click.testing import CliRunner
from support.suites import bits, run_suite, suite_of

from mobman.benchmark.store import Store
from mobman.benchmark.suite import load_suite
from mobman.cli.bench import bench
from mobman.errors import UsageError

SUITE = """
schema = 1
name = "laws"
duration = {duration}
seeds = {seeds}

[controllers.pseudo-inverse]
law = "pseudo-inverse"

[[groups]]
robots = ["youbot"]
tasks = ["circle"]
scenarios = ["disturbed"]
"""

OTHERWISE = {"PYTHONHASHSEED": "7", "LC_ALL": "C", "OPENBLAS_NUM_THREADS": "3"}
"""What no bit of a result may depend on; the tests' own process has others."""


@pytest.fixture
def start(tmp_path, interruptible):
    """Starts the command in a process group of its own; gives the process."""
    started = []

    def start(duration, seeds, *options):
        suite = tmp_path / "laws.toml"
        suite.write_text(SUITE.format(duration=duration, seeds=list(range(seeds))))
        words = ["bench", "run", str(suite), "-o", str(tmp_path / "r"), *options]
        process = subprocess.Popen(
            [sys.executable, "-m", "mobman", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, **OTHERWISE},
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def until_first_run(process):
    """Read until a run is done."""
    for line in process.stderr:
        if line.startswith("["):
            return
    raise AssertionError("it ended")


def gone(processes, seconds):
    """Whether they end by themselves."""
    return not psutil.wait_procs(processes, timeout=seconds)[1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_suite_keeps_what_was_done(start, tmp_path, number):
    process = start(0.5, 50, "--workers", "2")
    until_first_run(process)
    family = psutil.Process(process.pid).children(recursive=True)
    assert family
    if number == signal.SIGINT:  # as a terminal does, and somebody who is impatient
        while process.poll() is None:
            os.killpg(process.pid, number)
            time.sleep(0.01)
    else:
        process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "mobman: interrupted after " in errors
    assert "the same command goes on from there" in errors
    assert "Traceback" not in errors
    assert gone(family, 10.0)
    suite = load_suite(tmp_path / "laws.toml")
    store = Store(tmp_path / "r")
    kept = [run for run in suite.runs() if store.done(run)]
    assert 1 <= len(kept) < 50
    assert sorted(path.name for path in (tmp_path / "r" / "runs").iterdir()) == sorted(
        store.path(run).name for run in kept
    )
    part = suite.runs().index(kept[0]) + 1, 50
    again = run_suite(suite, tmp_path / "r", part=part)
    assert (again.skipped, again.outcomes) == (1, [])


def test_workers_end_when_the_suite_is_killed(start):
    process = start(60.0, 4, "--workers", "2")
    family = psutil.Process(process.pid)
    for _ in range(600):
        if len(busy := [c for c in family.children(recursive=True) if _works(c)]) >= 2:
            break
        time.sleep(0.1)
    assert len(busy) >= 2
    everyone = family.children(recursive=True)
    process.kill()
    process.wait()
    assert gone(everyone, 20.0)


def _works(process):
    try:
        return "forkserver" in " ".join(process.cmdline()) and process.cpu_times().user > 0.3
    except psutil.Error:
        return False


@pytest.mark.parametrize("kills", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_a_suite_that_is_killed_again_and_again_ends_like_an_undisturbed_one(
    start, tmp_path, kills
):
    chance = random.Random(5)
    for _ in range(kills):
        process = start(0.2, 4 * kills + 2, "--workers", "2")  # some are left whenever it is killed
        until_first_run(process)
        time.sleep(chance.uniform(0.0, 0.08))
        process.kill()
        process.wait()
    suite = load_suite(tmp_path / "laws.toml")
    assert not run_suite(suite, tmp_path / "r", workers=2).failed
    run_suite(suite, tmp_path / "undisturbed", workers=1)
    assert bits(tmp_path / "r", suite) == bits(tmp_path / "undisturbed", suite)
    assert not list((tmp_path / "r").rglob("*.tmp"))


def test_parts_make_the_whole(tmp_path):
    suite = suite_of(["pseudo-inverse"], seeds=3)
    first = run_suite(suite, tmp_path / "r", workers=1, part=(1, 2))
    assert (first.asked, len(first.outcomes)) == (2, 2)
    second = run_suite(suite, tmp_path / "r", workers=1, part=(2, 2))
    assert (second.asked, len(second.outcomes)) == (1, 1)
    assert run_suite(suite, tmp_path / "r", workers=1).skipped == 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--part", "3/2"], "'3/2' is no part: give K/N"),
        (["--part", "half"], "'half' is no part: give K/N"),
        (["--time-limit", "0"], "time-limit"),
    ],
)
def test_options_that_make_no_sense_are_told(options, message):
    result = CliRunner().invoke(bench, ["run", "paper", *options])
    assert result.exit_code == 2
    assert message in result.output


def test_two_places_at_once_are_told(tmp_path):
    with pytest.raises(UsageError, match="workers and dask are given: choose one"):
        run_suite(suite_of(["tsm"]), tmp_path / "r", workers=1, dask="tcp://127.0.0.1:1")
    assert not (tmp_path / "r").exists()
