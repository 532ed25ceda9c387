"""Desired trajectories of every task, for several robots and parameters."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.goldens import differences, read, write

import mobman as mm

FILE = "tasks.h5"
TOLERANCE = 1e-9
ROBOTS = ("youbot", "tiago_no_hand", "ridgeback_panda", "hunter_ur10", "fixed_panda")
TIMES = (0.0, 0.37, 1.1, 2.5, 4.9, 7.3)
PARAMETERS = {
    "circle": [{"radius": 0.2, "rate": -0.7, "gap": 0.05}],
    "ellipse": [{"length": 0.4, "width": 0.2, "height": 0.05, "rate": 0.8}],
    "figure-eight": [{"length": 0.4, "width": 0.3, "rate": -0.6}],
    "square": [{"side": 0.2, "rate": 0.9}],
    "lissajous": [
        {
            "frequencies": (1, 2, 3),
            "amplitudes": (0.1, 0.15, 0.05),
            "phases": (0.1, 0.2, 0.3),
            "rate": 0.4,
        }
    ],
    "line": [{"displacement": (0.1, 0.2, -0.05), "travel": 2.0, "pause": 0.5, "returns": False}],
    "kinematic-singularity": [{"depth": -0.03, "travel": 3.0, "pause": 0.2, "within_limits": True}],
    "algorithmic-singularity": [{"depth": -0.02, "travel": 3.0, "pause": 0.2}],
}


def cases() -> list[tuple[str, dict]]:
    """Every task with its defaults, and with other parameters."""
    return [(name, given) for name in mm.list_tasks() for given in ({}, *PARAMETERS.get(name, ()))]


def measured(robot: mm.MobileManipulator, name: str, given: dict) -> dict:
    """p_d and its derivatives at the times; or the error's class, where the task does not fit."""
    try:
        task = mm.make_task(name, robot, **given)
    except mm.MobmanError as error:
        return {"refused": type(error).__name__}
    rows = [task.desired(t) for t in TIMES]
    spans = {key: getattr(task, key, None) for key in ("period", "duration")}
    return {
        **{f"derivative {k}": np.array([row[k] for row in rows]) for k in range(4)},
        "spans": json.dumps(spans),
    }


@pytest.mark.parametrize("name", ROBOTS)
def test_desired_trajectories_are_those_stored(name):
    robot, problems = mm.load_robot(name), []
    for key, stored in read(FILE)[name].items():
        task, _, given = key.partition(" ")
        found, stored = measured(robot, task, json.loads(given)), dict(stored)
        if "spans" in stored:
            spans = json.loads(found.pop("spans", "{}")), json.loads(stored.pop("spans"))
            problems += differences(*spans, TOLERANCE, where=f"{key}: spans")
        problems += differences(found, stored, TOLERANCE, where=key)
    assert not problems, "\n".join(problems)


# Making the file ----------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store the trajectories."""
    content = {}
    for name in ROBOTS:
        robot = mm.load_robot(name)
        content[name] = {
            f"{task} {json.dumps(given)}": measured(robot, task, given) for task, given in cases()
        }
        refused = [key for key, found in content[name].items() if "refused" in found]
        report(f"{name}: refused {refused}")
    write(FILE, content)
