"""``python -m benchmarks.measure.running``: what the runner itself costs.

- The runner's own cost, each run and once: suites of short runs in one worker, less the same runs
  simulated and written one after the other in one process.
- Two workers against one, in turn, on a suite of a few seconds a run; and two plain processes against
  one, which is what the machine can give at the moment.
- Memory of the parent and of its workers over many short runs.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import statistics
import tempfile
import time
from pathlib import Path

import psutil

from mobman.benchmark.runner import Ended, run_suite
from mobman.benchmark.suite import Suite, load_suite
from mobman.controllers.protocol import make_controller
from mobman.model.build import load_robot
from mobman.simulation.closed_loop import simulate


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
    """The same runs without a runner."""
    robot = load_robot("youbot")
    for run in suite.runs():
        controller = make_controller(run.law, **run.gains)
        record = simulate(
            robot, controller, "circle", duration=run.duration, dt=run.dt, seed=run.seed
        )
        record.save(Path(folder) / f"{run.run_id}.h5", every=run.record_every)


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
    """Print how much faster two workers are, and two plain processes."""
    ratios, ceilings = [], []
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder:
            started = time.perf_counter()
            run_suite(suite, folder, workers=1, fresh=True)
            middle = time.perf_counter()
            run_suite(suite, folder, workers=2, fresh=True)
            ended = time.perf_counter()
        ratios.append((middle - started) / (ended - middle))
        ceilings.append(2 * _spin(1) / _spin(2))
        print(
            f"2 workers against 1: {ratios[-1]:.2f}; 2 plain processes against 1: {ceilings[-1]:.2f}"
        )
    print(f"medians: {statistics.median(ratios):.2f} and {statistics.median(ceilings):.2f}")


def _spin(processes: int) -> float:
    """Time that so many processes take, each for the same work (s)."""
    started = time.perf_counter()
    context = multiprocessing.get_context("spawn")
    spinning = [context.Process(target=_work) for _ in range(processes)]
    for process in spinning:
        process.start()
    for process in spinning:
        process.join()
    return time.perf_counter() - started


def _work() -> None:
    total = 0.0
    for i in range(60_000_000):
        total += i


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
