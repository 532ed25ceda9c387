"""A law whose best gains are known, and small suites to tune it in."""

from __future__ import annotations

import json
import math
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mobman.benchmark.suite import Suite
from mobman.benchmark.tuning.objective import Objective, objectives
from mobman.controllers.gains import as_settings, gain
from mobman.controllers.protocol import controllers
from mobman.errors import GainError
from mobman.toml_model import validate

BEST = {"x": 30.0, "y": 0.5}
REFUSED = 300.0
EXPLODES = 0.9


class KnownOptimum:
    """Its torque is least at :data:`BEST`; x above :data:`REFUSED` is refused, and with y above
    :data:`EXPLODES` its torque is no number from 10 ms on."""

    name = "known-optimum"
    search_space = {
        "x": {"low": 1.0, "high": 1000.0, "log": True},
        "y": {"low": 0.0, "high": 1.0},
    }

    @dataclass(frozen=True, kw_only=True)
    class Gains:
        x: float = gain(2.0, "1", "a gain")
        y: float = gain(0.1, "1", "another")
        scale: float = gain(1e-3, "N m", "of the torque")

        def __post_init__(self) -> None:
            if self.x > REFUSED:
                raise GainError(f"x = {self.x}: must be at most {REFUSED}")

    def __init__(self, gains):
        self.gains = gains

    def reset(self, robot, task, dt):
        self.nz = robot.nz

    def step(self, t, q, z, z_dot):
        gains = self.gains
        if gains.y > EXPLODES and t > 0.01:
            return np.full(self.nz, np.nan)
        distance = math.log10(gains.x / BEST["x"]) ** 2 + (gains.y - BEST["y"]) ** 2
        return np.full(self.nz, gains.scale * (distance + 1e-6))

    def settings(self):
        return as_settings(self.gains)


class WithoutSpace(KnownOptimum):
    """For which no search space is declared."""

    name = "without-space"
    search_space = None


def torque(metrics):
    """log10 of the largest torque."""
    return math.log10(metrics["torque_peak"])


def register() -> None:
    """The laws, and the objective ``torque``."""
    controllers.register(KnownOptimum.name, KnownOptimum)
    controllers.register(WithoutSpace.name, WithoutSpace)
    objectives.register(
        "torque", Objective("torque", "log10(torque_peak)", ("torque_peak",), torque)
    )


def tuned_fields(**changes):
    """The fields of a suite with two controllers of the known optimum, to be tuned on two runs."""
    fields = {
        "schema": 1,
        "name": "small",
        "duration": 0.02,
        "controllers": {
            "one": {"law": "known-optimum"},
            "two": {"law": "known-optimum", "gains": {"scale": 2e-3}},
        },
        "scenarios": {"heavy": {"mass_factor": 1.5}},
        "groups": [{"robots": ["youbot"], "tasks": ["circle"]}],
        "tuning": {
            "trials": 6,
            "seeds": [5],
            "scenarios": ["heavy", "lighter"],
            "objective": "torque",
        },
    }
    return {**fields, **changes}


def tuned_suite(**changes) -> Suite:
    """The same as a suite."""
    return validate(Suite, tuned_fields(**changes), "suite")


class Inline(Executor):
    """Does everything at once, in this process."""

    def __init__(self) -> None:
        self.count = 0

    def submit(self, function, /, *args, **kwargs):
        future: Future = Future()
        self.count += 1
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def trials_in(folder: Path):
    """The trials of ``tuning.json`` by label, without the time that they took."""
    content = json.loads((folder / "tuning.json").read_text())
    found = {label: entry["trials"] for label, entry in content["controllers"].items()}
    for trials in found.values():
        for trial in trials:
            for run in trial["runs"]:
                del run["seconds"]
    return found
