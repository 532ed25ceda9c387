"""The task of a run: its fields where it is a dataclass of a known package, or else its name."""

from __future__ import annotations

import contextlib
from typing import Any

from mobman.arrays import Array
from mobman.errors import MobmanError, RecordError, UnknownNameError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.asked.values import NotPlainError, as_plain, from_plain
from mobman.tasks.task import Task, make_task, task_parameters, tasks

_OWN = "mobman.tasks."


def task_asked(given: Task | str, task: Task) -> tuple[dict[str, Any], str]:
    """What a record keeps of the task.

    Args:
        given: As :func:`mobman.simulate` was given it.
        task: The object that ran.

    Returns:
        ``task_name``, the registered name that it was asked for by, or one of the package that its
        class is of, or None; ``task_parameters``, for people; ``task_object``, what it is made of
        again, or None; and why it cannot be made again from these, empty if it can.
    """
    module = type(task).__module__
    name = given if isinstance(given, str) else _registered_in(module)
    found: Any = None
    problem = ""
    try:
        found = as_plain(task, _allowed_by(name))
        if not isinstance(found, dict) or "class" not in found:
            raise NotPlainError(f"{type(task).__name__} is no dataclass")
    except NotPlainError as error:
        found = None
        if not isinstance(given, str):
            problem = f"its task is an object that the file does not hold: {error}"
    return {
        "task_name": name,
        "task_parameters": task_parameters(task),
        "task_object": found,
    }, problem


def task_again(spec: dict[str, Any], robot: MobileManipulator, q0: Array) -> Task:
    """The task of a run.

    Raises:
        RecordError: If there is no such task here.
    """
    name = spec["task_name"]
    try:
        if spec["task_object"] is not None:
            task: Task = from_plain(spec["task_object"], _allowed_by(name))
            return task
        return make_task(str(name), robot, q0, **spec.get("task_given", {}))
    except (NotPlainError, MobmanError, TypeError) as error:
        raise RecordError(f"its task cannot be made: {error}") from error


def _registered_in(module: str) -> str | None:
    """A task of a module; it says what package a class is of. Mobman's own need none."""
    if module.startswith(_OWN):
        return None
    for name, factory in tasks.loaded().items():
        if getattr(factory, "__module__", None) == module:
            return name
    return None


def _allowed_by(name: str | None) -> Any:
    """Which modules' classes may be made: mobman's, and that of the registered task."""
    modules = set()
    if name is not None:
        with contextlib.suppress(UnknownNameError):
            modules.add(getattr(tasks.get(name), "__module__", None))

    def allowed(module: str) -> bool:
        return module.startswith(_OWN) or module in modules

    return allowed
