"""How cost grows: with the arm, with the sampling period, with the number of workers."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from chains import chain_robot
from peers.bare_pinocchio import make_bare_controller

import mobman as mm
from measure.cases import PAPER_GAINS, case_of, replay, tape
from measure.rounds import Measure, Spread, batch, exponent, interleaved, once
from mobman.benchmark.backends import default_workers
from mobman.benchmark.runner import run_suite
from mobman.benchmark.suite import load_suite

JOINTS = (3, 5, 8, 12, 17, 24, 32, 40)
PERIODS = (0.5e-3, 1e-3, 2e-3, 5e-3, 10e-3)

_TAPE = 200  # ticks of the run that a chain's controller is told again
_SUITE = """
schema = 1
name = "workers"
duration = {duration}
seeds = {seeds}
record_period = 10e-3

[controllers.tsm]
law = "tsm"
gains = {{ a = {a}, A = {A} }}

[[groups]]
robots = ["youbot"]
tasks = ["paper"]
"""


def with_joints(rounds: int, batch_seconds: float) -> dict[str, Any]:
    """A controller's step on chains of 3 to 40 joints: all of it, Pinocchio's part, and the rest.

    Returns:
        ``joints``, ``nz``; seconds ``step``, ``bare_controller`` and ``own``, their difference in
        each round, as medians and quartiles; ``exponent`` of ``own`` over nz, for all sizes and for
        the larger half of them.
    """
    measures: dict[str, Measure] = {}
    sizes = []
    with TemporaryDirectory() as folder:
        for joints in JOINTS:
            case = case_of(chain_robot(joints, Path(folder)))
            sizes.append(case.robot.nz)
            measures[f"step {joints}"] = replay(case, tape(case, _TAPE))
            measures[f"bare {joints}"] = batch(make_bare_controller(case.robot), batch_seconds)
        taken = interleaved(measures, rounds)
    step = [taken[f"step {joints}"] for joints in JOINTS]
    bare = [taken[f"bare {joints}"] for joints in JOINTS]
    own = [whole - part for whole, part in zip(step, bare, strict=True)]
    costs = np.array([np.median(values) for values in own])
    half = len(JOINTS) // 2
    return {
        "joints": list(JOINTS),
        "nz": sizes,
        "step": [asdict(Spread.of(values)) for values in step],
        "bare_controller": [asdict(Spread.of(values)) for values in bare],
        "own": [asdict(Spread.of(values)) for values in own],
        "exponent": {
            "all": exponent(np.array(sizes), costs),
            "larger half": exponent(np.array(sizes[half:]), costs[half:]),
        },
    }


def with_period(rounds: int, simulated: float) -> dict[str, Any]:
    """Seconds of computing for a second of simulated time, by sampling period, on the youBot.

    Args:
        rounds: Repetitions.
        simulated: Duration of the runs (s).
    """
    case = case_of(mm.load_robot("youbot"))

    def run(dt: float) -> Measure:
        measure = once(lambda: case.run(round(simulated / dt), dt=dt))
        return lambda: measure() / simulated

    taken = interleaved({f"{dt:g}": run(dt) for dt in PERIODS}, rounds)
    return {
        "dt": list(PERIODS),
        "seconds_per_simulated_second": [asdict(Spread.of(taken[f"{dt:g}"])) for dt in PERIODS],
    }


def with_workers(runs: int, duration: float, most: int | None = None) -> dict[str, Any]:
    """Runs a minute of a suite of equal runs, by number of workers, their start included.

    Args:
        runs: How many there are.
        duration: Of each (simulated s).
        most: Largest number of workers; as many as a suite has by default if None.
    """
    text = _SUITE.format(duration=duration, seeds=list(range(runs)), **PAPER_GAINS)
    most = most or default_workers()
    numbers = [workers for workers in (1, 2, 4, 8, 16, 32, 64) if workers < most] + [most]
    seconds = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "workers.toml"
        path.write_text(text)
        suite = load_suite(path)
        for workers in numbers:
            summary = run_suite(suite, Path(folder) / str(workers), workers=workers)
            if summary.failed:
                raise RuntimeError(f"the suite failed: {summary.failed[0].message}")
            seconds.append(summary.seconds)
    return {
        "runs": runs,
        "duration": duration,
        "workers": numbers,
        "runs_per_minute": [60.0 * runs / taken for taken in seconds],
        "speed_up": [seconds[0] / taken for taken in seconds],
    }
