"""Everything that a run was asked for."""

from __future__ import annotations

from typing import Any

from mobman.arrays import Array
from mobman.controllers.protocol import Controller
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.asked.controller import controller_asked
from mobman.simulation.asked.robot import GivenPlant, robot_asked
from mobman.simulation.asked.task import task_asked
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import Task


def run_asked(
    *,
    robot: MobileManipulator,
    controller: tuple[Controller | str, Controller],
    task: tuple[Task | str, Task],
    plant: tuple[GivenPlant, MobileManipulator],
    scenario: Scenario,
    duration: float,
    dt: float,
    q0: Array,
    seed: int,
) -> dict[str, Any]:
    """What a record keeps of what :func:`mobman.simulate` was asked for.

    Args:
        robot: The nominal robot.
        controller: As given, and the object that ran.
        task: The same.
        plant: As given, and the true robot that it became.
        scenario: The scenario.
        duration: s.
        dt: Sampling period (s).
        q0: Start, shape (nq,).
        seed: Of all randomness.

    Returns:
        Plain values; ``not_repeatable`` lists why the run cannot be repeated from them, if it cannot.
    """
    law, no_law = controller_asked(*controller)
    aim, no_aim = task_asked(*task)
    return {
        **robot_asked(robot, *plant, q0),
        **law,
        **aim,
        "scenario": scenario.model_dump(mode="json"),
        "duration": duration,
        "dt": dt,
        "q0": q0.tolist(),
        "seed": seed,
        "not_repeatable": [reason for reason in (no_law, no_aim) if reason],
    }
