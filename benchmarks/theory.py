"""Tables of docs/theory.md: gains, the inertia in the metric, damping, bounds, and the explicit form.

python benchmarks/theory.py gains [LAMBDA_1 ...]
python benchmarks/theory.py metric
python benchmarks/theory.py damping
python benchmarks/theory.py bounds [ROBOT ...]
python benchmarks/theory.py explicit
python benchmarks/theory.py monitors [ROBOT ...]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numba import njit

import mobman as mm
from mobman.controllers.bounds import PAPER, computed_bounds

PAPERS: dict[str, Any] = {"a": 0.2, "A": 0.2}
"""The paper's bounds, of its section 4."""
METRICS = (
    *((1.0, 1 / 3, PAPERS), (1.0, 1.0, PAPERS), (1.0, 1.43, PAPERS), (1.0, 1.9, PAPERS)),
    *((1.0, 2.1, PAPERS), (1.0, 1 / 30, PAPERS), (1.0, 1 / 30, {})),
    *((3.0, 1.0, PAPERS), (0.45, 1.0, PAPERS), (0.45, 0.5, PAPERS)),
)
"""True inertia over the nominal one, ``metric_scale`` and bounds."""
ENDS = ("youbot", "ridgeback_panda", "husky_ur5", "fixed_panda")
DAMPED = (
    ("algorithmic-singularity", 0.05, ("husky_ur5", "tiago_no_hand")),
    ("kinematic-singularity", 0.0, ENDS),
    ("kinematic-singularity", 0.05, ENDS),
)
"""Paths, how far they go beyond the singularity (m), and robots."""
BOUNDED = ("youbot", "tiago_dual", "hunter_ur10", "fixed_panda", "ranger_xarm7")
FORMS = (
    *((1.0, "explicit", 0.0, 1.0), (0.1, "explicit", 0.0, 1.0), (0.01, "explicit", 0.0, 0.3)),
    *((0.01, "explicit", 0.0, 1.2), (0.002, "explicit", 0.0, 0.06)),
    *((1.0, "explicit", width, 2.0) for width in (1e2, 1e4, 1e6)),
    *((1.0, "implicit", 0.0, 0.3), (0.1, "implicit", 0.0, 0.2)),
)
"""Sampling period (ms), discretisation, boundary layer and length (s)."""


@njit
def _rate(x: Any, lambda_1: float, lambda_2: float) -> Any:
    inner = math.copysign(abs(x[1]) ** (9 / 7), x[1]) + x[0]
    g = math.copysign(abs(x[2]) ** 0.6, x[2])
    g += lambda_1**0.6 * math.copysign(abs(inner) ** (1 / 3), inner)
    return np.array([x[1], x[2], -lambda_2 * g])


@njit
def grows(lambda_1: float, lambda_2: float, dt: float = 1e-3) -> bool:
    """True if e''' = -g of (31), lambda_0 = 1, from e = 1, is larger after 50 s than before 30 s."""
    x = np.array([1.0, 0.0, 0.0])
    early = late = 0.0
    for i in range(round(60.0 / dt)):
        k1 = _rate(x, lambda_1, lambda_2)
        k2 = _rate(x + 0.5 * dt * k1, lambda_1, lambda_2)
        k3 = _rate(x + 0.5 * dt * k2, lambda_1, lambda_2)
        k4 = _rate(x + dt * k3, lambda_1, lambda_2)
        x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if 20.0 <= i * dt < 30.0:
            early = max(early, abs(x[0]))
        elif i * dt >= 50.0:
            late = max(late, abs(x[0]))
    return late > early


def least_gain(lambda_1: float) -> float:
    """The least lambda_2 with which the oscillation decays, by bisection to 1 %."""
    low, high = 0.1, 10.0
    while high / low > 1.01:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if grows(lambda_1, middle) else (low, middle)
    return high


def paper(
    scenario: mm.Scenario | str = "nominal", duration: float = 8.0, dt: float = 1e-3, **gains: Any
) -> mm.Record:
    """A run of the paper's task on its youBot."""
    law = mm.make_controller("tsm", **gains)
    return mm.simulate("youbot", law, "paper", scenario=scenario, duration=duration, dt=dt)


def end(record: mm.Record) -> str:
    """|e^e| at the end (m), or how the run ended before."""
    if not record.ok:
        return f"{record.status} at {record.t[-1]:.2g} s"
    return f"{np.linalg.norm(record.task_error[-1, :3]):.1e}"


def metric_rows() -> Iterator[list[str]]:
    """True inertia and that of the metric."""
    for factor, scale, bounds in METRICS:
        record = paper(mm.Scenario(name="mass", mass_factor=factor), metric_scale=scale, **bounds)
        yield [f"{factor:g}", f"{scale:.3g}", "0.2" if bounds else "automatic", end(record)]


def damping_rows() -> Iterator[list[str]]:
    """Passing singularities: largest error, that at the end, and that of the law without damping."""
    for path, depth, robots in DAMPED:
        for robot in robots:
            task = mm.make_task(path, robot, depth=depth)
            damped, plain = (
                mm.simulate(robot, mm.make_controller("tsm", damping=one), task, duration=10.0)
                for one in (10.0, 0.0)
            )
            largest = np.linalg.norm(damped.task_error[:, :3], axis=1).max()
            yield [
                f"`{path}`",
                f"{depth:g}",
                f"`{robot}`",
                f"{largest:.1e}",
                end(damped),
                end(plain),
            ]


def bounds_rows(robots: Sequence[str]) -> Iterator[list[str]]:
    """Computed constants; of a, "none" where the search ended at a singular J."""
    for name in ("paper", *robots):
        values, regular = PAPER, True
        if name != "paper":
            robot = mm.load_robot(name)
            values, *_, regular = computed_bounds(robot, mm.make_task("circle", robot))
        cells = [f"{value:.3g}" for key, value in values.items() if key not in ("w_6", "a")]
        yield [f"`{name}`", *cells[:-1], f"{values['a']:.1e}" if regular else "none", cells[-1]]


def explicit_rows() -> Iterator[list[str]]:
    """Error at the end, largest |S|, and total variations of v and of v'."""
    for period, form, width, duration in FORMS:
        gains = {"discretization": form, "boundary_layer": width, **PAPERS}
        record = paper(duration=duration, dt=1e-3 * period, **gains)
        S = np.linalg.norm(record.signals["sliding/S"], axis=1).max()
        variations = (record.metrics[f"torque_{name}"] for name in ("variation", "rate_variation"))
        cells = (f"{one:.1e}" if record.ok else "" for one in (S, *variations))
        yield [f"{period:g}", f"`{form}`", f"{width:g}", f"{duration:g}", end(record), *cells]


def monitor_rows(robots: Sequence[str]) -> Iterator[list[str]]:
    """Of each stage: least regularity, largest share of its bound, and least margin of the gain."""
    runs: Any = [("youbot", "paper", PAPERS, 8.0, 1e-3)]
    for robot, task, bounds, duration, dt in runs + [(r, "circle", {}, 2.0, 2e-3) for r in robots]:
        law = mm.make_controller("tsm", **bounds)
        record = mm.simulate(robot, law, task, duration=duration, dt=dt, monitor=True)
        names = ("regularity", "bound_ratio", "gain_margin")
        stages = ("kinematic", "dynamic")
        cells = [f"{record.metrics[f'{n}_{stage}']:.4g}" for stage in stages for n in names]
        yield [f"`{robot}`", f"`{task}`", *cells]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "table", choices=("gains", "metric", "damping", "bounds", "explicit", "monitors")
    )
    parser.add_argument("names", nargs="*", help="values of lambda_1, or robots")
    given = parser.parse_args(arguments)
    if given.table == "gains":
        values = map(float, given.names or (0.5, 1, 2, 5, 11, 20, 50))
        rows = ([f"{value:g}", f"{least_gain(value):.2f}"] for value in values)
    elif given.table == "monitors":
        rows = monitor_rows(given.names or mm.list_robots())
    elif given.table == "bounds":
        rows = bounds_rows(given.names or BOUNDED)
    else:
        rows = {"metric": metric_rows, "damping": damping_rows, "explicit": explicit_rows}[
            given.table
        ]()
    for row in rows:
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
