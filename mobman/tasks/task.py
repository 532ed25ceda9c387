"""What a task is, and the registry of those with names."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.kernels.program import Call, call
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap, task_map_for
from mobman.registry import Registry
from mobman.tasks.parameters import Parameter, check, declared_parameters


@runtime_checkable
class Task(Protocol):
    """A desired trajectory of the tip; any object with this method is one.

    Optional attributes: ``period`` (s), where the path closes, for the metric of repeatability;
    ``duration`` (s), how long it is defined; ``name``, for records; ``steps(t, p_d) -> list[Call]``,
    kernels that do the same as ``desired`` (:func:`task_steps`).
    """

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p_d, p_d', p_d'', p_d''' at time t (m, m/s, ...), each of shape (m,), m = 3 or 2."""
        ...


class TaskFactory(Protocol):
    """Makes a named task for a robot at its start.

    What its signature has beyond these two are the task's parameters, each with the values that its
    annotation allows (:mod:`mobman.tasks.parameters`).
    """

    def __call__(self, robot: MobileManipulator, q0: Array, /) -> Task:
        """The task for ``robot`` that starts at configuration ``q0``."""
        ...


tasks: Registry[TaskFactory] = Registry("task", "mobman.tasks.trajectories", "mobman.tasks")


def list_tasks() -> list[str]:
    """The names that :func:`mobman.simulate` takes as ``task``."""
    return tasks.names()


def make_task(
    name: str,
    robot: MobileManipulator | str,
    q0: Array | None = None,
    **parameters: Any,
) -> Task:
    """A task by name.

    Args:
        name: One of :func:`list_tasks`.
        robot: Who has to do it; by name or object.
        q0: Where it starts; ``robot.q_rest`` by default.
        **parameters: Those of the task (:func:`parameters_of`) that are not to have their defaults.

    Raises:
        UnknownNameError: If no task has the name.
        UsageError: If the task has no such parameters or they no such values; if q0, or the task, does
            not fit the robot.
    """
    checked = check_parameters(name, parameters)
    if isinstance(robot, str):
        robot = load_robot(robot)
    start = robot.q_rest if q0 is None else robot.checked_configuration(q0)
    return tasks.get(name)(robot, start, **checked)


def parameters_of(name: str) -> list[Parameter]:
    """The parameters that a named task takes.

    Raises:
        UnknownNameError: If no task has the name.
    """
    return list(declared_parameters(tasks.get(name)).values())


def check_parameters(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a named task, checked as far as they can be without a robot.

    Args:
        name: One of :func:`list_tasks`.
        parameters: Those that are given.

    Raises:
        UnknownNameError: If no task has the name.
        UsageError: With everything that is wrong: unknown parameters and values that are not allowed.
    """
    return check(name, tasks.get(name), parameters)


def task_steps(task: Task, t: Array, p_d: Array) -> list[Call]:
    """Steps of a program that write p_d and its derivatives at a time into an array.

    Args:
        task: The task.
        t: The time (s), shape (1,); read when the steps run.
        p_d: For the four vectors, shape (4, m).
    """
    steps = getattr(task, "steps", None)
    if steps is not None:
        own: list[Call] = steps(t, p_d)
        return own

    def desire() -> None:
        for row, part in enumerate(task.desired(float(t[0]))):
            p_d[row] = part

    return [call(desire)]


def task_map_of(task: Task) -> TaskMap:
    """The task map that fits a task's p_d.

    Raises:
        UsageError: If ``desired`` does not give four vectors of 3 (or of 2) components.
    """
    if not isinstance(task, Task):
        raise UsageError(
            f"{task!r} is no task: it needs a method desired(t) -> (p_d, p_d', p_d'', p_d''')"
        )
    parts = task.desired(0.0)
    shapes = [np.shape(part) for part in parts] if isinstance(parts, (tuple, list)) else []
    if len(shapes) != 4 or len(set(shapes)) != 1 or len(shapes[0]) != 1:
        raise UsageError(
            f"desired(t) of {type(task).__name__} gave arrays of shapes {shapes}; needed: four "
            "vectors p_d, p_d', p_d'', p_d''' of one length"
        )
    return task_map_for(shapes[0][0])


def task_parameters(task: Task) -> dict[str, Any]:
    """What is known of a task beyond its name: its type, and its fields if it is a dataclass."""
    if not dataclasses.is_dataclass(task) or isinstance(task, type):
        return {"type": type(task).__name__}
    fields = {field.name: getattr(task, field.name) for field in dataclasses.fields(task)}
    return {"type": type(task).__name__, **{key: _plain(value) for key, value in fields.items()}}


def _plain(value: Any) -> Any:
    """A value with lists for tuples, as files have them."""
    return [_plain(item) for item in value] if isinstance(value, (tuple, list)) else value
