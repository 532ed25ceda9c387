"""Interface of a task, the registry of those with names, and the parameters that they take."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import math
import sys
import typing
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from numbers import Real
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, ValidationError, validate_call
from pydantic.fields import FieldInfo

from mobman.arrays import SIZES, Array, beyond_sizes
from mobman.errors import UsageError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import UNIT
from mobman.model.task_map import TaskMap, task_map_for
from mobman.registry import Registry, made_by


@runtime_checkable
class Task(Protocol):
    """A desired trajectory of the tip; any object with this method is one.

    The shapes say what the task is about:

    - **position**, m = 3, or its x and y, m = 2: four vectors of m components;
    - **pose**, m = 6: p_d has 7, the position and the unit quaternion (w, x, y, z) that takes the tip
      frame's axes to the world's; the other three have 6, the linear velocity, acceleration and jerk,
      and Omega_d, Omega_d', Omega_d'', the angular velocity in world axes and its derivatives;
    - **pointing**, m = 5: p_d has 6, the position and the unit vector, in world axes, that an axis of
      the tip frame has to take; the others are its derivatives.

    Optional attributes: ``period`` (s), where the path closes, for the metric of repeatability;
    ``duration`` (s), how long it is defined; ``name``, for records; ``tip_axis``, the axis of the tip
    frame that points, (0, 0, 1) without it; ``entry(t, p_d)``, which gives a function without arguments
    that does the same as ``desired``, for speed (:func:`task_entry`);
    ``criterion_weights(robot)``, a diagonal of K_F in the place of the robot's, shape (nq,).

    >>> import mobman as mm
    >>> import numpy as np
    >>> class Stay:
    ...     def desired(self, t):
    ...         return np.array([2.0, 0.0, 0.3]), np.zeros(3), np.zeros(3), np.zeros(3)
    >>> isinstance(Stay(), mm.Task)
    True
    >>> mm.simulate("youbot", "pseudo-inverse", Stay(), duration=0.05).task_error.shape
    (51, 3)
    """

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p_d, p_d', p_d'', p_d''' at time t (m, m/s, ...); shapes as above."""
        ...


class TaskFactory(Protocol):
    """Makes a named task for a robot at its start.

    What its signature has beyond these two are the task's parameters, each with the values that its
    annotation allows (:func:`parameter`).
    """

    def __call__(self, robot: MobileManipulator, q0: Array, /) -> Task:
        """The task for ``robot`` that starts at configuration ``q0``."""
        ...


tasks: Registry[TaskFactory] = Registry("task", "mobman.tasks", "mobman.tasks")


def list_tasks() -> list[str]:
    """The names that :func:`mobman.simulate` takes as ``task``, sorted: mobman's and other packages'.

    >>> import mobman as mm
    >>> "circle" in mm.list_tasks()
    True
    """
    return tasks.names()


def make_task(
    name: str, robot: MobileManipulator | str, q0: Array | None = None, **parameters: Any
) -> Task:
    """A task by name.

    Args:
        name: One of :func:`list_tasks`.
        robot: Who has to do it; by name or object.
        q0: Where it starts; ``robot.q_rest`` by default.
        **parameters: Those of the task (:func:`parameters_of`, units as ``mobman tasks NAME`` lists
            them) that are not to have their defaults.

    >>> import mobman as mm
    >>> circle = mm.make_task("circle", "youbot", radius=0.3)
    >>> circle.radius, [len(part) for part in circle.desired(0.0)]
    (0.3, [3, 3, 3, 3])

    Raises:
        UnknownNameError: If no task has the name.
        UsageError: If the task has no such parameters or they no such values; if q0, or the task, does
            not fit the robot.
    """
    checked = check_parameters(name, parameters)
    if not isinstance(robot, MobileManipulator):
        robot = load_robot(robot)
    start = robot.q_rest if q0 is None else robot.checked_configuration(q0)
    problem = f"task {name!r} cannot be made of a robot and q0"
    task: Task = made_by(tasks.get(name), problem, robot, start, **checked)
    return task


# Parameters ------------------------------------------------------------------------------------------


class Parameter(NamedTuple):
    """A parameter that a task takes."""

    name: str
    annotation: Any
    default: Any
    """Default in the factory's signature; None is by convention what the robot decides."""
    required: bool
    unit: str = ""
    """Unit as declared by :func:`parameter`; empty if it is not."""
    meaning: str = ""
    """Meaning as declared; empty if it is not."""


def parameter(unit: str, meaning: str, **bounds: Any) -> Any:
    """Declare unit, meaning and bounds of a task's parameter in its annotation.

    Args:
        unit: Its unit, ``"1"`` if it has none.
        meaning: What it is.
        **bounds: What pydantic's ``Field`` takes: ``gt``, ``ge``, ``lt``, ``le``, ``min_length``, ...
    """
    return Field(description=meaning, json_schema_extra={"unit": unit}, **bounds)


def _not_zero(value: float | None) -> float | None:
    if value == 0.0:
        raise ValueError("must not be 0")
    return value


def _of_a_size(value: Any) -> Any:
    if beyond_sizes(value):
        raise ValueError(f"must be {SIZES}")
    return value


NOT_ZERO = AfterValidator(_not_zero)
"""Annotation of a parameter that may be positive or negative."""
Three = Annotated[Sequence[float], Field(min_length=3, max_length=3)]
"""A parameter of three numbers."""


def parameters_of(name: str) -> list[Parameter]:
    """The parameters that a named task takes.

    Raises:
        UnknownNameError: If no task has the name.
    """
    found = []
    for item in _taken(tasks.get(name)):
        if item.kind is item.VAR_KEYWORD:
            continue
        declared = FieldInfo.from_annotation(item.annotation)
        extra: Any = declared.json_schema_extra or {}
        required = item.default is item.empty
        texts = str(extra.get("unit", "")), declared.description or ""
        default = None if required else item.default
        found.append(Parameter(item.name, item.annotation, default, required, *texts))
    return found


def check_parameters(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a named task, checked as far as they can be without a robot.

    Args:
        name: One of :func:`list_tasks`.
        parameters: Those that are given.

    Raises:
        UnknownNameError: If no task has the name.
        UsageError: With everything that is wrong: unknown parameters and values that are not allowed.
    """

    def accept(**values: Any) -> dict[str, Any]:
        return values

    taken = _taken(tasks.get(name))
    accept.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
    accept.__annotations__ = {
        item.name: Annotated[item.annotation, AfterValidator(_of_a_size)] for item in taken
    }
    config = ConfigDict(strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
    try:
        values = validate_call(config=config)(accept)(**parameters)
    except ValidationError as error:
        faults: dict[str, list[Any]] = {}
        for fault in error.errors():
            faults.setdefault(str(fault["loc"][0]), []).append(fault)
        allowed = {item.name: item for item in parameters_of(name)}
        names = sorted(faults, key=lambda key: key not in parameters)  # what is missing comes last
        problems = [_problem(key, parameters, faults[key], allowed) for key in names]
        raise UsageError(f"task {name!r}: {'; '.join(problems)}") from None
    return {key: values[key] for key in parameters}


def _problem(
    name: str, given: Mapping[str, Any], faults: list[Any], allowed: Mapping[str, Parameter]
) -> str:
    if name not in allowed:
        near = difflib.get_close_matches(name, allowed, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}? " if near else ""
        return f"parameter {name!r} is unknown; {hint}allowed: {', '.join(allowed) or 'none'}"
    if name not in given:
        return f"parameter {name!r} is missing"
    reasons = dict.fromkeys(
        fault["msg"].removeprefix("Value error, ")
        + "".join(f" (entry {part})" for part in fault["loc"] if isinstance(part, int))
        for fault in faults
    )
    text, unit = " ".join(repr(given[name]).split()), allowed[name].unit
    text = text if len(text) <= 60 else text[:57] + "..."
    unit = f" ({unit})" if unit not in ("", "1") else ""
    return f"parameter {name!r}{unit} is {text}: {', '.join(reasons)}"


def _taken(factory: Callable[..., Any]) -> list[inspect.Parameter]:
    """Parameters that a factory takes after the robot and q0, by their names, with their types."""
    try:
        signature = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):  # some callables of other languages have no signature
        return []
    module = sys.modules.get(getattr(factory, "__module__", ""), None)
    scope = getattr(factory, "__globals__", None) or vars(module or SimpleNamespace())

    def resolved(item: inspect.Parameter) -> inspect.Parameter:
        written = SimpleNamespace(__annotations__={item.name: item.annotation})
        annotation: Any = Any
        if item.annotation is not item.empty:
            with suppress(NameError):  # a name that type checkers alone know
                annotation = typing.get_type_hints(written, scope, include_extras=True)[item.name]
        kind = item.kind if item.kind is item.VAR_KEYWORD else item.KEYWORD_ONLY
        return item.replace(annotation=annotation, kind=kind)

    return [
        resolved(item)
        for i, item in enumerate(signature)
        if item.kind in (item.KEYWORD_ONLY, item.VAR_KEYWORD)
        or (i > 1 and item.kind is item.POSITIONAL_OR_KEYWORD)
    ]


# Use of a task by others -------------------------------------------------------------------------------


def task_entry(task: Task, t: Array, p_d: Array) -> Callable[[], None]:
    """A function that writes p_d and its derivatives at a time into an array.

    Args:
        task: The task.
        t: The time (s), shape (1,); read when the function is called.
        p_d: For the four vectors, shape (4, m); of a pose (4, 7), whose last column has a meaning in the
            first row only.
    """
    entry = getattr(task, "entry", None)
    if entry is not None:
        own: Callable[[], None] = entry(t, p_d)
        return own

    def desire() -> None:
        for row, part in enumerate(task.desired(float(t[0]))):
            p_d[row, : len(part)] = part

    return desire


def require_freedom(robot: MobileManipulator, task: Task) -> None:
    """Refuse a task of more coordinates than the robot has degrees of freedom.

    Raises:
        UsageError: If it has.
    """
    if robot.nz < (m := task_map_of(task).m):
        raise UsageError(
            f"robot {robot.name!r} has {robot.nz} degrees of freedom for a task of {m}"
            + ("; a task of position has 3" if m > 3 else "")
        )


def task_map_of(task: Task) -> TaskMap:
    """The task map that fits a task's p_d.

    Raises:
        UsageError: If ``desired`` does not give four vectors of shapes that :class:`Task` allows, or its
            quaternion, its axis or ``tip_axis`` has another length than 1; if they are not finite
            numbers, or ``period`` or ``duration`` is no time.
    """
    if not isinstance(task, Task):
        raise UsageError(
            f"{task!r} is not a task: expected a method desired(t) -> (p_d, p_d', p_d'', p_d''')"
        )
    parts, name = task.desired(0.0), type(task).__name__
    shapes = [np.shape(part) for part in parts] if isinstance(parts, (tuple, list)) else []
    if len(shapes) != 4 or {len(shape) for shape in shapes} != {1} or len(set(shapes[1:])) != 1:
        raise UsageError(
            f"desired(t) of {name} gave arrays of shapes {shapes}; needed: four "
            "vectors p_d, p_d', p_d'', p_d''' of one length, for a pose 7, 6, 6 and 6"
        )
    axis = getattr(task, "tip_axis", None)
    found = task_map_for(shapes[0][0], shapes[1][0], None if axis is None else _unit(axis, name))
    if found.m > 3:
        what = "quaternion" if found.m == 6 else "axis"
        _unit(parts[0][3:], name, f"the desired {what} at t = 0 s")
    try:
        finite = bool(np.isfinite(np.concatenate(parts).astype(float)).all())
    except (TypeError, ValueError):
        finite = False
    if not finite:
        given = " ".join(repr(parts).split())
        raise UsageError(f"desired(t) of {name} gave {given} at t = 0 s; needed: finite numbers")
    for what in ("period", "duration"):
        time = getattr(task, what, None)
        if time is not None and not (isinstance(time, Real) and float(time) >= 0.0):
            raise UsageError(f"task {name}: {what} is {time!r}; allowed: a time (s), or None")
    return found


def time_of(task: Task, what: str) -> float | None:
    """A task's ``period`` or ``duration`` (s); None without one, or where it is 0 or without end."""
    time = getattr(task, what, None)
    return float(time) if time and math.isfinite(time) else None


def _unit(vector: Any, name: str, what: str = "tip_axis") -> Any:
    try:
        numbers = np.asarray(vector, dtype=float)
    except (TypeError, ValueError) as error:
        raise UsageError(f"task {name}: {what} is {vector!r}; needed: numbers") from error
    if numbers.ndim != 1 or not abs(numbers @ numbers - 1.0) <= UNIT:
        raise UsageError(
            f"task {name}: {what} is {numbers.tolist()}, of length {np.linalg.norm(numbers):.6g}; "
            "needed: length 1"
        )
    return tuple(numbers.tolist())


def task_parameters(task: Task) -> dict[str, Any]:
    """Type of a task, and its fields if it is a dataclass; with lists for tuples, as files have them."""

    def plain(value: Any) -> Any:
        return [plain(item) for item in value] if isinstance(value, (tuple, list)) else value

    kind: Any = type(task)
    fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    values = {item.name: plain(getattr(task, item.name)) for item in fields}
    return {"type": kind.__name__, **values}
