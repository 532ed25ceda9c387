"""Small suites to try the machinery on."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path

import numpy as np

from mobman.benchmark import runner
from mobman.benchmark.store import Store
from mobman.benchmark.suite import Suite

run_suite = partial(runner.run_suite, report=False)
"""Most tests have no use for the report, which takes a second."""

SMALL = """
schema = 1
name = "small"
duration = {duration}
seeds = [0, 1]

[controllers.pseudo-inverse]
law = "pseudo-inverse"

[controllers.damped]
law = "damped-least-squares"
gains = {{ mu = 0.02 }}

[[groups]]
robots = ["youbot"]
tasks = ["circle"]
scenarios = ["nominal", "disturbed"]
"""


def small_suite(folder: Path, duration: float = 0.02) -> Path:
    """A suite of 8 short runs, as a file."""
    path = folder / "small.toml"
    path.write_text(SMALL.format(duration=duration))
    return path


def suite_of(laws: list[str], *, seeds: int = 1, duration: float = 0.01, **fields: object) -> Suite:
    """A suite of youBot's circle, disturbed, by these laws."""
    return Suite.model_validate(
        {
            "schema": 1,
            "name": "laws",
            "duration": duration,
            "seeds": list(range(seeds)),
            "controllers": {law: {"law": law} for law in laws},
            "groups": [{"robots": ["youbot"], "tasks": ["circle"], "scenarios": ["disturbed"]}],
            **fields,
        }
    )


def bits(folder: Path, suite: Suite) -> dict[str, str]:
    """Of each run of a suite: everything in its record that does not depend on the time it took."""
    store = Store(folder)
    found = {}
    for run in suite.runs():
        record = store.record(run)
        digest = hashlib.sha256(f"{record.status} {record.message}".encode())
        for samples in (record.t, record.q, record.z, record.torque, record.task_error):
            digest.update(np.ascontiguousarray(samples).tobytes())
        for name, value in sorted(record.metrics.items()):
            if not name.startswith("compute_time"):
                digest.update(f"{name} {value.hex()}".encode())
        found[str(run)] = digest.hexdigest()
    return found
