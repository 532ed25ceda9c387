"""What :func:`mobman.simulate` is given, in the forms that it works with."""

from __future__ import annotations

import math
import os

import numpy as np

from mobman.arrays import LARGEST, SMALLEST
from mobman.controllers.protocol import Controller, make_controller
from mobman.errors import UnknownNameError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.simulation.scenario import Scenario, list_scenarios, load_scenario
from mobman.tasks.task import Task, task_map_of

_MOST_TICKS = 10_000_000  # a run keeps some 50 numbers of 8 bytes a tick: 4 GB
_LONGEST = 1e6  # s: in integration steps of at most 1 ms some hours of computing


def resolved_controller(controller: Controller | str) -> Controller:
    """A controller by name, with default gains, or as it is.

    Raises:
        UnknownNameError: If there is no such name.
        UsageError: If it is neither a name nor a controller.
    """
    if isinstance(controller, str):
        return make_controller(controller)
    if isinstance(controller, type) or not isinstance(controller, Controller):
        raise UsageError(
            f"{controller!r} is no controller: it needs reset(robot, task, dt) and "
            "step(t, q, z, z_dot) -> torque"
        )
    return controller


def whole_ticks(duration: float, dt: float) -> int:
    """The number of periods in a run.

    Raises:
        UsageError: If there is none, or there are too many.
    """
    if duration > _LONGEST:
        raise UsageError(f"duration = {duration:g} s; allowed: up to {_LONGEST:g} s")
    ticks = round(duration / dt)
    if not 1 <= ticks <= _MOST_TICKS:
        raise UsageError(
            f"duration = {duration:g} s at dt = {dt:g} s is {duration / dt:.3g} ticks; allowed: 1 to "
            f"{_MOST_TICKS:g}"
        )
    return ticks


def checked_seed(seed: int) -> int:
    """A seed as a plain int.

    Raises:
        UsageError: If it is no whole number from 0 to 2^63 - 1.
    """
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or not 0 <= seed < 2**63:
        raise UsageError(f"seed = {seed!r}: must be a whole number from 0 to 2^63 - 1")
    return int(seed)


def seconds(name: str, value: float) -> float:
    """A duration as a float.

    Raises:
        UsageError: If it is not a number above 0, or of a size that is not allowed.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(value, str) or not SMALLEST <= number <= LARGEST:
        raise UsageError(
            f"{name} = {value!r}: must be a number above 0, from {SMALLEST:g} to {LARGEST:g} s"
        )
    return number


def resolved_scenario(scenario: Scenario | str | os.PathLike[str] | None) -> Scenario:
    """A scenario from whatever form the user has it in; the nominal one by default.

    Raises:
        UnknownNameError: If there is no such name.
        UsageError: If it is neither a scenario nor a name.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if scenario is not None and not isinstance(scenario, (str, os.PathLike)):
        raise UsageError(f"scenario = {scenario!r}: must be a scenario, its name or its file")
    return load_scenario("nominal" if scenario is None else scenario)


def resolved_plant(
    robot: MobileManipulator,
    plant: MobileManipulator | Scenario | str | os.PathLike[str] | None,
    scenario: Scenario,
    random: np.random.Generator,
) -> MobileManipulator:
    """The true robot: the nominal one, or the one given, with the scenario's masses and payload.

    Args:
        robot: The nominal robot.
        plant: As it was given.
        scenario: Whose masses and payload it has, if ``plant`` is no other scenario.
        random: The run's generator.

    Raises:
        UnknownNameError: If a plant is named that is no scenario.
        UsageError: If it has other joints, or is nothing of the kind.
        SpecError: If a piece of the scenario does not fit the robot.
    """
    base, changes = robot, scenario
    if isinstance(plant, MobileManipulator):
        if plant.joint_names != robot.joint_names:
            raise UsageError(f"the plant {plant.name!r} has other joints than {robot.name!r}")
        base = plant
    elif isinstance(plant, Scenario):
        changes = plant
    elif isinstance(plant, (str, os.PathLike)):
        text = os.fspath(plant)
        if text not in list_scenarios() and not text.endswith(".toml"):
            raise UnknownNameError("plant", text, list_scenarios())
        changes = load_scenario(text)
    elif plant is not None:
        raise UsageError(
            f"plant = {plant!r}: must be a robot, a scenario, a scenario's name or its file"
        )
    return changes.true_robot(base, random)


def fitting_task_map(task: Task, robot: MobileManipulator) -> TaskMap:
    """The task map of a task that the robot has enough degrees of freedom for.

    Raises:
        UsageError: If it has not, or the task gives no such vectors.
    """
    task_map = task_map_of(task)
    if robot.nz < task_map.m:
        raise UsageError(
            f"robot {robot.name!r} has {robot.nz} degrees of freedom for a task of {task_map.m}"
        )
    return task_map


def plant_name(plant: MobileManipulator | Scenario | str | os.PathLike[str] | None) -> str | None:
    """What a record calls the plant that was given; None if there was none."""
    if plant is None or isinstance(plant, (str, os.PathLike)):
        return None if plant is None else os.fspath(plant)
    return plant.name
