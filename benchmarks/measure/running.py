"""``python -m benchmarks.measure.running``: what the runner itself costs.

- The runner's own cost, each run and once: suites of short runs in one worker, less the same runs
  simulated and written one after the other in one process.
- Two workers against one, in turn, on a suite of a few seconds a run; and two plain processes against
  one with the same runs, which is what the machine can give at the moment.
- Memory of the parent and of its workers over many short runs.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Barrier
from pathlib import Path

import psutil
from threadpoolctl import threadpool_limits

from mobman.benchmark.runner import Ended, run_suite
from mobman.benchmark.suite import Suite, load_suite
from mobman.benchmark.work import simulated_run
from mobman.controllers.protocol import make_controller
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.run_spec import RunSpec


def short_suite(runs: int) -> Suite:
    """Runs of two ticks."""
    return Suite.model_validate(
        {
            "schema": 1,
            "name": "short",
            "duration": 2e-3,
            "seeds": list(range(runs)),
            "controllers": {"pseudo-inverse": {"law": "pseudo-inverse"}},
            "groups": [{"robots": ["youbot"], "tasks": ["circle"]}],
        }
    )


def plain(suite: Suite, folder: str) -> None:
    """The same runs without a runner, of one robot."""
    runs = suite.runs()
    robot = load_robot(runs[0].robot)
    for run in runs:
        _plain_run(run, robot, folder)


def timed(function, *arguments) -> float:
    """Wall time (s) of a call in a process of its own, after a first one."""
    context = multiprocessing.get_context("spawn")
    reader, writer = context.Pipe(duplex=False)
    process = context.Process(target=_timed, args=(writer, function, *arguments))
    process.start()
    taken = reader.recv()
    process.join()
    return taken


def _timed(writer, function, *arguments) -> None:
    function(*arguments)  # imports, machine code and the like
    started = time.perf_counter()
    function(*arguments)
    writer.send(time.perf_counter() - started)


def own_cost(runs: int, repetitions: int) -> None:
    """Print the runner's own cost a run, and what it costs once.

    It is measured for two numbers of runs: the difference tells the cost of each, the rest is that of
    the worker's start and of the like.
    """
    each, once = [], []
    for _ in range(repetitions):
        costs = []
        for count in (runs, 4 * runs):
            suite = short_suite(count)
            with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
                costs.append(timed(_fresh, suite, two) - timed(plain, suite, one))
        each.append((costs[1] - costs[0]) / (3 * runs))
        once.append(costs[0] - runs * each[-1])
    print(
        f"own cost of each run, of {runs} and {4 * runs}: {1e3 * statistics.median(each):.1f} ms "
        f"(from {1e3 * min(each):.1f} to {1e3 * max(each):.1f}); once a suite: "
        f"{statistics.median(once):.2f} s"
    )


def _fresh(suite: Suite, folder: str, workers: int = 1) -> None:
    run_suite(suite, folder, workers=workers, fresh=True)


def speed_up(suite: Suite, repetitions: int) -> None:
    """Print how much faster two workers are, and how much faster two processes without a runner.

    The latter is what the machine can give: its cores may share more than they seem to. In the order
    1, 2, 2, 1, so that a machine that gets slower or faster meanwhile does so for both.
    """
    ratios, ceilings = [], []
    for _ in range(repetitions):
        ratios.append(_ratio(_in_workers, suite))
        ceilings.append(_ratio(_in_plain_processes, suite))
        print(
            f"2 workers against 1: {ratios[-1]:.2f}; 2 plain processes against 1, the same runs: "
            f"{ceilings[-1]:.2f}",
            flush=True,
        )
    print(f"medians: {statistics.median(ratios):.2f} and {statistics.median(ceilings):.2f}")


def _ratio(seconds: Callable[[Suite, int], float], suite: Suite) -> float:
    times = [(count, seconds(suite, count)) for count in (1, 2, 2, 1)]
    one, two = (sum(time for count, time in times if count == wanted) for wanted in (1, 2))
    return one / two


def _in_workers(suite: Suite, workers: int) -> float:
    """Wall time of the suite in a process of its own, all that is needed once included (s)."""
    context = multiprocessing.get_context("spawn")
    reader, writer = context.Pipe(duplex=False)
    process = context.Process(target=_run_in_workers, args=(writer, suite, workers))
    process.start()
    taken = float(reader.recv())
    process.join()
    return taken


def _run_in_workers(writer: Connection, suite: Suite, workers: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        run_suite(suite, folder, workers=workers)
        writer.send(time.perf_counter() - started)


def _in_plain_processes(suite: Suite, count: int) -> float:
    """Wall time of its runs, shared out to processes that have made a run each before (s)."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(count + 1)
    processes = [
        context.Process(target=_run_plainly, args=(suite, part, count, barrier))
        for part in range(count)
    ]
    for process in processes:
        process.start()
    barrier.wait()
    started = time.perf_counter()
    barrier.wait()
    taken = time.perf_counter() - started
    for process in processes:
        process.join()
    return taken


def _run_plainly(suite: Suite, part: int, count: int, barrier: Barrier) -> None:
    runs = suite.runs()
    robots = {run.robot: load_robot(run.robot) for run in runs}
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(limits=1):
        _plain_run(runs[part], robots[runs[part].robot], folder)
        barrier.wait()
        for run in runs[part::count]:
            _plain_run(run, robots[run.robot], folder)
        barrier.wait()


def _plain_run(run: RunSpec, robot: MobileManipulator, folder: str) -> None:
    record = simulated_run(run, robot, make_controller(run.law, **run.gains))
    record.save(Path(folder) / f"{run.run_id}.h5", every=run.record_every)


def memory(runs: int) -> None:
    """Print the memory of parent and workers as runs go by."""
    me, count = psutil.Process(), 0
    marks = {max(1, runs * tenth // 10) for tenth in range(1, 11)} | {min(runs, 100)}

    def look(event) -> None:
        nonlocal count
        if isinstance(event, Ended):
            count += 1
            if count in marks:
                gc.collect()
                workers = [c.memory_info().rss / 1e6 for c in me.children(recursive=True)]
                sizes = " ".join(f"{size:.0f}" for size in sorted(workers))
                print(
                    f"{count} runs: parent {me.memory_info().rss / 1e6:.0f} MB, children {sizes} MB"
                )

    with tempfile.TemporaryDirectory() as folder:
        run_suite(short_suite(runs), folder, workers=2, on_event=look)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=300, help="short runs, for the own cost")
    parser.add_argument("--many", type=int, default=10_000, help="short runs, for the memory")
    parser.add_argument("--suite", default="paper", help="for the speed of two workers")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--only", choices=["cost", "speed", "memory"])
    options = parser.parse_args()
    if options.only in (None, "cost"):
        own_cost(options.runs, options.repetitions)
    if options.only in (None, "speed"):
        speed_up(load_suite(options.suite), options.repetitions)
    if options.only in (None, "memory"):
        memory(options.many)
