"""Terms of the equations of motion, kinematics and constants of every robot, at stored states."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest
from support.golden_access import model_terms, robot_constants
from support.goldens import a_last_place_away, differences, read, write
from support.states import random_states

import mobman as mm

FILE = "model.h5"
STATES, TOLERANCE = 2, 1e-10


def measured(robot: mm.MobileManipulator, states: dict) -> dict:
    """Every term at every state, the constants and the names."""
    terms = [
        model_terms(robot, **{name: rows[i] for name, rows in states.items()})
        for i in range(STATES)
    ]
    names = {
        "name": robot.name,
        "tip": robot.tip,
        "joint_names": robot.joint_names,
        "velocity_names": robot.velocity_names,
        "nq, nz": [robot.nq, robot.nz],
    }
    return {
        **{f"state {i}": term for i, term in enumerate(terms)},
        "constants": robot_constants(robot),
        "names": json.dumps(names),
    }


@pytest.mark.parametrize("name", read(FILE))
def test_terms_of_the_model_are_those_stored(name):
    stored = dict(read(FILE)[name])
    found = measured(mm.load_robot(name), stored.pop("states"))
    problems = list(differences(found, stored, TOLERANCE))
    assert not problems, "\n".join(problems)


def test_a_mass_that_is_a_millionth_off_is_noticed():
    stored = dict(read(FILE)["youbot"])
    robot = mm.load_robot("youbot")
    model = robot.model.copy()
    model.inertias[model.njoints - 1].mass *= 1 + 1e-6
    found = measured(robot.with_model(model), stored.pop("states"))
    names = {problem.partition(":")[0] for problem in differences(found, stored, TOLERANCE)}
    assert {"state 0/dynamics/M", "state 0/dynamics/bias", "state 0/energy"} <= names
    assert "state 0/tip_jacobian" not in names


# Making the file ----------------------------------------------------------------------------------


def _check_complete(terms: dict) -> None:
    """Every public method that takes q is among the terms."""
    for name, method in inspect.getmembers(mm.MobileManipulator, inspect.isfunction):
        takes_q = "q" in inspect.signature(method).parameters
        if takes_q and not name.startswith("_") and name not in terms:
            raise SystemExit(f"MobileManipulator.{name} is not among the terms")


def make(report=print) -> None:
    """Store random states of every robot and the terms there."""
    content = {}
    for seed, name in enumerate(mm.list_robots()):
        robot = mm.load_robot(name)
        generator = np.random.default_rng(seed)
        pairs = list(random_states(robot, STATES, seed=seed))
        states = {
            "q": np.array([q for q, _ in pairs]),
            "z": np.array([z for _, z in pairs]),
            "q_dot": np.array([robot.velocity_map(q) @ z for q, z in pairs]),
            "multiplier": generator.standard_normal((STATES, robot.k)),
        }
        found = measured(robot, states)
        _check_complete(found["state 0"])
        moved = {key: a_last_place_away(value, generator) for key, value in states.items()}
        for problem in differences(measured(robot, moved), found, TOLERANCE / 10):
            report(f"{name}, with the last place of the states: {problem}")
        content[name] = {"states": states, **found}
    write(FILE, content)
