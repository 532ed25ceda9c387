"""Runs to report on, made up: of many cells, without samples that anyone computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from mobman.benchmark.report.data import Results
from mobman.simulation.metrics import list_metrics
from mobman.simulation.record import Record


def made_up_record(n: int = 50, **changes: object) -> Record:
    """A record whose numbers mean nothing."""
    t = np.linspace(0.0, 1.0, n)
    fields = {
        "t": t,
        "q": np.zeros((n, 3)),
        "z": np.zeros((n, 2)),
        "torque": np.stack([np.cos(9.0 * t), 30.0 * np.sin(t)], axis=1),
        "tip_position": np.zeros((n, 2)),
        "tip_desired": np.zeros((n, 2)),
        "task_error": np.stack([np.exp(-20.0 * t), np.zeros(n)], axis=1),
        "auxiliary_error": np.exp(-10.0 * t)[:, None],
        "compute_time": np.full(n, 1e-5),
        "signals": {},
        "metrics": made_up_metrics(1e-9),
        "status": "ok",
        "message": "",
        "robot": "youbot",
        "controller": "tsm",
        "task": "circle",
        "scenario": "nominal",
        "seed": 0,
        "spec": {},
        "settings": {"a": 0.1, "discretization": "implicit"},
        "versions": {"mobman": "0.1.0"},
        "urdf_sha256": "0" * 64,
        "created": "2024-05-01T12:00:00+00:00",
        "joint_names": ["base_x", "y_1", "y_2"],
        "velocity_names": ["alpha_1", "y_1"],
    }
    return Record(**{**fields, **changes})


def made_up_metrics(error: float, **changes: float) -> dict[str, float]:
    """Metrics of a run with a steady error; inf for one that ended early."""
    metrics = {metric.name: 0.5 for metric in list_metrics()}
    metrics |= {"task_error_max": error, "success": float(error < 1e-4), "torque_energy": 3.0}
    metrics |= {"saturation_share": 0.0, "saturation_start": 1.0}
    metrics |= {"position_limit_excess": 0.0, "time_beyond_limits": 0.0}
    return {**metrics, **changes}


def made_up_run(
    label: str,
    error: float,
    *,
    robot: str = "youbot",
    task: str = "circle",
    scenario: str = "nominal",
    dt: float = 1e-3,
    seed: int = 0,
    load: Callable[[], Record] = made_up_record,
    **changes: object,
) -> dict[str, object]:
    """The row of a run with a steady error; of one that ended early if that is inf."""
    ended = math.isinf(error)
    row = {
        "label": label,
        "robot": robot,
        "task": task,
        "scenario": scenario,
        "dt": dt,
        "duration": 1.0,
        "seed": seed,
        "file": f"runs/{robot}-{task}-{scenario}-{dt:g}-{label}-{seed}.h5",
        "law": label,
        "status": "diverged" if ended else "ok",
        "message": "at t = 0.25 s: |z| is 1e9" if ended else "",
        "metrics": made_up_metrics(error),
        "settings": {"k": 1.0},
        "versions": {"mobman": "0.1.0"},
        "created": "2024-05-01T12:00:00+00:00",
        "load": load,
    }
    return {**row, **changes}


def lost_run(run: dict[str, object], reason: str, *, pending: bool = False) -> dict[str, object]:
    """The row of a run without a result in place of one."""
    kept = ("label", "robot", "task", "scenario", "dt", "duration", "seed", "family")
    row = {name: run[name] for name in kept if name in run}
    return {**row, "state": "not run" if pending else "failed", "message": reason}


def results_of(*rows: list[dict[str, object]], **about: object) -> Results:
    """Results of some rows."""
    return Results([row for some in rows for row in some], **about)


def made_up_runs(
    labels: dict[str, float], scenarios: Iterable[str], robots: Iterable[str] = ("youbot",)
) -> list[dict[str, object]]:
    """A run of each label in each cell; its error is the label's, times a cell's own factor."""
    random = np.random.default_rng(3)
    runs = []
    for robot in robots:
        for scenario in scenarios:
            factor = 10.0 ** random.normal()
            for label, error in labels.items():
                own = error * factor * 10.0 ** (0.1 * random.normal())
                runs.append(made_up_run(label, own, robot=robot, scenario=scenario))
    return runs
